"""Another machine packed into an archive without a compiler: as sound as a built one, refused where it is not."""

import html
import json
import re
import shutil
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import fmpy
import numpy as np
import pytest

from feedsim_packager import build, cli, machine_tables, toolchain
from feedsim_packager.errors import InputError
from feedsim_packager.machine import named
from feedsim_packager.repack import repack
from fmu import test_archives as built
from fmu.pose_file import AXES, Grid
from fmu.unpacked import PLATFORM, ROOT, Archive, unpack
from machine_helpers import modes_csv

POSE = (0.5, -0.25, 1.0)
NAME, NOTE = "Lathe <5>", 'Shop 2 & "others"'
DEFAULT_AXES = ROOT / "src/plant_fmu/resources/axes.csv"
DEFAULT_MODES = ROOT / "scenarios/machines/test_centre/modes.csv"


def write_tables(folder: Path, grid: bytes | None = None) -> list[str]:
    """Write a machine's files; returns the packager's options that name them."""
    lines = ["axis,x_0 [m]", *(f"{axis},{x_0!r}" for axis, x_0 in zip(AXES, POSE, strict=True))]
    (folder / "axes.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "modes.csv").write_text(modes_csv(AXES), encoding="utf-8")
    options = ["--axes", str(folder / "axes.csv"), "--modes", str(folder / "modes.csv")]
    if grid is not None:
        (folder / "poses.bin").write_bytes(grid)
        options += ["--poses", str(folder / "poses.bin")]
    return options


@pytest.fixture(scope="module", params=["one pose", "grid of poses"])
def repacked(request: pytest.FixtureRequest, fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    """Packed by the command line."""
    folder = tmp_path_factory.mktemp("repacked")
    options = write_tables(folder, Grid().content() if request.param == "grid of poses" else None)
    out = folder / "packed" / "plant.fmu"
    arguments = ["repack", str(fmus / "plant.fmu"), *options, "--name", NAME, "--note", NOTE, "--out", str(out)]
    assert cli.main(arguments) == 0
    return unpack("plant", out.parent, folder / "unpacked")


# --- as sound as a built one

CHECKS: list[Callable[[Archive], None]] = [
    built.test_fmpy_finds_nothing_to_complain_about,
    built.test_description_follows_the_schema_of_the_standard,
    built.test_archive_has_its_parts_and_no_trace_of_this_machine,
    built.test_every_declared_variable_is_described,
    built.test_units_and_types_are_defined,
    built.test_a_variables_display_unit_is_that_of_its_row,
    built.test_structure_tells_the_direct_feedthrough,
    built.test_guid_is_the_hash_of_table_and_resources,
    built.test_binary_starts_with_the_described_values,
    built.test_initial_values_depend_on_the_inputs_that_are_told,
    built.test_archive_of_another_table_is_refused,
    built.test_archive_of_other_resources_is_refused,
]


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__.removeprefix("test_"))
def test_passes_the_checks_of_a_built_archive(check: Callable[[Archive], None], repacked: Archive) -> None:
    check(repacked)


def test_holds_what_it_was_given_and_keeps_the_rest(repacked: Archive, fmus: Path) -> None:
    given = repacked.path.parents[1]
    files = {path.name for path in (repacked.folder / "resources").iterdir()}
    assert files == {name for name in ("axes.csv", "modes.csv", "poses.bin") if (given / name).exists()}
    for name in files:
        assert (repacked.folder / "resources" / name).read_bytes() == (given / name).read_bytes()
    changed = {"modelDescription.xml", "documentation/index.html", "sources/embedded_resources.c"}
    changed |= {"terminalsAndIcons/terminalsAndIcons.xml"}  # terminals are the axes'
    with zipfile.ZipFile(fmus / "plant.fmu") as base, zipfile.ZipFile(repacked.path) as packed:
        gone = ("resources/", "extra/", "documentation/fmi-ls-ref")
        kept = [name for name in base.namelist() if not name.startswith(gone) and name not in changed]
        assert f"binaries/{PLATFORM.folder}/plant{PLATFORM.suffix}" in kept
        assert {name: packed.read(name) for name in kept} == {name: base.read(name) for name in kept}
        assert {name for name in packed.namelist() if not name.startswith("resources/")} == {*kept, *changed}
        assert b"fmi-ls-ref.html" in base.read("documentation/index.html")
        assert b"fmi-ls-ref.html" not in packed.read("documentation/index.html")


def test_embedded_copy_is_the_tables(repacked: Archive) -> None:
    text = (repacked.folder / "sources" / "embedded_resources.c").read_text(encoding="utf-8")
    arrays = dict(re.findall(r"const unsigned char embedded_(\w+)\[\] = \{([^}]*)\}", text))
    assert arrays.keys() == {"axes", "modes"}
    for name, body in arrays.items():
        content = (repacked.folder / "resources" / f"{name}.csv").read_bytes()
        assert bytes(map(int, body.split(","))) == content
    assert ("poses.bin, which is not embedded" in text) == (repacked.folder / "resources" / "poses.bin").exists()


def test_says_which_machine_it_is(repacked: Archive) -> None:
    assert repacked.description.attrib["description"].endswith(f". Machine: {NAME}. {NOTE}")
    text = (repacked.folder / "documentation/index.html").read_text(encoding="utf-8")
    assert f"<strong>{html.escape(NAME)}</strong>" in text
    assert f"<p>{html.escape(NOTE)}</p>" in text
    assert "X at 0.5 m, spindle_2 at -0.25 m, W at 1 m" in text
    assert "Start values are those of a synthetic default machine" not in text
    assert not re.search(r"the machine in (the|this) archive, <code>test_centre", text)
    assert ("grid of poses in resources/poses.bin" in text) == (repacked.folder / "resources/poses.bin").exists()
    for name in repacked.variables():
        assert f"<code>{name}</code>" in text
    assert "<code>Y.x_a</code>" not in text


def test_packing_again_leaves_nothing_of_the_machine_before(repacked: Archive, fmus: Path, tmp_path: Path) -> None:
    """An archive packed from a packed one is the one packed from the built one, to the byte."""
    for base in (fmus / "plant.fmu", repacked.path):
        arguments = ["--axes", str(DEFAULT_AXES), "--modes", str(DEFAULT_MODES), "--name", "Mill"]
        assert cli.main(["repack", str(base), *arguments, "--out", str(tmp_path / base.parent.name / "x.fmu")]) == 0
    first, second = (
        (tmp_path / base.parent.name / "x.fmu").read_bytes() for base in (fmus / "plant.fmu", repacked.path)
    )
    assert first == second


def test_same_machine_gives_the_built_archive(plant: Archive, tmp_path: Path) -> None:
    """All but the references and the page of documentation, which do not know that it is the default machine again."""
    out = tmp_path / "plant.fmu"
    tables = ["--axes", str(DEFAULT_AXES), "--modes", str(DEFAULT_MODES)]
    assert cli.main(["repack", str(plant.path), *tables, "--out", str(out)]) == 0
    with zipfile.ZipFile(plant.path) as base, zipfile.ZipFile(out) as packed:
        # references are of built ones alone
        kept = [name for name in base.namelist() if not name.startswith(("extra/", "documentation/fmi-ls-ref"))]
        assert packed.namelist() == kept
        assert [name for name in kept if packed.read(name) != base.read(name)] == ["documentation/index.html"]


@pytest.mark.extensive
def test_building_with_tables_gives_the_repacked_archive(repacked: Archive, tmp_path: Path) -> None:
    """Binaries are left out: they are those of `fmus`, which may have been built elsewhere and for more platforms."""
    given = repacked.path.parents[1]
    grid = given / "poses.bin"
    compiler = toolchain.find_compiler()
    unit = build.load(
        build.unit_directory("plant"),
        compiler,
        axes=given / "axes.csv",
        modes=given / "modes.csv",
        poses=grid if grid.exists() else None,
        name=NAME,
        note=NOTE,
    )
    build.build(unit, tmp_path / "plant.fmu", compiler)
    with zipfile.ZipFile(tmp_path / "plant.fmu") as first, zipfile.ZipFile(repacked.path) as second:
        names, packed = ([n for n in each.namelist() if not n.startswith("binaries/")] for each in (first, second))
        assert names == packed
        for name in names:
            assert first.read(name) == second.read(name), name


# --- simulated

STEP, STEPS = 125e-6, 400


def simulate(path: Path, drive: str, watch: Sequence[str], start: dict[str, object]) -> np.ndarray:
    """Outputs `watch` under a torque that shakes one axis and carries it along, by fmpy's own simulation."""
    time = np.arange(STEPS + 1) * STEP
    torque = 6.0 * np.sin(2 * np.pi * 45.0 * time) + 3.0
    signals = np.array(
        [tuple(row) for row in np.column_stack([time, torque])], dtype=[("time", float), (f"{drive}.M_a", float)]
    )
    result = fmpy.simulate_fmu(
        str(path),
        stop_time=time[-1],
        step_size=STEP,
        output_interval=STEP,
        input=signals,
        output=list(watch),
        start_values=start,
    )
    return np.column_stack([result[name] for name in watch])


def test_packed_tables_give_the_numbers_of_modes_file(fmus: Path, tmp_path: Path) -> None:
    """The same table, read from a file by the archive as it was built, and packed: the same bits."""
    axes = ("X", "Y", "Z")
    (tmp_path / "modes.csv").write_text(modes_csv(axes), encoding="utf-8")
    (tmp_path / "axes.csv").write_text("axis,x_0 [m]\nX,0.25\nY,0.5\nZ,0.125\n", encoding="utf-8")
    given = machine_tables.read(tmp_path / "axes.csv", tmp_path / "modes.csv")
    repack(fmus / "plant.fmu", given, named(), tmp_path / "own.fmu")
    watch = ("Y.x_a", "Y.n_a", "Y.n_fr", "tool.x_Y", "tcp.x_Y", "X.x_a")
    start = {"modes_file": str(tmp_path / "modes.csv"), "X.x_0": 0.25, "Y.x_0": 0.5, "Z.x_0": 0.125}
    by_file = simulate(fmus / "plant.fmu", "Y", watch, start)
    packed = simulate(tmp_path / "own.fmu", "Y", watch, {})
    assert np.ptp(by_file[:, 0]) > 1e-4  # it moved
    assert np.array_equal(packed, by_file)


def test_grid_of_equal_poses_changes_nothing(fmus: Path, tmp_path: Path) -> None:
    """Over both boundaries of X: where all cells have the same modes, following the axes is staying in one pose."""
    given = []
    for grid in (None, Grid(directions=[[0, 3, 0, 0.4, 0.5002, 0.6, 0.5001, 0.5004], [2, 2, 0, 0, 1, 0.5]]).content()):
        write_tables(tmp_path, grid)
        given.append(
            machine_tables.read(tmp_path / "axes.csv", tmp_path / "modes.csv", tmp_path / "poses.bin" if grid else None)
        )
    watch = ("X.x_a", "X.n_a", "tool.x_X", "W.x_a", "spindle_2.x_a", "pose.crossings")
    results = []
    for i, each in enumerate(given):
        repack(fmus / "plant.fmu", each, named(), tmp_path / f"{i}.fmu")
        results.append(simulate(tmp_path / f"{i}.fmu", "X", watch, {}))
    stays, follows = results
    assert follows[-1, -1] == 2 > stays[-1, -1] == 0
    # T = 1 adds zeros to what it carries over: not a bit changes.
    assert np.array_equal(follows[:, :-1], stays[:, :-1])


# --- platforms

OTHER = "binaries/aarch64-plan9/plant.so"


def test_binaries_of_other_platforms_are_kept(plant: Archive, tmp_path: Path) -> None:
    """Also where the one of this platform is missing: then nothing can be tried."""
    options = write_tables(tmp_path)
    base = tmp_path / "base.fmu"
    shutil.copy(plant.path, base)
    with zipfile.ZipFile(base, "a") as archive:
        archive.writestr(OTHER, b"another platform's")
    given = machine_tables.read(tmp_path / "axes.csv", tmp_path / "modes.csv")
    done = repack(base, given, named(), tmp_path / "both.fmu")
    with zipfile.ZipFile(plant.path) as archive:
        held = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
    assert PLATFORM.folder in held
    assert done.platforms == tuple(sorted((*held, "aarch64-plan9")))
    assert done.tried
    with zipfile.ZipFile(tmp_path / "both.fmu") as archive:
        assert archive.read(OTHER) == b"another platform's"

    with zipfile.ZipFile(plant.path) as whole, zipfile.ZipFile(base, "w") as foreign:
        foreign.writestr(OTHER, b"another platform's")
        for name in whole.namelist():
            if not name.startswith("binaries/"):
                foreign.writestr(name, whole.read(name))
    assert cli.main(["repack", str(base), *options, "--out", str(tmp_path / "foreign.fmu")]) == 0
    done = repack(base, given, named(), tmp_path / "foreign.fmu")
    assert done.platforms == ("aarch64-plan9",)
    assert not done.tried


# --- refused


def altered(base: Path, out: Path, changes: dict[str, bytes | None]) -> Path:
    with zipfile.ZipFile(base) as whole, zipfile.ZipFile(out, "w") as other:
        for name in whole.namelist():
            content = changes.get(name, whole.read(name))
            if content is not None:
                other.writestr(name, content)
    return out


def test_unsuitable_bases_are_refused(plant: Archive, fmus: Path, tmp_path: Path) -> None:
    write_tables(tmp_path)
    given = machine_tables.read(tmp_path / "axes.csv", tmp_path / "modes.csv")
    carried = json.loads((plant.folder / "sources" / "variables.json").read_text(encoding="utf-8"))

    def with_table(**changes: object) -> Path:
        content = json.dumps(carried | changes).encode()
        return altered(plant.path, tmp_path / "base.fmu", {"sources/variables.json": content})

    other_start = [row | {"unit": "mm"} if row["name"] == "x_a" else row for row in carried["axis_rows"]]
    (tmp_path / "text.fmu").write_text("no archive", encoding="utf-8")
    whole = plant.path.read_bytes()
    (tmp_path / "cut.fmu").write_bytes(whole[: len(whole) // 2])
    cases: list[tuple[Callable[[], Path], str]] = [
        (lambda: tmp_path / "nowhere.fmu", r"nowhere\.fmu: cannot be read: No such file"),
        (lambda: tmp_path / "text.fmu", r"text\.fmu: not an archive, or damaged"),
        (lambda: tmp_path / "cut.fmu", r"cut\.fmu: not an archive, or damaged"),
        (lambda: fmus / "friction.fmu", "friction: takes no resources"),
        (lambda: altered(plant.path, tmp_path / "b.fmu", {"modelDescription.xml": None}), "has no modelDescription"),
        (lambda: altered(plant.path, tmp_path / "b.fmu", {"modelDescription.xml": b"<a"}), "cannot be read"),
        (lambda: altered(plant.path, tmp_path / "b.fmu", {"sources/variables.json": None}), "has no sources/variables"),
        (lambda: altered(plant.path, tmp_path / "b.fmu", {"sources/variables.json": b"[]"}), "not a table"),
        (
            lambda: altered(plant.path, tmp_path / "b.fmu", {"documentation/index.html": b"<p>"}),
            "has no part 'machine'",
        ),
        (lambda: with_table(format=3), "has format 3, this packager reads format 2"),
        (lambda: with_table(scalars=[{"name": "a"}]), "not a table of variables: KeyError"),
        (lambda: with_table(scalars=["a"]), "not a table of variables: AttributeError"),
        (lambda: with_table(version=1), "must be texts"),
        (lambda: with_table(axis_rows=[row | {"start": 0} for row in carried["axis_rows"]]), "start of M_a is 0"),
        (lambda: with_table(axis_rows=other_start), "the archive was altered; build it anew"),
    ]
    for base, text in cases:
        with pytest.raises(InputError, match=text):
            repack(base(), given, named(), tmp_path / "out.fmu")
        assert not (tmp_path / "out.fmu").exists()


def test_axis_named_like_a_group_is_refused(fmus: Path, tmp_path: Path) -> None:
    (tmp_path / "axes.csv").write_text("axis,x_0 [m]\ntool,0\n", encoding="utf-8")
    (tmp_path / "modes.csv").write_text(modes_csv(["tool"]), encoding="utf-8")
    given = machine_tables.read(tmp_path / "axes.csv", tmp_path / "modes.csv")
    with pytest.raises(InputError, match="an axis cannot be named tool"):
        repack(fmus / "plant.fmu", given, named(), tmp_path / "out.fmu")


def test_stale_files_of_a_packed_machine_are_refused_by_the_unit(repacked: Archive, tmp_path: Path) -> None:
    for path in (repacked.folder / "resources").iterdir():
        folder = tmp_path / path.name
        shutil.copytree(repacked.folder, folder)
        (folder / "resources" / path.name).write_bytes(path.read_bytes() + b"\n")
        with pytest.raises(Exception, match="instantiate"):
            built.instantiate(repacked, folder)


def test_what_the_unit_refuses_is_not_packed(plant: Archive, fmus: Path, tmp_path: Path) -> None:
    """The trial: a base whose binary is another unit's."""
    write_tables(tmp_path)
    binary = f"binaries/{PLATFORM.folder}/plant{PLATFORM.suffix}"
    with zipfile.ZipFile(fmus / "friction.fmu") as friction:
        content = friction.read(binary.replace("plant.", "friction."))
    base = altered(plant.path, tmp_path / "base.fmu", {binary: content})
    with pytest.raises(InputError, match="cannot be instantiated"):
        repack(base, machine_tables.read(tmp_path / "axes.csv", tmp_path / "modes.csv"), named(), tmp_path / "out.fmu")
    assert not (tmp_path / "out.fmu").exists()
