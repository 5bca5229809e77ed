"""The unit that plays setpoints: each value at each communication point, against rows counted in whole nanoseconds."""

import ctypes
import shutil
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from functools import cache
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave

from feedsim_packager import cli, setpoints, toolchain
from fmu.setpoint_table import AXES, CYCLE, NS, ROWS, numbers, pack, text
from fmu.unpacked import PLATFORM, ROOT, Archive, instantiate, unpack

DEFAULT = ROOT / "src/setpoint_fmu/resources/setpoints.csv"


@pytest.fixture(scope="module")
def packed(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return pack(fmus, tmp_path_factory.mktemp("packed") / "with späces & ümlauts", text())


@pytest.fixture
def default(fmus: Path, tmp_path: Path) -> Archive:
    return unpack("setpoint", fmus, tmp_path / "default")


@contextmanager
def started(archive: Archive, start: float = 0.0) -> Iterator[FMU2Slave]:
    slave = instantiate(archive)
    try:
        begin(slave, start)
        yield slave
    finally:
        slave.freeInstance()


def begin(slave: FMU2Slave, start: float = 0.0) -> None:
    slave.setupExperiment(startTime=start)
    slave.enterInitializationMode()
    slave.exitInitializationMode()


@cache
def references(archive: Archive) -> dict[str, int]:
    return {name: int(each.attrib["valueReference"]) for name, each in archive.variables().items()}


def shown(slave: FMU2Slave, archive: Archive) -> tuple[int, bool, list[float]]:
    """Row, finished, and the values of all axes."""
    known = references(archive)
    outputs = [known[f"{axis}.{name}"] for axis in AXES for name in ("x_s", "n_ffw")]
    return (slave.getInteger([known["row"]])[0], bool(slave.getBoolean([known["finished"]])[0]), slave.getReal(outputs))


def expect(slave: FMU2Slave, archive: Archive, row: int) -> None:
    assert shown(slave, archive) == (row, row == ROWS - 1, numbers()[row].tolist())


def exact(ns: int) -> float:
    """The double nearest to so many nanoseconds."""
    return float(Fraction(ns, NS))


def as_product(k: int, h: int, start: float) -> float:
    return start + k * exact(h)


def as_quotient(k: int, h: int, start: float) -> float:
    return start + k / (NS / h)


def rounded_up(k: int, h: int, start: float) -> float:
    return float(np.nextafter(np.nextafter(as_product(k, h, start), np.inf), np.inf))


def rounded_down(k: int, h: int, start: float) -> float:
    return float(np.nextafter(np.nextafter(as_product(k, h, start), -np.inf), -np.inf)) if k else start


# Steps in ns: the drives' cycle, whole fractions and multiples of the position cycle, none of both, as short and as
# long as anybody takes. None ends a step just ahead of a row, but for rounding.
@pytest.mark.parametrize("h", [125_000, 1_000_000, 300_000, 400_000, 2_500_000, 7_777_777, 10_000_000, 100_000, 1_000])
@pytest.mark.parametrize("start", [0.0, 1000.0, -3.5, 86400.0])
@pytest.mark.parametrize("clock", [as_product, as_quotient, rounded_up, rounded_down])
def test_every_communication_point_has_its_row(
    packed: Archive, h: int, start: float, clock: Callable[[int, int, float], float]
) -> None:
    """To 5 ms after the end of the table; of steps of 1 us the first 5 ms."""
    steps = ((ROWS + 5) * CYCLE if h > 1_000 else 5 * CYCLE) // h
    with started(packed, start) as slave:
        expect(slave, packed, 0)
        for k in range(steps):
            slave.doStep(clock(k, h, start), exact(h))
            expect(slave, packed, min((k + 1) * h // CYCLE, ROWS - 1))


def test_release_is_true_from_the_initialisation_on(packed: Archive) -> None:
    """Also where it is asked for in initialization mode, and beyond the end of the table."""
    release = [references(packed)[f"{axis}.release"] for axis in AXES]
    slave = instantiate(packed)
    try:
        slave.setupExperiment(startTime=5.0)
        slave.enterInitializationMode()
        assert slave.getBoolean(release) == [1, 1]
        slave.exitInitializationMode()
        for k in range(ROWS + 3):
            assert slave.getBoolean(release) == [1, 1]
            slave.doStep(5.0 + k * exact(CYCLE), exact(CYCLE))
    finally:
        slave.freeInstance()


def test_rounded_time_is_the_row_and_a_time_before_it_is_not(packed: Archive) -> None:
    # Within two millionths of the cycle, which three steps of 333333 ns keep: the row has come.
    for end, row in ((0.0009999999999, 1), (0.000999999, 1), (0.00099999, 0), (0.00099, 0), (0.0010000001, 1)):
        with started(packed) as slave:
            slave.doStep(0.0, end)
            expect(slave, packed, row)


def test_a_clock_that_adds_up_its_rounding_keeps_the_row(packed: Archive) -> None:
    """At 10^5 s each addition of 0.1 ms is rounded by a third of the last place, always to the same side."""
    h, start = 100_000, 1e5
    with started(packed, start) as slave:
        time = start
        for k in range((ROWS + 2) * 10):
            slave.doStep(time, exact(h))
            time += exact(h)
            expect(slave, packed, min((k + 1) * h // CYCLE, ROWS - 1))
    assert abs(time - start - (ROWS + 2) * 1e-3) > 1e-9  # rounding that has added up


@pytest.mark.parametrize("cycle", [250_000, 333_333, 2_000_000, 100_000_000])
@pytest.mark.parametrize("first", [0, 5_000_000, -5_000_000])
def test_other_cycles_and_first_times(fmus: Path, tmp_path: Path, cycle: int, first: int) -> None:
    archive = pack(fmus, tmp_path, text(cycle, first))
    known, h = references(archive), max(125_000, cycle * 3 // 10)
    with started(archive, 10.0) as slave:
        found = slave.getReal([known["T_pos"], known["duration"]])
        assert found == [pytest.approx(exact(cycle), rel=1e-13), exact(first + (ROWS - 1) * cycle)]
        for k in range(((ROWS + 3) * cycle + abs(first)) // h):
            slave.doStep(as_product(k, h, 10.0), exact(h))
            expect(slave, archive, min(max((((k + 1) * h) - first) // cycle, 0), ROWS - 1))


def test_steps_that_change(packed: Archive) -> None:
    rng = np.random.default_rng(11)
    now = 0
    with started(packed, 2.0) as slave:
        while now < (ROWS + 1) * CYCLE:
            h = int(rng.choice([1_000, 17_000, 125_000, 999_000, 1_000_000, 3_100_000]))
            slave.doStep(float(2 + Fraction(now, NS)), exact(h))
            now += h
            expect(slave, packed, min(now // CYCLE, ROWS - 1))


def test_fmpy_simulates_it(packed: Archive) -> None:
    """As everybody calls it, from 1000 s on."""
    names = [f"{axis}.{name}" for axis in AXES for name in ("x_s", "n_ffw")]
    result = fmpy.simulate_fmu(
        str(packed.path), start_time=1000.0, stop_time=1000.07, step_size=1e-3, output_interval=1e-3, output=names
    )
    rows = np.minimum(np.arange(71), ROWS - 1)
    assert np.array_equal(np.column_stack([result[name] for name in names]), numbers()[rows])


def test_reset_begins_anew(packed: Archive) -> None:
    with started(packed) as slave:
        slave.doStep(0.0, 0.0205)
        expect(slave, packed, 20)
        slave.reset()
        begin(slave, 4.0)
        expect(slave, packed, 0)
        slave.doStep(4.0, 0.003)
        expect(slave, packed, 3)


def test_states_bring_the_row_back(packed: Archive) -> None:
    """In another instance, too; the table goes along by its hash alone."""
    with started(packed, 1.0) as slave, started(packed) as other:
        slave.doStep(1.0, 0.0105)
        state = slave.getFMUState()
        content = slave.serializeFMUstate(state)
        assert len(content) < 2000  # no table in it
        slave.doStep(1.0105, 0.02)
        expect(slave, packed, 30)
        slave.setFMUState(state)
        expect(slave, packed, 10)
        slave.doStep(1.0105, 0.0005)
        expect(slave, packed, 11)
        restored = other.deSerializeFMUstate(content)
        other.setFMUState(restored)
        expect(other, packed, 10)
        other.doStep(1.0105, 0.0005)
        expect(other, packed, 11)
        slave.freeFMUState(state)
        other.freeFMUState(restored)


def test_state_of_another_table_is_refused(packed: Archive, default: Archive) -> None:
    with started(packed) as slave, started(default) as other:
        content = slave.serializeFMUstate(slave.getFMUState())
        with pytest.raises(Exception, match="DeSerialize"):
            other.deSerializeFMUstate(content)


def test_derivatives_of_held_values_are_zero(packed: Archive) -> None:
    with started(packed) as slave:
        slave.doStep(0.0, 0.0105)
        outputs = [references(packed)[f"{axis}.x_s"] for axis in AXES]
        assert list(slave.getRealOutputDerivatives(outputs, [1, 1])) == [0.0, 0.0]


# --- the archive


def test_default_table_is_the_move_that_the_readme_tells() -> None:
    table = np.genfromtxt(DEFAULT, delimiter=",", skip_header=1)
    k = np.arange(251)
    progress = np.clip((k - 20) / 200, 0.0, 1.0)
    way = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    assert np.array_equal(table[:, 0], k / 1000)
    for column, at, by in ((1, 0.8, 0.02), (3, 0.327, -0.01), (5, 0.1, 0.01)):
        # Rounded to nm and urad/s.
        np.testing.assert_allclose(table[:, column], at + by * way(progress), rtol=0, atol=0.51e-9)
        turns = by * way.deriv()(progress) / 0.2 * 2 * np.pi / 0.02
        np.testing.assert_allclose(table[:, column + 1], turns, rtol=0, atol=0.51e-6)


def test_packed_archive_says_what_it_plays(packed: Archive) -> None:
    assert packed.description.attrib["description"].endswith(". Motion: Moves <1>. Note")
    page = (packed.folder / "documentation/index.html").read_text(encoding="utf-8")
    assert "<strong>Moves &lt;1&gt;</strong>" in page
    assert "57 rows, one every 0.001 s until 0.056 s, of the axes Z, X_1" in page
    assert "<code>X_1.n_ffw</code>" in page
    assert "<code>Y.n_ffw</code>" not in page
    wanted = [f"{axis}.{name}" for axis in ("Z", "X_1") for name in ("x_s", "n_ffw", "release")]
    assert [name for name in references(packed) if "." in name] == wanted
    assert (packed.folder / "resources/setpoints.csv").read_text(encoding="utf-8") == text()


def _experiment(archive: Archive) -> dict[str, float]:
    return {name: float(text) for name, text in archive.description.find("DefaultExperiment").attrib.items()}


def test_default_experiment_is_that_of_the_table(default: Archive, packed: Archive) -> None:
    assert _experiment(default) == {"startTime": 0.0, "stopTime": 0.25, "stepSize": 125e-6}
    assert _experiment(packed) == {"startTime": 0.0, "stopTime": 0.056, "stepSize": 125e-6}


@pytest.mark.parametrize(
    ("cycle", "first", "stop", "step"),
    [
        (250_000, 0, 0.014, 125e-6),
        (100_000, 0, 0.0056, 100e-6),  # shorter than a usual step
        (400_000, 0, 0.0224, 100e-6),  # no multiple of it
        (2_000_000, 5_000_000, 0.117, 125e-6),
        (333_333, 0, 0.018666648, 111.111e-6),
        (1_000_000, -100_000_000, 1.0, 125e-6),  # over before the start
    ],
)
def test_default_steps_meet_every_row(
    fmus: Path, tmp_path: Path, cycle: int, first: int, stop: float, step: float
) -> None:
    assert _experiment(pack(fmus, tmp_path, text(cycle, first))) == {
        "startTime": 0.0,
        "stopTime": stop,
        "stepSize": step,
    }


@pytest.mark.parametrize("start", [0.0, 1000.0, 86400.0, 31557600.0])
def test_a_step_that_ends_between_rows_stays_on_its_row(packed: Archive, start: float) -> None:
    """After a late start, too: how far times are rounded there is no reason to be a row ahead."""
    for k, row in ((0.95, 0), (0.98, 0), (1.0, 1), (1.95, 1)):
        with started(packed, start) as slave:
            slave.doStep(start, k * 1e-3)
            expect(slave, packed, row)


def test_command_line_packs_the_same(packed: Archive, fmus: Path, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(text(), encoding="utf-8")
    words = ["--setpoints", str(tmp_path / "t.csv"), "--name", "Moves <1>", "--note", "Note"]
    assert cli.main(["repack", str(fmus / "setpoint.fmu"), *words, "--out", str(tmp_path / "x.fmu")]) == 0
    assert (tmp_path / "x.fmu").read_bytes() == packed.path.read_bytes()


@pytest.mark.parametrize(
    ("base", "words", "said"),
    [
        ("setpoint", ["--axes", "a.csv", "--setpoints", "t.csv"], "goes modes, settings, which is not given"),
        (
            "setpoint",
            [],
            "files of one kind are needed (axes, modes, poses, mounts; or setpoints; or axes, modes, poses, mounts, "
            "settings, setpoints), given are none",
        ),
        ("plant", ["--setpoints", "t.csv"], "plant: has resources of the kind 'machine', those given are of the kind"),
        ("plant", ["--axes", "a.csv"], "with axes goes modes, which is not given"),
        ("friction", ["--setpoints", "t.csv"], "friction: takes no resources (given are those of the kind 'setpoints'"),
    ],
)
def test_files_of_another_kind_are_refused(
    fmus: Path, tmp_path: Path, base: str, words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "t.csv").write_text(text(), encoding="utf-8")
    given = [str(tmp_path / word) if word.endswith(".csv") else word for word in words]
    assert cli.main(["repack", str(fmus / f"{base}.fmu"), *given, "--out", str(tmp_path / "x.fmu")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "x.fmu").exists()


def _instance(archive: Archive, location: str | None) -> int | None:
    """fmi2Instantiate with a resource location that fmpy would not give."""
    library = ctypes.CDLL(str(archive.library))
    library.fmi2Instantiate.restype = ctypes.c_void_p
    library.fmi2Instantiate.argtypes = [ctypes.c_char_p, ctypes.c_int, *[ctypes.c_char_p] * 2, ctypes.c_void_p] + [
        ctypes.c_int
    ] * 2
    where = location.encode() if location is not None else None
    made: int | None = library.fmi2Instantiate(b"alone", 1, archive.guid.encode(), where, None, 0, 0)
    if made is not None:
        library.fmi2FreeInstance.argtypes = [ctypes.c_void_p]
        library.fmi2FreeInstance(made)
    return made


def test_without_a_location_the_embedded_table_is_played(default: Archive, packed: Archive) -> None:
    """Where it is that of the archive: a repacked one has the binary of another table."""
    shutil.rmtree(default.folder / "resources")
    assert _instance(default, None) is not None
    assert _instance(packed, None) is None
    assert _instance(packed, (packed.folder / "resources").as_uri()) is not None  # percent-encoded
    assert _instance(packed, str(packed.folder / "resources")) is not None


def test_changed_and_missing_tables_are_refused(packed: Archive, tmp_path: Path) -> None:
    for name, change in (
        ("longer", lambda path: path.write_bytes(path.read_bytes() + b"\n")),
        ("missing", lambda path: path.unlink()),
    ):
        shutil.copytree(packed.folder, tmp_path / name)
        change(tmp_path / name / "resources" / "setpoints.csv")
        with pytest.raises(Exception, match="instantiate"):
            instantiate(packed, tmp_path / name)


def test_large_tables_are_not_embedded(fmus: Path, tmp_path: Path) -> None:
    rows = setpoints.LARGEST_EMBEDDED // 40
    archive = pack(fmus, tmp_path, text(rows=rows))
    source = (archive.folder / "sources/embedded_resources.c").read_text(encoding="utf-8")
    assert "is not embedded (up to 1048576 are)" in source
    assert "embedded_setpoints_size = 0;" in source
    compiled = tmp_path / "embedded.o"
    toolchain.run(
        [
            *toolchain.find_compiler(),
            "-std=c99",
            "-pedantic",
            "-Werror",
            "-c",
            "embedded_resources.c",
            "-o",
            str(compiled),
        ],
        archive.folder / "sources",
    )
    with started(archive) as slave:
        slave.doStep(0.0, 25.0005)
        assert shown(slave, archive) == (25000, False, numbers(rows)[25000].tolist())
    with zipfile.ZipFile(archive.path) as opened:
        assert f"binaries/{PLATFORM.folder}/setpoint{PLATFORM.suffix}" in opened.namelist()


# --- with a controller


def _followed(setpoint: Archive, controller: Archive, h: int, first: bool) -> np.ndarray:
    """Controller outputs at each of 40 ms / h steps, the table's unit stepped before (`first`) or after it."""
    known = {name: int(each.attrib["valueReference"]) for name, each in controller.variables().items()}
    outputs = [references(setpoint)["Z.x_s"], references(setpoint)["Z.n_ffw"]]
    found = []
    with started(setpoint) as table, started(controller) as drive:
        for k in range(40 * CYCLE // h):
            if first:
                table.doStep(as_product(k, h, 0.0), exact(h))
            drive.setReal([known["x_s"], known["n_ffw"]], table.getReal(outputs))
            drive.doStep(as_product(k, h, 0.0), exact(h))
            if not first:
                table.doStep(as_product(k, h, 0.0), exact(h))
            found.append(drive.getReal([known[name] for name in ("x_e", "n_s", "M_a")]))
    return np.array(found)


def test_order_of_execution_is_what_the_readme_tells(fmus: Path, tmp_path: Path) -> None:
    """No difference at the control cycle; at the position cycle, the unit stepped first is a row ahead."""
    controller = unpack("controller", fmus, tmp_path / "controller")
    columns = 1e-5 * numbers()  # gentle: no limit is met
    lines = [f"{k / 1000!r},{','.join(map(repr, row))}" for k, row in enumerate(columns.tolist())]
    setpoint = pack(fmus, tmp_path, "\n".join([text().splitlines()[0], *lines, ""]))
    before, after = (_followed(setpoint, controller, 125_000, first) for first in (True, False))
    assert np.ptp(after, axis=0).min() > 0
    assert np.array_equal(before, after)
    before, after = (_followed(setpoint, controller, CYCLE, first) for first in (True, False))
    assert not np.array_equal(before, after)
