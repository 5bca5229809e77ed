"""The packager's further parts: resources, documentation, archives, command line. No unit is compiled here."""

import io
import re
import shlex
import subprocess
import sys
import warnings
import zipfile
from pathlib import Path

import pytest

from feedsim_packager import archive, build, cli, compile, documentation, machine, machine_tables, toolchain, variables
from feedsim_packager.errors import CompilerError, InputError, OutputError
from fmu.toy_table import GOOD, HEAD, read, toy

ROOT = Path(__file__).resolve().parents[2]

# --- resources and axes

AXES = "axis,x_0 [m]\nX,0.5\nZ,-0.25\n"
MODES = "mode,frequency [Hz],damping ratio [1],n_X,n_Z,x_X,x_Z,tcp_X,tcp_Y,tcp_Z\n0,0.0,0.0,1,2,3,4,5,6,7\n"
AXIS_ROWS = HEAD + (
    'REAL(u, input, continuous, 0, "m", "mm", NO_MIN, NO_MAX, "", "In")\n'
    'AXIS_REAL(M_a, input, continuous, 0, "N.m", "N.m", NO_MIN, NO_MAX, "", "Torque")\n'
    'AXIS_REAL(n_a, output, continuous, 0, "rad/s", "rpm", NO_MIN, NO_MAX, "M_a u", "Speed")\n'
    'AXIS_REAL(x_0, parameter, fixed, 0, "m", "mm", NO_MIN, NO_MAX, "", "Position at the start")\n'
)


def read_resources(folder: Path, axes: str = AXES, modes: str = MODES) -> machine_tables.MachineTables:
    (folder / "axes.csv").write_text(axes, encoding="utf-8", newline="")
    (folder / "modes.csv").write_text(modes, encoding="utf-8", newline="")
    return machine_tables.read(folder / "axes.csv", folder / "modes.csv")


def test_the_number_of_axes_is_limited(tmp_path: Path) -> None:
    listed = "".join(f"A{i},0\n" for i in range(257))
    with pytest.raises(InputError, match=r"axes\.csv: 257 axes are listed, at most 256 are allowed"):
        read_resources(tmp_path, f"axis,x_0 [m]\n{listed}")


@pytest.mark.parametrize(
    ("number", "good"),
    [
        ("0." + "1" * 509, True),
        ("0." + "1" * 510, False),  # numbers.c: at most 510 characters besides the point
        ("1" + "0" * 300 + "." + "0" * 209, True),
        ("0" * 510, True),
        ("0" * 511, False),
        ("\u0661", False),  # a digit to Python alone
        ("1_0", False),
        ("1e", False),
        (".", False),
        (".5E-3", True),
        ("1e999", False),
    ],
)
def test_numbers_are_those_that_the_units_read(tmp_path: Path, number: str, good: bool) -> None:
    """Of axes.csv; tests/unit_c/test_numbers.c has the other side."""
    if good:
        assert read_resources(tmp_path, f"axis,x_0 [m]\nX,{number}\nZ,0\n").axes[0].x_0 == float(number)
        return
    with pytest.raises(InputError, match="not a finite number"):
        read_resources(tmp_path, f"axis,x_0 [m]\nX,{number}\nZ,0\n")


def test_axis_block_is_repeated_for_every_axis(tmp_path: Path, compiler: tuple[str, ...]) -> None:
    found = variables.expand(read(tmp_path / "toy", AXIS_ROWS, compiler), read_resources(tmp_path))
    assert [(v.name, v.reference) for v in found] == [
        *(("u", 0), ("X.M_a", 1), ("X.n_a", 2), ("X.x_0", 3)),
        *(("Z.M_a", 4), ("Z.n_a", 5), ("Z.x_0", 6)),
    ]
    assert [v.start for v in found] == ["0", "0", None, "0.5", "0", None, "-0.25"]
    assert found[2].depends == (0, 1)
    assert found[5].depends == (0, 4)


