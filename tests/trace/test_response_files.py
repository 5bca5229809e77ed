"""Frequency responses as values, as CSV files and from universal files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff

from feedsim.files.trace import response_files as uff
from feedsim.files.trace.response import FrequencyResponse, quotient_unit
from feedsim.files.trace.response_files import read_overlay, read_response, read_response_csv, write_response
from feedsim.foundation.errors import InputError, OutputError

F = np.array([1.0, 2.5, 10.0, 1000 / 3])
H = 1 / (0.0164 * 2j * np.pi * F) * np.exp(-1j * F / 100)
NAME, UNIT = "Z.n_a/Z.M_a", "(rad/s)/(N.m)"


def response(**changes: Any) -> FrequencyResponse:
    fields: dict[str, Any] = {
        "frequency": F,
        "columns": {NAME: H, "tool.x_Z/tool.F_Z": 1e-8 * H},
        "units": {NAME: UNIT, "tool.x_Z/tool.F_Z": "m/N"},
        "coherence": {NAME: np.array([0.25, 0.5, 1.0, 1 / 3])},
    }
    return FrequencyResponse(**(fields | changes))


# --- the value -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"frequency": np.array([0.0, 1, 2, 3])}, "above 0"),
        ({"frequency": np.array([1.0, 3, 2, 4])}, "2 Hz follows 3 Hz at row 2"),
        ({"columns": {NAME: H[:3]}}, "has 3 values, there are 4 frequencies"),
        ({"columns": {NAME: H * [1, np.nan, 1, 1]}}, "not finite at row 1"),
        ({"units": {"other": "m"}}, "unit given for 'other'"),
        ({"coherence": {"other": F * 0}}, "coherence given for 'other'"),
        ({"coherence": {NAME: np.array([0, 0.5, 1.1, 1])}}, "is 1.1 at 10 Hz; 0 to 1"),
        ({"columns": {"a [b]": H}, "units": {}, "coherence": {}}, "without brackets"),
    ],
)
def test_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        response(**changes)


def test_selection() -> None:
    whole = response()
    assert whole.select(["tool.*"]).names == ("tool.x_Z/tool.F_Z",)
    assert not whole.select(["tool.*"]).coherence
    with pytest.raises(InputError, match=r"did you mean 'Z.n_a/Z.M_a'"):
        whole["Z.n_a/Z.M"]


def test_phase() -> None:
    whole = FrequencyResponse(F, {"a": np.array([1, 10j, -0.1, -1j])})
    np.testing.assert_allclose(whole.phase("a"), [0, 90, 180, -90])


def test_conversion() -> None:
    whole = response()
    turned = whole.converted({NAME: "rpm/(N.m)"})
    np.testing.assert_allclose(turned[NAME], H * 30 / np.pi, rtol=1e-15)
    assert turned.unit(NAME) == "rpm/(N.m)"
    with pytest.raises(InputError, match=r"Z\.n_a/Z\.M_a'"):
        whole.converted({NAME: "m/N"})


def test_units_of_quotients() -> None:
    assert quotient_unit("rad/s", "N.m") == UNIT
    assert quotient_unit("m", "N") == "m/N"
    assert quotient_unit("m", "m") == "1"
    assert quotient_unit("", "N") == ""


# --- CSV -----------------------------------------------------------------------------------------------------------


def test_round_trip(tmp_path: Path) -> None:
    file = tmp_path / "frf.csv"
    write_response(file, response())
    assert file.read_text().splitlines()[0] == (
        "frequency [Hz],Z.n_a/Z.M_a magnitude [(rad/s)/(N.m)],Z.n_a/Z.M_a phase [deg],Z.n_a/Z.M_a coherence [1],"
        "tool.x_Z/tool.F_Z magnitude [m/N],tool.x_Z/tool.F_Z phase [deg]"
    )
    again = read_response_csv(file)
    np.testing.assert_array_equal(again.frequency, F)
    for name in response():
        np.testing.assert_allclose(again[name], response()[name], rtol=1e-15)  # by way of magnitude and phase
        assert again.unit(name) == response().unit(name)
    np.testing.assert_array_equal(again.coherence[NAME], response().coherence[NAME])
    assert set(again.coherence) == {NAME}


def test_written_whole_or_not_at_all(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot be written"):
        write_response(tmp_path / "missing" / "frf.csv", response())


def written(folder: Path, text: str, name: str = "drive.csv") -> Path:
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return file


@pytest.mark.parametrize(
    "text",
    [
        "f [Hz];Gain [dB];Phase [°]\n10;20,0;90\n20;-6,5;-45,5\n",
        "Frequency [Hz]\tAmplitude [dB]\tphase\n0\t0\t0\n10\t20\t90\n20\t-6.5\t-45.5\n",
        "t [Hz],Mag,Angle [rad]\n10,10,1.5707963267948966\n20,0.4731512589614805,-0.79412480965740\n",
        "omega [rad/s],freq [kHz],gain [dB],phase [deg]\n1,0.01,20,90\n2,0.02,-6.5,-45.5\n",
    ],
)
def test_a_commissioning_tools_export(tmp_path: Path, text: str) -> None:
    found = read_response(written(tmp_path, text))
    assert found.names == ("drive",)
    np.testing.assert_allclose(found.frequency, [10, 20], rtol=1e-12)
    np.testing.assert_allclose(found["drive"], [10j, 10 ** (-6.5 / 20) * np.exp(-1j * np.radians(45.5))], rtol=1e-12)
    assert found.unit("drive") == ""


def test_real_and_imaginary_parts_and_named_decibels(tmp_path: Path) -> None:
    file = written(
        tmp_path, "frequency [Hz],a re [m/N],a im [m/N],b magnitude [dB re m/N],b phase [deg],note\n5,1,-2,40,180,x\n"
    )
    found = read_response_csv(file)
    np.testing.assert_allclose([found["a"][0], found["b"][0]], [1 - 2j, -100], rtol=1e-12)
    assert (found.unit("a"), found.unit("b")) == ("m/N", "m/N")


def test_columns_of_ones_own_choice(tmp_path: Path) -> None:
    file = written(tmp_path, "x [kHz],|G| [dB re m/N],arg G [deg],gamma2\n5,40,180,0.5\n")
    found = read_overlay(f"{file}:{NAME}=|G|,arg G,gamma2")
    np.testing.assert_allclose(found.frequency, [5000])
    np.testing.assert_allclose(found[NAME], [-100], rtol=1e-12)
    assert found.unit(NAME) == "m/N"
    assert found.coherence[NAME] == [0.5]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n", r"drive\.csv:1: no frequency column"),
        ("f,b\n1,2\n", r"drive\.csv:1: no frequency response; its columns are called 'NAME magnitude'"),
        ("f [m],gain,phase\n1,2,3\n", "frequency 'f': unit 'm' is that of a length"),
        ("f,gain,phase [s]\n1,2,3\n", "phase 'phase': unit 's'"),
        ("f,a gain,b phase\n1,2,3\n", "response 'a' has a column of magnitude, but none of phase"),
        ("f,a re,a gain,a phase,a im\n1,2,3,4,5\n", "and re and im too"),
        ("f,a mag,a gain,a phase\n1,2,3,4\n", "'a mag' and 'a gain' are both the magnitude of 'a'"),
        ("f,gain,phase\n1,2,3\n2,-20,3\n", r"drive\.csv:3: a magnitude of -20; if 'gain' is in decibels"),
        ("f,gain,phase\n1,2,3\n1,2,3\n", "frequencies must increase"),
        ("f,gain,phase\n1,2,x\n", r"drive\.csv:2: 'x' in column 'phase' is no number"),
        ("f,a re [m],a im\n1,2,3\n", "'a re' is in 'm', 'a im' in ''"),
        ("f,gain,phase\n0,2,3\n", "no row above 0 Hz"),
        ("f,gain,phase,coherence\n1,2,3,4\n", "coherence of 'drive' is 4 at 1 Hz"),
    ],
)
def test_csv_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_response_csv(written(tmp_path, text))


# --- universal files -----------------------------------------------------------------------------------------------


def dataset(**changes: Any) -> dict[str, Any]:
    """A frequency response function as pyuff writes it."""
    fields: dict[str, Any] = {
        "type": 58, "func_type": 4, "rsp_node": 12, "rsp_dir": 3, "ref_node": 7, "ref_dir": -1,
        "data": H, "x": F, "binary": 0, "id1": "NONE", "rsp_ent_name": "NONE", "ref_ent_name": "NONE",
        "abscissa_spacing": 0, "abscissa_spec_data_type": 18,
        "ordinate_spec_data_type": 8, "ordinate_axis_units_lab": "m",
        "orddenom_spec_data_type": 13, "orddenom_axis_units_lab": "N",
    }  # fmt: skip
    return fields | changes


def universal(folder: Path, *datasets: dict[str, Any], name: str = "modal.uff") -> Path:
    file = folder / name
    file.unlink(missing_ok=True)
    pyuff.UFF(str(file)).write_sets(list(datasets), mode="add")  # its mode "overwrite" spoils binary sets
    return file


@pytest.mark.parametrize("binary", [0, 1])
def test_universal_file(tmp_path: Path, binary: int) -> None:
    even = np.arange(1.0, 9.0)
    values = np.exp(1j * even) / even
    header = {"x": even, "binary": binary, "abscissa_spacing": 1, "abscissa_min": 1.0, "abscissa_inc": 1.0}
    file = universal(
        tmp_path,
        dataset(data=values, **header),
        dataset(data=2 * values, rsp_dir=0, ref_dir=-6, ref_ent_name="bed", **header),
        dataset(data=np.full(8, 0.5), func_type=6, **header),
        dataset(data=values, func_type=2, **header),  # an auto spectrum: none of ours
    )
    found = read_response(file)
    assert found.names == ("12:+Z/7:-X", "12/bed.7:-RZ")
    np.testing.assert_allclose(found.frequency, even, rtol=1e-5)  # E13.5
    np.testing.assert_allclose(found["12:+Z/7:-X"], values, rtol=1e-11)  # E20.12
    np.testing.assert_allclose(found["12/bed.7:-RZ"], 2 * values, rtol=1e-11)
    assert found.unit("12:+Z/7:-X") == "m/N"
    np.testing.assert_array_equal(found.coherence["12:+Z/7:-X"], 0.5)
    assert set(found.coherence) == {"12:+Z/7:-X"}


def test_uneven_frequencies_from_zero(tmp_path: Path) -> None:
    x = np.concatenate([[0.0], F])
    found = uff.read_response_uff(universal(tmp_path, dataset(x=x, data=np.concatenate([[0], H]))))
    np.testing.assert_allclose(found.frequency, F, rtol=1e-5)
    np.testing.assert_allclose(found["12:+Z/7:-X"], H, rtol=1e-11)


def test_universal_file_refused(tmp_path: Path) -> None:
    for datasets, message in (
        ([dataset(func_type=1)], "no frequency response function .*; there is time response"),
        ([dataset(), dataset(data=2 * H)], "two functions of type 4 are called '12:.Z/7:-X'"),
        ([dataset(), dataset(rsp_node=13, x=2 * F)], "function '13:.Z/7:-X' has 4 lines from 2 to 666.667 Hz"),
        ([dataset(abscissa_spec_data_type=17)], "not over frequency"),
        (
            [
                pyuff.prepare_164(
                    units_code=1, units_description="SI", temp_mode=1, length=1.0, force=1.0, temp=1.0, temp_offset=0.0
                )
            ],
            "no dataset 58 .*; there is 164",
        ),
    ):
        with pytest.raises(InputError, match=message):
            read_response(universal(tmp_path, *datasets))
    with pytest.raises(InputError, match=r"no such file: .*none\.uff"):
        read_response(tmp_path / "none.uff")
    with pytest.raises(InputError, match="no dataset 58"):
        read_response(written(tmp_path, "frequency,gain\n", "text.unv"))
    broken = universal(tmp_path, dataset(), name="broken.uff")
    broken.write_text(broken.read_text().replace("e+00", "x+00"))
    with pytest.raises(InputError, match=r"broken\.uff: dataset 1 \(of type 58\) cannot be read"):
        read_response(broken)


# A mode at 60 Hz, 20 nm/N, D 2 %: its receptance, and j omega.
LINES = np.array([1.0, 20.0, 60.0, 300.0])
S = 2j * np.pi * LINES
RECEPTANCE = 20e-9 / (1 - (LINES / 60) ** 2 + 0.04j * LINES / 60)


@pytest.mark.parametrize(
    ("unit", "values", "words"),
    [
        ("m/N", RECEPTANCE, ""),
        ("um/N", 1e6 * RECEPTANCE, ""),
        ("(m/s^2)/N", S**2 * RECEPTANCE, "divided by -(2 pi f)^2"),
        ("m/s²/N", S**2 * RECEPTANCE, "divided by -(2 pi f)^2"),
        ("g/N", S**2 * RECEPTANCE / 9.80665, "g is taken as 9.80665 m/s^2, divided by -(2 pi f)^2"),
        ("mg/N", None, "unknown unit 'mg'"),
        ("gn/kN", 1e3 * S**2 * RECEPTANCE / 9.80665, "g is taken as 9.80665 m/s^2, divided by"),
        ("(mm/s)/N", 1e3 * S * RECEPTANCE, "divided by j 2 pi f"),
        ("N/um", 1e-6 / RECEPTANCE, "the reciprocal is taken"),
        ("N/(m/s)", 1 / (S * RECEPTANCE), "the reciprocal is taken, divided by j 2 pi f"),
        ("kg", 1 / (S**2 * RECEPTANCE), "the reciprocal is taken, divided by -(2 pi f)^2"),
        ("N/g", 9.80665 / (S**2 * RECEPTANCE), "g is taken as 9.80665 m/s^2, the reciprocal is taken, divided by"),
        ("m/N/s^3", None, "is that of"),
        ("rad/(N.m)", None, "is that of"),
    ],
)
def test_accelerance_and_its_kin(tmp_path: Path, unit: str, values: np.ndarray | None, words: str) -> None:
    given = RECEPTANCE if values is None else values
    rows = "".join(f"{f:.17g},{v.real:.17g},{v.imag:.17g}\n" for f, v in zip(LINES, given, strict=True))
    file = written(tmp_path, f"frequency [Hz],a re [{unit}],a im [{unit}]\n0,1,1\n{rows}")
    found = read_response_csv(file)
    assert [(note.code, note.place) for note in found.notes] == [("zero-frequency-left-out", str(file))]
    if values is None:
        with pytest.raises(InputError, match=words):
            found.converted({"a": "m/N"})
        return
    receptance = found.converted({"a": "m/N"})
    np.testing.assert_allclose(receptance["a"], RECEPTANCE, rtol=1e-12)
    assert words in (receptance.notes[1].text if words else "")
    assert len(receptance.notes) == 1 + bool(words)
    np.testing.assert_allclose(receptance.converted({"a": "(m/s^2)/N"})["a"], S**2 * RECEPTANCE, rtol=1e-12)


def test_plain_quotients_are_not_integrated(tmp_path: Path) -> None:
    file = written(tmp_path, "f,a re [1/s],a im [1/s]\n1,1,1\n")
    with pytest.raises(InputError, match="one of a plain number is expected"):
        read_response_csv(file).converted({"a": "1"})


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("dB re (m/s^2)/N", 1), ("dB re 1 (m/s^2)/N", 1), ("dB (re 1 mm/s^2/N)", 1e-3), ("dB re 1e-6 (m/s^2)/N", 1e-6)],
)
def test_decibels_of_an_accelerance(tmp_path: Path, unit: str, factor: float) -> None:
    file = written(tmp_path, f"f,a gain [{unit}],a phase [deg]\n10,40,180\n")
    found = read_response_csv(file).converted({"a": "m/N"})
    np.testing.assert_allclose(found["a"], [100 * factor / (20 * np.pi) ** 2], rtol=1e-12)


@pytest.mark.parametrize(
    ("labels", "types", "values", "words"),
    [
        (("m/s^2", "N"), (12, 13), S**2 * RECEPTANCE, "divided by -(2 pi f)^2"),
        (("NONE", "NONE"), (12, 13), S**2 * RECEPTANCE * 1e3 / 1e3, "m/s^2 by its type, acceleration"),
        (("NONE", "N"), (11, 13), S * RECEPTANCE * 1e3, "m/s by its type, velocity"),
        (("g", "NONE"), (12, 9), S**2 * RECEPTANCE / 9.80665 / 1e3, "N by its type, reaction force"),
        (("m", "N"), (12, 13), RECEPTANCE, "its label says m, its type acceleration; the label counts"),
    ],
)
def test_units_by_types_of_a_universal_file(
    tmp_path: Path, labels: tuple[str, str], types: tuple[int, int], values: np.ndarray, words: str
) -> None:
    """Without labels values are in the file's units, here mm and mN (dataset 164)."""
    file = universal(
        tmp_path,
        pyuff.prepare_164(
            units_code=5, units_description="mm", temp_mode=1, length=1e3, force=1e3, temp=1.0, temp_offset=0.0
        ),
        dataset(
            x=LINES, data=values, ordinate_axis_units_lab=labels[0], orddenom_axis_units_lab=labels[1],
            ordinate_spec_data_type=types[0], orddenom_spec_data_type=types[1],
        ),
    )  # fmt: skip
    found = read_response(file)
    receptance = found.converted(dict.fromkeys(found.names, "m/N"))
    np.testing.assert_allclose(receptance[found.names[0]], RECEPTANCE, rtol=1e-5)  # frequencies are E13.5
    (note,) = (note for note in receptance.notes if words in note.text)
    assert note.code in ("response-converted", "unit-assumed", "unit-contradicted")


