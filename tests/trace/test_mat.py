"""MAT files: read as SciPy reads whole ones, which shares no code with this; of damaged ones an error, whatever it is.

SciPy's own reader ends the interpreter on some of the damaged ones, so that it is asked about whole ones alone.
"""

from __future__ import annotations

import io
import random
import resource
import struct
import subprocess
import sys
import warnings
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy
from scipy.io import loadmat, savemat

from command_helpers import PATIENCE
from feedsim.files.trace import read_recording
from feedsim.files.trace.mat import OtherValue, flatten_variables, read_mat
from feedsim.foundation.errors import InputError

CONTENT: dict[str, Any] = {
    "t": np.arange(500) / 500,
    "row": np.arange(4.0)[None, :],
    "counts": np.arange(-3, 40, dtype=np.int16),
    "single": np.linspace(0, 1, 7, dtype=np.float32),
    "on": np.array([True, False, True]),
    "long": np.array([2**62, -5]),
    "cube": np.arange(24.0).reshape(2, 3, 4),
    "number": 3.25,
    "none": np.zeros((0, 3)),
    "text": "M_a in N.m",
    "cells": np.array([1.0, "two"], dtype=object),
    "complex": np.array([1 + 2j, 3.0]),
    "rec": {"pos": np.arange(5.0), "in": {"i_q": np.ones(3), "note": "x"}},
}
MATLAB_S_OWN = sorted((Path(scipy.__file__).parent / "io" / "matlab" / "tests" / "data").glob("*.mat"))


def saved(path: Path, form: str = "5", compressed: bool = False, content: Mapping[str, Any] = CONTENT) -> Path:
    plain = {name: value for name, value in content.items() if form == "5" or not isinstance(value, (dict, np.ndarray))
             or (isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and value.itemsize != 1 and value.ndim < 3
                 and value.dtype != np.int64)}  # fmt: skip
    buffer = io.BytesIO()
    savemat(buffer, plain, format=form, do_compression=compressed)
    path.write_bytes(buffer.getvalue())
    return path


