"""An archive alone, in FMPy as an integrator has it, against the references that it carries; and which carry them.

In the first part nothing of the repository is used to run or to compare: FMPy's own simulate_fmu, the archive's list of
experiments, its parameter sets, inputs and tolerances.
"""

from __future__ import annotations

import csv
import io
import re
import shutil
import zipfile
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import fmpy
import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from feedsim_packager import build, cli, reference, toolchain
from feedsim_packager.errors import InputError

ROOT = "extra/org.fmi-standard.fmi-ls-ref/"
UNITS = ("friction", "friction_gms", "plant", "controller", "setpoint")
SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"
LS = "{http://fmi-standard.org/fmi-ls-manifest}"
# roles that fmi-ls-ref 1.0.0-alpha.1 knows, of those used here
ROLES = r"document|parameter|experiment/validation|result|configuration|other"

Table = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Carried:
    """What an archive has below ROOT, by the path there."""

    path: Path
    files: dict[str, bytes]

    def table(self, name: str) -> Table:
        header, *rows = csv.reader(io.StringIO(self.files[name].decode("ascii")))
        return dict(zip(header, np.array(rows, dtype=float).T, strict=True))

    def tolerance(self, reference: str, name: str, values: NDArray[np.float64]) -> float:
        """Of the file beside the reference, the case's own first; a bare number is a share of the range."""
        folder = reference.rpartition("/")[0]
        own = reference.removesuffix(".csv") + ".tolerances.yaml"
        text = self.files.get(own) or self.files[f"{folder}/tolerances.yaml".lstrip("/")]
        found = None
        for pattern, given in yaml.safe_load(text)["variables"].items():
            if re.fullmatch(pattern.replace(".", r"\.").replace("*", ".*"), name):
                number, _, unit = str(given["value"] if isinstance(given, dict) else given).partition(" ")
                found = float(number) if unit else float(number) * max(np.ptp(values), 1e-6 * np.max(np.abs(values)))
        assert found is not None, f"{name} has no tolerance in {own}"
        return found


def carried(path: Path) -> Carried:
    with zipfile.ZipFile(path) as archive:
        names = [name for name in archive.namelist() if name.startswith(ROOT)]
        return Carried(path, {name.removeprefix(ROOT): archive.read(name) for name in names})