# --- what is asked for on the command line -------------------------------------------------------------------------


def test_overlay(tmp_path: Path) -> None:
    own = tmp_path / "frf.csv"
    write_response(own, response())
    assert read_overlay(str(own)).names == response().names
    assert read_overlay(f"{own}:{NAME}").names == (NAME,)
    assert read_overlay(f"{own}:compliance=tool.x_Z/tool.F_Z").unit("compliance") == "m/N"
    drive = written(tmp_path, "f;Gain [dB];Phase [deg]\n10;20;90\n")
    np.testing.assert_allclose(read_overlay(f"{drive}:{NAME}")[NAME], [10j], rtol=1e-12)
    odd = written(tmp_path, "f;A [dB];B [deg]\n10;20;90\n", "odd.csv")
    np.testing.assert_allclose(read_overlay(f"{odd}:{NAME}=A, B")[NAME], [10j], rtol=1e-12)
    modal = universal(tmp_path, dataset())
    np.testing.assert_allclose(read_overlay(f"{modal}:{NAME}=12:+Z/7:-X")[NAME], H, rtol=1e-11)
    for text, message in (
        (f"{own}:other", r"holds 2 responses and none is called 'other'; .*frf\.csv:other=SOURCE"),
        (f"{own}:other=x", "no frequency response 'x'"),
        (f"{own}:", "behind the colon"),
        (f"{odd}:{NAME}=A,B,C,D", "magnitude and phase are expected"),
        (f"{modal}:{NAME}=A,B", "a universal file has no columns"),
    ):
        with pytest.raises(InputError, match=message):
            read_overlay(text)