def test_guid_covers_table_axes_and_modes(tmp_path: Path, compiler: tuple[str, ...]) -> None:
    rows = read(tmp_path / "toy", AXIS_ROWS, compiler)
    base = variables.guid(rows, read_resources(tmp_path))
    assert re.fullmatch(r"[0-9a-f]{16}-[0-9a-f]{16}", base)
    assert base.endswith(f"-{variables.fnv1a_64((AXES + MODES).encode())}")
    changed = [
        variables.guid(
            read(tmp_path / "toy", AXIS_ROWS.replace('"rad/s"', '"Hz"'), compiler), read_resources(tmp_path)
        ),
        variables.guid(rows, read_resources(tmp_path, axes=AXES.replace("0.5", "0.6"))),
        variables.guid(rows, read_resources(tmp_path, modes=MODES.replace("5,6,7", "5,6,8"))),
    ]
    assert len({base, *changed}) == 4


def test_resources_must_go_with_the_table(tmp_path: Path, compiler: tuple[str, ...]) -> None:
    given = read_resources(tmp_path)
    with pytest.raises(InputError, match="needs resources of the kind 'machine'"):
        variables.expand(read(tmp_path / "a", AXIS_ROWS, compiler), None)
    with pytest.raises(InputError, match="takes no resources"):
        variables.expand(read(tmp_path / "b", GOOD, compiler), given)
    with pytest.raises(InputError, match="no such row"):
        variables.expand(read(tmp_path / "c", AXIS_ROWS.replace("x_0", "x_1"), compiler), given)
    grouped = AXIS_ROWS.replace("REAL(u,", "REAL_OF(X, u,").replace('"M_a u"', '"M_a"')
    with pytest.raises(InputError, match="cannot be named X"):
        variables.expand(read(tmp_path / "d", grouped, compiler), given)