@pytest.fixture(scope="module", params=UNITS)
def unit(request: pytest.FixtureRequest, fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Carried:
    """A copy, so that nothing beside it can help."""
    path = tmp_path_factory.mktemp("alone") / "unit.fmu"
    shutil.copy(fmus / f"{request.param}.fmu", path)
    return carried(path)


def simulate(unit: Carried, experiment: ET.Element, reference: Table) -> Table:
    """FMPy's simulate_fmu; it holds inputs over a step."""
    parameters = {}
    if (element := experiment.find("Parameters")) is not None:
        for parameter in ET.fromstring(unit.files[element.attrib["source"]]).iter(f"{SSV}Parameter"):
            parameters[parameter.attrib["name"]] = parameter[0].attrib["value"]
    signals = None
    if (element := experiment.find("Stimuli")) is not None:
        inputs = unit.table(element.attrib["source"])
        signals = np.array(list(zip(*inputs.values(), strict=True)), dtype=[(name, np.float64) for name in inputs])
    start, stop, step = (float(experiment.attrib[name]) for name in ("startTime", "stopTime", "stepSize"))
    found = fmpy.simulate_fmu(
        str(unit.path),
        start_time=start,
        stop_time=stop,
        output_interval=step,
        start_values=parameters,
        input=signals,
        output=[name for name in reference if name != "time"],
    )
    rows = np.round((reference["time"] - start) / step).astype(int)
    assert np.max(np.abs(found["time"][rows] - reference["time"])) < 1e-9
    return {name: np.asarray(found[name], dtype=float)[rows] for name in found.dtype.names}


def test_references_in_fmpy(unit: Carried) -> None:
    """Every experiment for importers that hold inputs, or whose inputs may as well be held."""
    experiments = ET.fromstring(unit.files["experiments.exp"]).findall("Experiment")
    held = {each.attrib["name"] for each in experiments if each.attrib["name"].startswith("held/")}
    tried = [each for each in experiments if f"held/{each.attrib['name']}" not in held]
    assert len(tried) >= 2
    for experiment in tried:
        source = experiment.find("References").attrib["source"]  # type: ignore[union-attr]
        reference = unit.table(source)
        result = simulate(unit, experiment, reference)
        for name, values in reference.items():
            if name != "time":
                deviation = np.max(np.abs(result[name] - values))
                assert deviation <= unit.tolerance(source, name, values), f"{source}: {name} is off by {deviation}"


def test_a_wrong_parameter_is_found(fmus: Path, tmp_path: Path) -> None:
    """The way of comparing above can fail: 0.1 % of the bristle stiffness."""
    unit = carried(Path(shutil.copy(fmus / "friction.fmu", tmp_path)))
    experiment = ET.Element("Experiment", startTime="0", stopTime="1", stepSize="0.000125")
    ET.SubElement(experiment, "Stimuli", source="presliding_in.csv")
    ET.SubElement(experiment, "Parameters", source="off.ssv")
    text = f'<a xmlns="{SSV[1:-1]}"><Parameter name="sigma_0"><Real value="300.3"/></Parameter></a>'
    reference = unit.table("held/presliding_ref.csv")
    result = simulate(Carried(unit.path, unit.files | {"off.ssv": text.encode()}), experiment, reference)
    deviation = np.max(np.abs(result["M_fr"] - reference["M_fr"]))
    assert deviation > 1e6 * unit.tolerance("held/presliding_ref.csv", "M_fr", reference["M_fr"])


def test_manifest_names_every_file_with_a_role(unit: Carried) -> None:
    root = ET.fromstring(unit.files["fmi-ls-manifest.xml"])
    assert root.tag == "fmiReferences"
    assert root.attrib[f"{LS}fmi-ls-name"] == "org.fmi-standard.fmi-ls-ref"
    assert root.attrib[f"{LS}fmi-ls-version"] == "1.0.0-alpha.1"
    assert root.attrib[f"{LS}fmi-ls-description"] == (
        "Layered Standard providing information on related files included in an FMU."
    )
    related = [each.attrib for each in root.findall("Related")]
    assert sorted(each["source"] for each in related) == sorted(set(unit.files) - {"fmi-ls-manifest.xml"})
    for each in related:
        assert re.fullmatch(ROLES, each["role"])
        assert each["description"]
        assert "octet" not in each["type"]


def test_readme_tells_every_case(unit: Carried) -> None:
    text = unit.files["README.md"].decode("utf-8")
    cases = {name.removesuffix("_ref.csv") for name in unit.files if name.endswith("_ref.csv") and "/" not in name}
    assert cases
    for case in cases:
        assert f"| `{case}` | " in text
    assert "## How to compare" in text
    assert "synthetic" in text


def test_archives_stay_small(fmus: Path) -> None:
    for unit in UNITS:
        with zipfile.ZipFile(fmus / f"{unit}.fmu") as archive:
            added = sum(entry.compress_size for entry in archive.infolist() if entry.filename.startswith(ROOT))
        assert 0 < added < 350_000, unit  # a quarter of it the bounds between the rows


# --- archives of something else


def test_another_machine_carries_no_references(fmus: Path, tmp_path: Path) -> None:
    """One frequency off by a millionth is another machine already; the rest of the archive stays."""
    base = fmus / "plant.fmu"
    with zipfile.ZipFile(base) as archive:
        for name in ("axes.csv", "modes.csv"):
            (tmp_path / name).write_bytes(archive.read(f"resources/{name}"))
    modes = (tmp_path / "modes.csv").read_bytes()
    (tmp_path / "modes.csv").write_bytes(modes.replace(b",21.08535117401698,", b",21.08537225936815,"))
    assert (tmp_path / "modes.csv").read_bytes() != modes
    out = tmp_path / "packed.fmu"
    given = ["--axes", str(tmp_path / "axes.csv"), "--modes", str(tmp_path / "modes.csv")]
    assert cli.main(["repack", str(base), *given, "--out", str(out)]) == 0
    assert carried(base).files
    assert not carried(out).files
    with zipfile.ZipFile(out) as packed, zipfile.ZipFile(base) as built:
        gone = ("extra/", "documentation/fmi-ls-ref")
        assert packed.namelist() == [path for path in built.namelist() if not path.startswith(gone)]


def test_another_motion_carries_no_references(fmus: Path, tmp_path: Path) -> None:
    base = fmus / "setpoint.fmu"
    with zipfile.ZipFile(base) as archive:
        rows = archive.read("resources/setpoints.csv").decode().splitlines()
    (tmp_path / "setpoints.csv").write_text("\n".join(rows[:-1]) + "\n")
    out = tmp_path / "packed.fmu"
    assert cli.main(["repack", str(base), "--setpoints", str(tmp_path / "setpoints.csv"), "--out", str(out)]) == 0
    assert not carried(out).files


def test_a_unit_built_for_another_machine_has_none(fmus: Path) -> None:
    compiler = toolchain.find_compiler()
    default = build.load(build.unit_directory("plant"), compiler)
    own = build.load(build.unit_directory("plant"), compiler, name="Mill")
    assert build._references(default)
    assert not build._references(own)


def write_case(folder: Path, readme: str = "| `a` | something |\n", parameters: str = "W,0") -> Path:
    unit = folder / "unit"
    unit.mkdir()
    (folder / "integrators.md").write_text("## How\n")
    (unit / "README.md").write_text(readme)
    (unit / "a_ref.csv").write_text('"time","M_fr"\n0,0\n')
    (unit / "a_ref.opt").write_text("StartTime,0\nStopTime,1\nStepSize,0.1\nRelTol,1e-6\n")
    (unit / "a_par.csv").write_text(f'"name","value"\n{parameters}\n')
    return unit


def test_cases_that_cannot_be_carried_are_refused(tmp_path: Path) -> None:
    variables = build.load(build.unit_directory("friction"), toolchain.find_compiler()).variables
    for name, given, told in (
        ("untold", {"readme": "no table\n"}, "no row of the case 'a'"),
        ("unknown", {"parameters": "V,0"}, "no variable 'V'"),
    ):
        (tmp_path / name).mkdir()
        with pytest.raises(InputError, match=told):
            reference.files(write_case(tmp_path / name, **given), variables)
    found = reference.files(write_case(tmp_path), variables)
    assert b'<ssv:Parameter name="W"><ssv:Real value="0"/>' in found[ROOT + "a_par.ssv"]
    assert reference.files(tmp_path / "nowhere", variables) == {}


def test_units_of_others_have_none(tmp_path: Path, fmus: Path) -> None:
    """A unit's folder that is not the project's own takes no references, whatever its name."""
    folder = tmp_path / "friction_fmu"
    shutil.copytree(build.unit_directory("friction"), folder)
    assert not build._references(build.load(folder, toolchain.find_compiler()))


def test_parameter_sets_are_valid_ssp(unit: Carried, tmp_path: Path) -> None:
    ssv = pytest.importorskip("pyssp_standard.ssv", reason="pyssp-standard is not installed")
    for name, content in unit.files.items():
        if name.endswith(".ssv"):
            (tmp_path / name).write_bytes(content)
            with ssv.SSV(tmp_path / name) as file:
                assert file.parameters, name
                file.__check_compliance__()
