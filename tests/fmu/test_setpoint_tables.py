"""Tables of setpoints: what packager and unit refuse, with file and line; written and read without loss."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave

from feedsim_packager import setpoints
from feedsim_packager.errors import InputError
from feedsim_packager.resources import File
from fmu.setpoint_table import pack, text
from fmu.unpacked import Archive, instantiate


@pytest.fixture(scope="module")
def packed(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return pack(fmus, tmp_path_factory.mktemp("packed"), text())


def _instantiate(packed: Archive, folder: Path, content: bytes) -> FMU2Slave:
    """With this table, as if it had been packed."""
    shutil.copytree(packed.folder, folder)
    (folder / "resources/setpoints.csv").write_bytes(content)
    digest = 0xCBF29CE484222325
    for byte in content:
        digest = (digest ^ byte) * 0x100000001B3 % 2**64
    return instantiate(packed, folder, f"{packed.guid[:17]}{digest:016x}")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("time [s]", "t", ["line 1: the header must read time [s],X.x_s [m]", "but reads t,Z.x_s [m]"]),
        ("Z.x_s [m]", "Z.x_s [mm]", ["line 1: column 2 is 'Z.x_s [mm]', expected is the position setpoint"]),
        ("Z.n_ffw [rad/s]", "Y.n_ffw [rad/s]", ["column 3 is 'Y.n_ffw [rad/s]', expected is Z.n_ffw [rad/s]"]),
        (",X_1.n_ffw [rad/s]", "", ["line 1: column X_1.n_ffw [rad/s] is missing"]),
        ("X_1", "Z", ["line 1: axis Z appears twice"]),
        ("Z", "1Z", ["line 1: axis name '1Z' is not a letter followed by"]),
        ("\n0.003,", "\n0.0031,", ["line 5: time [s] is 0.0031, the row before has 0.002; rows must be even"]),
        ("\n0.003,", "\n0.0030001,", ["line 5", "line 6", "and the first two are 0.001 s apart"]),
        ("\n0.003,", "\n0.002,", ["line 5: time [s] is 0.002, the row before has 0.002; times must rise"]),
        ("\n0.003,", "\nnan,", ["line 5: time [s] is 'nan', not a finite number"]),
        ("\n0.003,", "\n0.003,1,", ["line 5: 6 fields, expected 5"]),
        ("\n0.003,", "\n0.003;", ["line 5: 4 fields, expected 5"]),
        ("\n0.003,", "\n0_0.003,", ["line 5: time [s] is '0_0.003', not a finite number"]),
        ("\n0.003,", "\n0.003\x0c,", ["line 5: time [s] is '0.003\x0c', not a finite number"]),
        ("\n0.003,", f"\n0.003{'0' * 507},", ["line 5: time [s] is '0.003000000", "of 512 characters; at most 510"]),
        ("\n0.003,", f"\n0.003{'0' * 506},", []),  # the longest number
        ("\n", "\n\n", []),  # blank lines do not count
    ],
)
def test_faulty_tables_are_refused_by_packager_and_unit(
    packed: Archive, tmp_path: Path, old: str, new: str, said: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    """The unit must refuse whatever the packager refuses: a tool of somebody else's may have written the table."""
    content = text().replace(old, new).encode()
    if not said:
        setpoints.check(File("t.csv", content))
    else:
        with pytest.raises(InputError) as caught:
            setpoints.check(File("t.csv", content))
        assert str(caught.value).startswith("t.csv: ")
        assert all(part in str(caught.value) for part in said), str(caught.value)
    if not said:
        _instantiate(packed, tmp_path / "unpacked", content).freeInstance()
    else:
        with pytest.raises(Exception, match="instantiate"):
            _instantiate(packed, tmp_path / "unpacked", content)
        assert "resources/setpoints.csv" in capfd.readouterr().out


def test_tables_of_too_few_rows_are_refused() -> None:
    for rows in (0, 1):
        with pytest.raises(InputError, match=f"t.csv.*\n.*the table has {rows} rows; at least two"):
            setpoints.check(File("t.csv", text(rows=rows).encode()))
    with pytest.raises(InputError, match=r"but reads \(empty\)"):
        setpoints.check(File("t.csv", b""))


def _refused_by_both(packed: Archive, folder: Path, content: bytes, packager: str) -> None:
    with pytest.raises(InputError, match=packager):
        setpoints.check(File("t.csv", content))
    with pytest.raises(Exception, match="instantiate"):
        _instantiate(packed, folder, content)


def test_a_span_of_time_beyond_all_numbers_is_refused(packed: Archive, tmp_path: Path) -> None:
    for times in ((-1e308, 1e308), (-1e308, 0.0, 1e308)):
        rows = "".join(f"{time!r},1,2\n" for time in times)
        content = f"time [s],X.x_s [m],X.n_ffw [rad/s]\n{rows}".encode()
        _refused_by_both(packed, tmp_path / str(len(times)), content, "span that is no finite number")


def test_the_number_of_axes_is_limited(packed: Archive, tmp_path: Path) -> None:
    def table(axes: int) -> bytes:
        header = ",".join(f"A{i}.x_s [m],A{i}.n_ffw [rad/s]" for i in range(axes))
        return f"time [s],{header}\n".encode() + b"".join(b"%d" % row + b",1" * 2 * axes + b"\n" for row in (0, 1))

    assert len(setpoints.check(File("t.csv", table(256))).axes) == 256
    _instantiate(packed, tmp_path / "256", table(256)).freeInstance()
    _refused_by_both(packed, tmp_path / "257", table(257), "515 columns; at most 513, those of 256 axes")


def test_small_differences_that_add_up_are_refused() -> None:
    times = np.cumsum(1e-3 * (1 + 1e-8) ** np.arange(60))
    content = setpoints.write(times.tolist(), {"X": ([0.0] * 60, [0.0] * 60)})
    with pytest.raises(InputError, match="the time of row"):
        setpoints.check(File("t.csv", content))


def test_many_faults_are_not_all_told() -> None:
    lines = text().splitlines()
    content = "\n".join([lines[0], *("x" for _ in range(10_000))]).encode()
    with pytest.raises(InputError) as caught:
        setpoints.check(File("t.csv", content))
    assert len(caught.value.problems) == 21
    assert caught.value.problems[-1] == "the rest of the table was not read"


def test_written_and_read_no_bit_is_lost() -> None:
    rng = np.random.default_rng(3)
    columns = rng.standard_normal((4, 50)) * 10.0 ** rng.integers(-300, 300, (4, 50))
    time = np.arange(50) / 3000
    content = setpoints.write(time, {"X": (columns[0], columns[1]), "Q": (columns[2], columns[3])})
    found = setpoints.read_columns(File("t.csv", content))
    assert list(found.axes) == ["X", "Q"]
    assert np.array_equal(np.frombuffer(found.time), time)
    assert np.array_equal([np.frombuffer(column) for pair in found.axes.values() for column in pair], columns)
    assert found.cycle == pytest.approx(1 / 3000, rel=1e-15)