@pytest.mark.parametrize(
    ("axes", "texts"),
    [
        ("", ["header must read axis,x_0 [m]"]),
        ("axis,x_0\nX,1\n", ["header must read axis,x_0 [m]", "reads axis,x_0"]),
        ("axis,x_0 [m]\n", ["no axis"]),
        (
            "axis,x_0 [m]\nX,1\nX,2\n3Z,nan\nY\n",
            ["line 3: axis X is already", "line 4: axis name '3Z'", "line 5: 1 fields"],
        ),
        ("axis,x_0 [m]\nX,inf\nY,1e\nZ,1_0\n", ["line 2: x_0", "line 3: x_0 of axis Y is '1e'", "line 4: x_0"]),
    ],
)
def test_bad_axes_are_refused(tmp_path: Path, axes: str, texts: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        read_resources(tmp_path, axes=axes)
    assert "axes.csv" in str(caught.value)
    assert all(text in str(caught.value) for text in texts), str(caught.value)


@pytest.mark.parametrize(
    ("modes", "texts"),
    [
        ("", ["empty"]),
        (MODES.replace(",x_Z", ",x_Y"), ["missing columns x_Z", "unknown columns x_Y"]),
        (MODES.replace(",x_X", ",x_Z"), ["missing columns x_X", "appear twice: x_Z"]),
        (MODES.splitlines()[0] + "\n", ["no mode"]),
        (MODES + "1,-5,0,1,2,3,4,5,6,7\n", ["line 3: frequency [Hz] is -5, allowed is 0 or more"]),
        (MODES.replace("0.0,0.0", "0.0,0.02"), ["line 2: damping ratio [1] is 0.02 at frequency 0 Hz; a rigid mode"]),
        (MODES.replace("1,2,3,4", "1,0,3,0"), ["n_Z is 0 in every mode", "x_Z is 0 in every mode"]),
        (MODES + "1,5,-0.1,1,nan,3,4,5,6,7\n2,5\n", ["damping ratio [1] is -0.1", "n_Z is 'nan'", "line 4: 2 fields"]),
    ],
)
def test_bad_modes_are_refused(tmp_path: Path, modes: str, texts: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        read_resources(tmp_path, modes=modes)
    assert "modes.csv" in str(caught.value)
    assert all(text in str(caught.value) for text in texts), str(caught.value)


def test_modes_may_have_their_columns_in_any_order(tmp_path: Path) -> None:
    turned = "\r\n".join(",".join(reversed(line.split(","))) for line in MODES.splitlines()) + "\r\n"
    assert read_resources(tmp_path, modes=turned).modes_csv == turned.encode()


def test_unknown_kind_of_resources_is_named(tmp_path: Path, compiler: tuple[str, ...]) -> None:
    unit = toy(tmp_path / "toy", AXIS_ROWS)
    identity = unit / "identity.h"
    identity.write_text(identity.read_text(encoding="utf-8").replace("machine", "maps"), encoding="utf-8")
    with pytest.raises(InputError, match="toy: UNIT_RESOURCES is maps, known are machine, setpoints"):
        build.load(unit, compiler)


def test_missing_resource_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.csv: cannot be read"):
        machine_tables.read(tmp_path / "nowhere.csv", tmp_path / "modes.csv")


def test_embedded_source_holds_the_files_to_the_byte(tmp_path: Path) -> None:
    given = read_resources(tmp_path)
    text = given.embedded_source().decode()
    arrays = re.findall(r"const unsigned char (\w+)\[\] = \{([^}]*)\}", text)
    assert {name: bytes(int(number) for number in body.split(",")) for name, body in arrays} == {
        "embedded_axes": AXES.encode(),
        "embedded_modes": MODES.encode(),
    }


# --- documentation


def test_links_into_the_repository_become_text(tmp_path: Path, compiler: tuple[str, ...]) -> None:
    found = read(tmp_path, GOOD, compiler)
    pages = documentation.pages(
        found,
        variables.expand(found, None),
        None,
        readme="See [theory](../../docs/theory.md), [FMI](https://fmi-standard.org/) & <b>.\n\n|a|b|\n|-|-|\n|1|2|\n",
        licence="Free.\n",
        standard_header="/* text\n   Copyright (C) somebody\n\n     Conditions\n*/",
        version="1.2",
        machine=machine.Machine(),
    )
    text = pages["documentation/index.html"].decode()
    assert 'See theory, <a href="https://fmi-standard.org/">FMI</a> &amp; &lt;b&gt;.' in text
    assert "<td>1</td>" in text
    assert "synthetic" not in text
    assert "Out &quot;quoted&quot;, with comma" in text
    assert pages["documentation/licenses/license.txt"].startswith(b"Free.\n")
    assert pages["documentation/licenses/fmi-headers.txt"] == b"Copyright (C) somebody\n\n  Conditions\n"


# --- archives


def test_archive_depends_on_names_and_contents_alone() -> None:
    files = {"b.txt": b"b" * 1000, "binaries/x.so": b"x", "a/c.txt": b"c"}
    packed = archive.pack(files)
    assert packed == archive.pack(dict(reversed(files.items())))
    with zipfile.ZipFile(io.BytesIO(packed)) as opened:
        assert opened.testzip() is None
        assert {name: opened.read(name) for name in opened.namelist()} == files
        assert opened.namelist() == sorted(files)
        assert all(entry.date_time == (1980, 1, 1, 0, 0, 0) for entry in opened.infolist())
        assert all(entry.compress_type == zipfile.ZIP_DEFLATED for entry in opened.infolist())
        assert all(entry.extract_version <= 20 for entry in opened.infolist())  # the standard allows no newer zip


def _zip(path: Path, *names: str) -> Path:
    with zipfile.ZipFile(path, "w") as opened, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of names that are there already
        for name in names:
            opened.writestr(name, b"12345678")
    return path


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("a", "../b"), "'../b' is no path within an archive"),
        (("resources/../../b",), "'resources/../../b' is no path"),
        (("/etc/x",), "'/etc/x' is no path"),
        (("C:/x",), "'C:/x' is no path"),
        (("a\\..\\b",), "is no path"),
        (("a//b",), "'a//b' is no path"),
        (("a", "b", "a"), "'a' is in it 2 times"),
        (("a", "b", "c", "d"), "its files have 32 bytes; at most 31 are read"),
    ],
)
def test_archives_that_no_packager_made_are_refused(
    tmp_path: Path, names: tuple[str, ...], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(archive, "LARGEST", 31)
    with pytest.raises(InputError) as caught:
        archive.read(_zip(tmp_path / "x.fmu", *names))
    assert f"{tmp_path / 'x.fmu'}: not the archive of a unit" in str(caught.value)
    assert said in str(caught.value)
    assert archive.read(_zip(tmp_path / "good.fmu", "a", "b/..c", "d.e")).keys() == {"a", "b/..c", "d.e"}


def test_archive_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    archive.write(tmp_path / "new" / "x.fmu", b"first")
    archive.write(tmp_path / "new" / "x.fmu", b"second")
    assert [(path.name, path.read_bytes()) for path in (tmp_path / "new").iterdir()] == [("x.fmu", b"second")]
    (tmp_path / "taken").mkdir()
    with pytest.raises(OutputError, match=r"cannot write .*taken"):
        archive.write(tmp_path / "taken", b"x")  # a folder is in the way
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new", "taken"]


def test_newest_glibc_is_found() -> None:
    assert compile.newest_glibc(b"\0GLIBC_2.2.5\0GLIBC_2.29\0GLIBC_2.4\0GLIBC_PRIVATE\0") == "2.29"
    assert compile.newest_glibc(b"\0nothing\0") is None


# --- toolchain and command line


def test_compiler_may_be_several_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", f"{shlex.quote(sys.executable)} -m ziglang cc")
    assert toolchain.find_compiler() == (sys.executable, "-m", "ziglang", "cc")
    assert toolchain.is_zig(toolchain.find_compiler())
    assert not toolchain.is_zig(("gcc", "-O2"))
    monkeypatch.setenv("CC", "no-such-compiler -x")
    with pytest.raises(CompilerError, match="no-such-compiler"):
        toolchain.find_compiler()


def test_no_compiler_at_all_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(CompilerError, match="no C compiler found"):
        toolchain.find_compiler()


@pytest.mark.skipif(sys.platform != "linux", reason="a compiler that is a script")
def test_files_are_compiled_as_one_program_only_where_that_works(tmp_path: Path) -> None:
    def compiler(name: str, script: str) -> tuple[str]:
        path = tmp_path / name
        path.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
        path.chmod(0o755)
        return (str(path),)

    gnu = 'echo "gcc, Copyright Free Software Foundation, Inc."'
    leave = '[ $# = 1 ] || { while [ "$1" != -o ]; do shift; done; echo "%s" > "$2"; }'
    able = compiler("able", f"{gnu}; {leave % 'reached_across_files'}")
    lossy = compiler("lossy", f"{gnu}; {leave % 'nothing'}")
    without = compiler("without", f'{gnu}; case " $* " in *" -flto "*) echo "LTO is not enabled" >&2; exit 1;; esac')
    another = compiler("another", "echo clang; [ $# = 1 ]")
    assert toolchain.whole_program(able, ".so") == ("-flto",)
    for command in (lossy, without, another, ("zig", "cc"), (str(tmp_path / "none"),)):
        assert toolchain.whole_program(command, ".so") == ()
    assert toolchain.whole_program(able, ".dylib") == toolchain.whole_program(able, ".dll") == ()


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (["describe", "gearbox"], 2, "no unit 'gearbox' (units: controller, friction, friction_gms, machine, "),
        (["describe", "friction", "--cc", "no-such-compiler"], 3, "no-such-compiler"),
        (["describe", "plant", "--modes", "nowhere.csv"], 2, "nowhere.csv"),
        (["describe", "friction", "--axes", str(ROOT / "src/plant_fmu/resources/axes.csv")], 2,
         "friction: takes no axes (it takes no files)"),
        (["build", "plant", "friction", "--out", "x.fmu"], 2, "--out is for one unit"),
        (["describe", "plant", "--poses", "nowhere.bin"], 2, "nowhere.bin: cannot be read"),
        (["describe", "plant", "--name", "a\0b"], 2,
         "the machine's name 'a\\x00b' has characters that cannot be printed"),
        (["repack", "x.fmu", "--axes", "nowhere.csv", "--modes", "m.csv", "--out", "y.fmu"], 2,
         "nowhere.csv: cannot be"),
    ],
)  # fmt: skip
def test_wrong_use_is_answered(arguments: list[str], code: int, text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(arguments) == code
    assert text in capsys.readouterr().err


def test_faulty_c_leaves_no_archive(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    unit = toy(tmp_path / "toy", GOOD)
    (unit / "model.c").write_text("int broken(\n", encoding="utf-8")
    assert cli.main(["build", str(unit), "--out", str(tmp_path / "out" / "toy.fmu")]) == CompilerError.exit_code
    assert "model.c:" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_file_names_must_differ_in_the_flat_folder(tmp_path: Path, compiler: tuple[str, ...]) -> None:
    unit = toy(tmp_path / "toy", GOOD)
    (unit / "log.h").write_text("", encoding="utf-8")
    with pytest.raises(InputError, match=r"log\.h is in"):
        build.load(unit, compiler)


def test_runs_as_module(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "feedsim_packager", "describe", "friction"]
    assert subprocess.run(command, capture_output=True, check=True, cwd=tmp_path).stdout.startswith(b"<?xml")
