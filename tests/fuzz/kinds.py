"""Kinds of files that feedsim reads, what reads them, and whole ones of each, from which others are made."""

from __future__ import annotations

import io
import json
import re
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import mat_helpers
from feedsim import scenario
from feedsim.analysis import check as check_evaluation
from feedsim.design.sweep.table import read_table
from feedsim.files import trace
from feedsim.files.columns import load_columns, load_tolerances
from feedsim.files.control import formats, reading
from feedsim.files.trace.response_files import read_response
from feedsim.files.trace.series import read_series
from feedsim.foundation.errors import FeedsimError
from feedsim.scenario.load import load_machine, read_friction
from feedsim.scenario.roles import DRIVE
from feedsim.scenario.structure_checks import load_structure
from feedsim.scenario.study import load_study
from feedsim.simulation import judge, ssp
from feedsim.simulation.cosim.archive import Archive, folders
from feedsim.simulation.cosim.roles import connect_foreign_unit
from feedsim.structure.matrices import build as market
from feedsim.structure.matrices import calculix
from feedsim.structure.modes import read_modes
from feedsim.structure.poses import read_cell, read_grid
from fuzz.changes import entries, packed

ROOT = Path(__file__).resolve().parents[2]
MACHINE = ROOT / "scenarios" / "machines" / "test_centre"


@dataclass(frozen=True)
class Kind:
    """How files of a kind are called and read; `whole`: files of it that can be read."""

    suffix: str
    read: Callable[[Path], object]
    whole: Sequence[bytes]


def _all(recording: trace.Recording) -> None:
    with suppress(FeedsimError):
        recording.read(recording.names)
    for name in recording.names[:3]:
        recording.read([name])


def _open_archive(path: Path) -> None:
    with Archive(path) as archive:
        unit = scenario.ForeignUnit.model_construct(
            fmu=path, inputs=_Names({"x_s": "PosSetpoint", "x_a": "PosActual"}), outputs=_Names({"M_a": "Torque"}),
            parameters={"Kv": "40 1/s", "Tn": 30},
        )  # fmt: skip
        _ = archive.unit_definitions, archive.platforms, archive.version
        for name in archive.variables:
            archive.unit_of(name)
        with suppress(FeedsimError):
            archive.library()
        if "x_s" not in archive.variables and "tool.F_X" not in archive.variables:  # not one of ours
            connect_foreign_unit(DRIVE, "Z", unit, archive)


class _Names:
    """What a mapping says, whatever the model."""

    def __init__(self, names: Mapping[str, str]) -> None:
        self._names = names

    def model_dump(self, **_: object) -> Mapping[str, str]:
        return self._names


def _judge(path: Path) -> None:
    with ssp.open_system(path) as found:
        check_evaluation(found.scenario, found.program)
        judge.check(found.scenario, found.program, fmus=found.fmus)


def _poses(path: Path) -> None:
    read_grid(path, ("X", "spindle_2", "W"))
    read_cell(path, ("X", "spindle_2", "W"), {"X": 0.8, "spindle_2": 0.3, "W": 0.1})


def read_control(path: Path) -> None:
    """A file of a control, and the values of its first axis or list."""
    archive = formats.parse_file(path.name, path.read_bytes(), path)
    axes = [entry.axis for entry in archive.entries if entry.axis] or list(archive.places)
    if axes:
        with suppress(FeedsimError):
            reading.read_values([archive], {"X": axes[0]}, checked=["all"])