def as_scipy_reads(path: Path) -> Iterator[tuple[str, Any]]:
    def walked(content: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
        for name, value in content.items():
            fields = getattr(value, "_fieldnames", None)
            if fields is None:
                yield prefix + name, value
            elif type(value).__name__ == "mat_struct":
                yield from walked({each: getattr(value, each) for each in fields}, f"{prefix}{name}.")

    with path.open("rb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        content = loadmat(file, struct_as_record=False, squeeze_me=True)
    yield from walked({name: value for name, value in content.items() if not name.startswith("__")})


def assert_same(path: Path) -> int:
    """How many arrays of numbers have been compared."""
    mine, count = dict(flatten_variables(read_mat(path))), 0
    for name, value in as_scipy_reads(path):
        array = np.asarray(value)
        found = mine.get(name)
        if array.dtype.kind == "U" and array.shape == () and isinstance(found, np.ndarray):
            assert "".join(found.ravel().tolist()).rstrip() == str(array).rstrip(), name
            continue
        if array.dtype.kind not in "fiuc" or isinstance(found, OtherValue):
            assert not isinstance(found, np.ndarray) or found.dtype.kind == "U", name
            assert array.dtype.kind in "UO" or array.shape == () or hasattr(value, "tocsc"), name
            continue
        assert isinstance(found, np.ndarray)
        assert found.shape == array.shape or found.size == array.size == 0, name
        assert np.array_equal(found.ravel(), array.ravel(), equal_nan=True), name
        count += 1
    return count


@pytest.mark.parametrize(("form", "compressed", "least"), [("4", False, 5), ("5", False, 10), ("5", True, 10)])
def test_as_scipy_reads(tmp_path: Path, form: str, compressed: bool, least: int) -> None:
    assert assert_same(saved(tmp_path / "a.mat", form, compressed)) >= least


def test_files_that_matlab_has_written(tmp_path: Path) -> None:
    """SciPy's own collection, versions 4 to 7 of several systems and both orders of bytes, where it is installed."""
    if not MATLAB_S_OWN:
        pytest.skip("this SciPy came without its tests")
    count = 0
    for path in MATLAB_S_OWN:
        if any(word in path.name for word in ("object", "duplicate", "utf8", "scalarcell")):
            continue  # objects' fields, names that are none: told as what they are
        if "hdf5" in path.name:  # version 7.3, which SciPy does not read
            np.testing.assert_allclose(read_mat(path)["testdouble"], [np.arange(9) * np.pi / 4], rtol=1e-15)
            continue
        try:
            names = [name for name, _ in as_scipy_reads(path)]
        except (ValueError, NotImplementedError, zlib.error, TypeError):
            with pytest.raises(InputError):
                read_mat(path)
            continue
        count += assert_same(path) if names else 0
    assert count > 50


@pytest.mark.parametrize(("form", "compressed"), [("4", False), ("5", False), ("5", True)])
def test_no_damage_is_more_than_an_error(tmp_path: Path, form: str, compressed: bool) -> None:
    """Bits that flip, bytes that are lost, a file that ends too soon."""
    whole = saved(tmp_path / "a.mat", form, compressed).read_bytes()
    chance, refused = random.Random(17), 0
    for i in range(400):
        content = bytearray(whole)
        for _ in range(1 + i % 8):
            content[chance.randrange(min(len(content), 600 if i % 2 else 10**6))] ^= 1 << chance.randrange(8)
        if i % 5 == 0:
            del content[chance.randrange(len(content)) :]
        (tmp_path / "b.mat").write_bytes(content)
        try:
            read_recording(tmp_path / "b.mat")
        except InputError:
            refused += 1
    assert refused > 100


def element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)


def matrix(name: bytes, data: bytes, of_class: int = 6, size: tuple[int, ...] = (4, 1)) -> bytes:
    parts = element(6, struct.pack("<II", of_class, 0)) + element(5, struct.pack(f"<{len(size)}i", *size))
    return element(14, parts + element(1, name) + data)


HEAD = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
NUMBERS = element(9, np.arange(4.0).tobytes())
NESTED = NUMBERS


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (HEAD + matrix(b"x", NUMBERS)[:-9], "ends within variable 1"),
        (HEAD + matrix(b"x", NUMBERS, size=(4, 2)), "'x' holds 4 values; its size (4, 2) gives 8"),
        (HEAD + matrix(b"x", NUMBERS, size=(-4, -1)), "has the size [-4, -1]"),
        (HEAD + matrix(b"x", NUMBERS, size=(2**31 - 1,) * 3), "gives 99035"),
        (HEAD + matrix(b"x", NUMBERS, of_class=99), "'x' is of the unknown class 99"),
        (HEAD + matrix(b"x", element(77, b"\0" * 32)), "'x' is data of type 77"),
        (HEAD + matrix(b"x", b"", 2, (1, 1)), "ends within the fields of 'x'"),
        (HEAD + element(9, b"\0" * 8), "there is data of type 9"),
        (b"\x00\x00\x00\x00" + struct.pack("<4i", 2**30, 2**30, 0, 2) + b"x\0", "1073741824 rows"),
        (b"\x00\x00\x00\x00" + struct.pack("<4i", -1, 1, 0, 2) + b"x\0" + b"\0" * 80, "variable 1 is that of none"),
        (HEAD + struct.pack("<II", 15, 3) + b"abc", "cannot be inflated"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, content: bytes, words: str) -> None:
    (tmp_path / "x.mat").write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_mat(tmp_path / "x.mat")
    assert str(tmp_path / "x.mat") in str(caught.value)
    assert words in str(caught.value)


def test_structures_without_end(tmp_path: Path) -> None:
    inner = matrix(b"", NUMBERS)
    for _ in range(3000):
        fields = struct.pack("<HHi", 5, 4, 2) + element(1, b"a\0")
        inner = matrix(b"s", fields + inner, 2, (1, 1))
    (tmp_path / "x.mat").write_bytes(HEAD + inner)
    with pytest.raises(InputError, match="structures within one another"):
        read_mat(tmp_path / "x.mat")


def test_a_file_that_inflates_without_end(tmp_path: Path) -> None:
    """A megabyte that would be 320 is refused with words, and the memory stays within bounds."""
    packer = zlib.compressobj(1)
    data = b"".join([packer.compress(b"\0" * (1 << 20)) for _ in range(320)] + [packer.flush()])
    (tmp_path / "x.mat").write_bytes(HEAD + struct.pack("<II", 15, len(data)) + data)

    def narrow() -> None:
        resource.setrlimit(resource.RLIMIT_DATA, (700 << 20, 700 << 20))

    words = ["convert", str(tmp_path / "x.mat"), "--column", "t=time:s", "--out", str(tmp_path / "x.csv")]
    done = subprocess.run([sys.executable, "-m", "feedsim", *words], capture_output=True, text=True, timeout=PATIENCE,
                          preexec_fn=narrow)  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert "inflate to more bytes than are allowed" in done.stderr
    assert not (tmp_path / "x.csv").exists()


def test_what_is_no_regular_file() -> None:
    with pytest.raises(InputError, match="/dev/zero is a device"):
        read_mat(Path("/dev/zero"))