def kinds(folder: Path, fmus: Path) -> dict[str, Kind]:
    """Every kind of file that feedsim reads, with files that can be read; made in `folder`."""
    from fmu.pose_file import Grid

    rows = "\n".join(f"{0.001 * i:.3f},{np.sin(0.1 * i):.6g},{i % 7}" for i in range(60))
    commas = "\n".join(f"{i};{0.5 * i:.3f};{np.cos(i):.5f}".replace(".", ",") for i in range(40))
    traces = [
        f"time [s],Z.x_a [mm],Z.M_a [N.m]\n{rows}\n".encode(),
        f"t (ms);x (mm);i_q (A)\n{commas}\n".encode("utf-16"),
    ]
    response = "\n".join(f"{1.5**i:.4g},{1 / (1 + i):.5g},{-10 * i},0.99" for i in range(20))
    responses = [f"frequency [Hz],Z magnitude [m/N],Z phase [deg],Z coherence [1]\n{response}\n".encode()]
    machines = ROOT / "scenarios" / "machines"
    structure = (machines / "one_axis" / "structure.yaml").read_bytes()
    emps = (machines / "emps" / "machine.yaml").read_text(encoding="utf-8")
    machine = re.sub(r"(?m)^modes: .*$", f"modes: {machines / 'emps' / 'modes.csv'}", emps).encode()
    columns = (machines / "emps" / "columns.yaml").read_bytes()
    friction = (b"F_C: 1.8 N.m\nF_S: 2.3 N.m\nv_s: 2 rad/s\nsigma_0: 300 N.m/rad\nsigma_1: 0.3 N.m.s/rad\n"
                b"sigma_2: 0.01 N.m.s/rad\nW: 0 rad\n")  # fmt: skip
    tolerances = (b'name: Z move\nvalue: 1e-6\ntime: 125 us\nvariables:\n  "*.x_a": 2 nm\n  "*.M_a": {value: 1e-3 N.m, '
                  b'time: 1 ms}\n  "*.limited": {hold: true, time: &a 1 ms}\n  "Y.*": ignore\n')  # fmt: skip
    z = (ROOT / "scenarios" / "z_positioning.yaml").read_text(encoding="utf-8")
    plan = re.sub(r"(?m)^machine: .*$", f"machine: {MACHINE}", z).encode()
    (folder / "plan.yaml").write_bytes(plan + b"\nset: {machine.structure: null}\n")
    study = (
        f"name: s\nscenario: {folder / 'plan.yaml'}\nsampling: {{method: latin_hypercube, runs: 5, seed: 1}}\n"
        "parameters:\n  jerk: {key: machine.path.jerk, from: 50 m/s^3, to: 400 m/s^3}\n"
        "  W: {key: machine.axes.*.friction.W, values: [0 rad, 1 rad]}\nfigures: [Z.overshoot]\n"
    ).encode()
    table = "run,seed,Z.F_C [N.m],status,seconds\n" + "\n".join(f"{i},1,{0.1 * i},ok,0.5" for i in range(9))
    matrix = "%%MatrixMarket matrix coordinate real symmetric\n4 4 5\n1 1 2.0\n2 1 -1\n2 2 2\n3 3 1\n4 4 1e3\n"
    dense = "%%MatrixMarket matrix array real general\n2 2\n1\n0\n0\n1\n"
    nodes = "*NODE, NSET=all\n1, 0, 0, 0\n2, 1, 0, 0\n3, 0, 1, 0\n4, 0, 0, 1\n"
    mesh = f"{nodes}*ELEMENT, TYPE=C3D4, ELSET=bed\n1, 1, 2, 3, 4\n"
    return {
        "csv": Kind(".csv", lambda path: _all(trace.read_recording(path)), traces),
        "trace": Kind(".csv", trace.read_csv, traces[:1]),
        "series": Kind(".csv", read_series, traces),
        "setpoints": Kind(".csv", lambda path: trace.read_signals(path, {"Z": ("Z.x_a", None)}, "m"), traces[:1]),
        "response": Kind(".csv", read_response, responses),
        "mat": Kind(".mat", lambda path: _all(trace.read_recording(path)), _mat()),
        "mat_series": Kind(".mat", read_series, _modelica()),
        "mat_hdf5": Kind(".mat", lambda path: _all(trace.read_recording(path)), _hdf5()),
        "capture": Kind(".json", lambda path: _all(trace.read_recording(path)), [_capture()]),
        "xml": Kind(".xml", lambda path: _all(trace.read_recording(path)), _xml()),
        "response_xml": Kind(".xml", read_response, _xml()[1:]),
        "scope": Kind(".csv", lambda path: _all(trace.read_recording(path)), _scopes()),
        "uff": Kind(".uff", read_response, _uff(folder)),
        "scenario": Kind(".yaml", scenario.load, [plan]),
        "machine": Kind(".yaml", load_machine, [machine]),
        "structure": Kind(".yaml", load_structure, [structure]),
        "study": Kind(".yaml", load_study, [study]),
        "friction": Kind(".yaml", read_friction, [friction]),
        "columns": Kind(".yaml", load_columns, [columns]),
        "tolerances": Kind(".yaml", load_tolerances, [tolerances]),
        "modes": Kind(".csv", lambda path: read_modes(path, ("X", "Y", "Z")), [(MACHINE / "modes.csv").read_bytes()]),
        "poses": Kind(".bin", _poses, [Grid().content()]),
        "matrix": Kind(".mtx", lambda path: market.read_matrix(path, "mass"), [matrix.encode(), dense.encode()]),
        "mesh": Kind(".inp", lambda path: list(calculix._cards(path)), [mesh.encode()]),
        "table": Kind(".csv", read_table, [table.encode()]),
        "control": Kind(".arc", read_control, _controls()),
        "fmu": Kind(".fmu", _open_archive, _fmus(fmus)),
        "ssp": Kind(".ssp", _judge, [_ssp(folder, fmus)]),
    }


def _controls() -> list[bytes]:
    from control_helpers import DRIVE, INI, NC, TABLE

    xti = '<TcSmItem><Axis><Name>X</Name><AxisPara><Velo Maximum="250"/></AxisPara></Axis></TcSmItem>'
    programs = "%_N_SLOW_SPF\nPROC SLOW\nN20 $MA_MAX_AX_ACCEL[0,AX1]=4\nRET\n"
    found = [NC + programs, NC + DRIVE, DRIVE, TABLE, INI, xti, "kopf.log_achs_name X\ngetriebe[0].kv 5000 # 0.01/s\n"]
    return [text.encode() for text in found]


def _mat() -> list[bytes]:
    from scipy.io import savemat

    content = {"t": np.arange(20) / 500, "n": np.arange(20, dtype=np.int16), "k": 2.5, "q": np.eye(3)}
    more = {
        "s": {"a": np.ones(4), "b": {"c": 1.0}},
        "several": np.array([(np.ones(4), "y"), (np.ones(4), "z")], dtype=[("values", object), ("label", object)]),
        "text": "x",
        "c": np.array([1, "y"], dtype=object),
        "z": np.ones(3) * 1j,
    }
    found = []
    for form, compressed in (("4", False), ("5", False), ("5", True)):
        buffer = io.BytesIO()
        savemat(buffer, content if form == "4" else content | more, format=form, do_compression=compressed)
        found.append(buffer.getvalue())
    return found


def _modelica() -> list[bytes]:
    """Result files of Modelica tools in both layouts, and a matrix with its time in the first row."""
    time = np.arange(20) / 500
    tables = [np.array([[0.0, 2.5], [time[-1], 2.5]]), np.column_stack([time, np.sin(time)])]
    variables = {"x": ("position [m]", 2, 2), "minus_x": ("alias", 2, -2), "k": ("parameter [1/s]", 1, 2)}
    return [mat_helpers.modelica(time, variables, tables, across) for across in (True, False)]


def _hdf5() -> list[bytes]:
    """Version 7.3: Simulink's structure with time, and nested ones."""
    time = np.arange(20) / 500
    signals = [{"values": time, "label": "x [mm]"}, {"values": np.column_stack([time, time]), "label": ""}]
    contents = ({"t": time, "simout": {"time": time, "signals": signals}}, {"a": {"b": {"c": time}}, "text": "x"})
    return [mat_helpers.hdf5(content) for content in contents]


def _capture() -> bytes:
    signals = ("CYCLE", "DES_POS|2", "ENC_POS|2", "TORQUE|2", "POWER|2", "CMD_SPEED|2")
    listed = [{"Name": name, "Type": "DOUBLE", "Axis": "Y1", "Address": name} for name in signals]
    rows = [[100 + i, *(float(np.sin(0.2 * i + k)) for k in range(5))] for i in range(30)]
    event = {"HFBlockEvent": {"GCode": "G1 Y10", "HFProbeCounter": 110}}
    return json.dumps(
        {"Header": {"CycleTimeMs": 2, "SignalListHFData": listed}, "Payload": [{"HFData": rows}, event]}
    ).encode()


def _xml() -> list[bytes]:
    """A trace over time, and a measured response, of a SINUMERIK."""
    from sinumerik_xml_helpers import TRACE, measured

    rows = "".join(f'<rec time="{0.002 * k}" f1="{k}" f2="{-k}"/>' for k in range(8))
    return [TRACE.format(rows=rows).encode(), measured()[0].encode()]


def _scopes() -> list[bytes]:
    """Of TwinCAT with tabs and with commas, of halscope, names above units."""
    head = "Name\tP\t\nStarttime of export\t133238090039920000\n\n"
    head += "Name\tA\tName\tB\nSampleTime[ms]\t2\tSampleTime[ms]\t4\n\n"
    pairs = "".join(f"{2 * k}\t{k},5\t{4 * k}\t-{k},25\n" for k in range(6))
    commas = "SymbolName,Name\nName,A,B\nUnit,mm,N\nScaleFactor,1,2\n0,1,2\n1,2,3\n2,3,4\nEOF\n"
    scope = "Sampling period is 1000000 ns \n" + "".join(f"\na.b {k:+.3f} c {-k:+.3f} " for k in range(6))
    return [(head + pairs).encode("cp1252"), commas.encode(), scope.encode(), b"t;pos\ns;mm\n0;1,5\n1;2,5\n"]


def _uff(folder: Path) -> list[bytes]:
    import pyuff

    found = []
    for binary in (0, 1):
        file = folder / f"seed{binary}.uff"
        x = np.arange(1.0, 9.0)
        pyuff.UFF(str(file)).write_sets(
            [{
                "type": 58, "func_type": 4, "rsp_node": 12, "rsp_dir": 3, "ref_node": 7, "ref_dir": -1,
                "data": (1 + 1j) / x, "x": x, "binary": binary, "id1": "NONE",
                "rsp_ent_name": "NONE", "ref_ent_name": "NONE",
                "abscissa_spacing": binary, "abscissa_min": 1.0, "abscissa_inc": 1.0, "abscissa_spec_data_type": 18,
                "ordinate_spec_data_type": 8, "ordinate_axis_units_lab": "m", "orddenom_spec_data_type": 13,
                "orddenom_axis_units_lab": "N",
            }], mode="add",
        )  # fmt: skip
        found.append(file.read_bytes())
    # Units of the file, and an accelerance without labels.
    units = pyuff.prepare_164(
        units_code=5, units_description="mm", temp_mode=1, length=1e3, force=1e3, temp=1.0, temp_offset=0.0
    )
    pyuff.UFF(str(folder / "units.uff")).write_sets([units], mode="add")
    unlabelled = re.sub(rb"(?m)(  )[mN] {18}", rb"\1NONE               ", found[0])
    found.append((folder / "units.uff").read_bytes() + unlabelled.replace(b"\n         8 ", b"\n        12 "))
    return found


def _fmus(fmus: Path) -> list[bytes]:
    """A drive of another maker without a program in it, and shipped archives without theirs."""
    from foreign import acme

    with tempfile.TemporaryDirectory() as folder:
        path = acme.archive(Path(folder) / "acme.fmu", "drive", b"none", acme.DRIVE)
        found = [path.read_bytes()]
    return [*found, *(_without_programs((fmus / f"{name}.fmu").read_bytes()) for name in ("controller", "plant"))]


def _without_programs(content: bytes) -> bytes:
    kept = {
        name: data for name, data in entries(content).items() if name.startswith(("modelDescription", "resources/"))
    }
    return packed({**kept, **{name: b"" for name in entries(content) if name.startswith(f"binaries/{folders()[0]}/")}})


def _ssp(folder: Path, fmus: Path) -> bytes:
    from ssp_helpers import export_short

    (folder / "ssp").mkdir()
    content = entries(export_short(folder / "ssp", fmus).read_bytes())
    return packed({name: _without_programs(data) if name.endswith(".fmu") else data for name, data in content.items()})
