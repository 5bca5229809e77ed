"""XML files of a SINUMERIK: numbers in base85, traces over time, frequency responses from spectra and from time."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from feedsim.files.trace import read_recording
from feedsim.files.trace.response_files import read_response
from feedsim.foundation.errors import InputError
from sinumerik_xml_helpers import STEP, TRACE, N, measured


def test_a_frequency_response(tmp_path: Path) -> None:
    text, hertz, system = measured()
    path = tmp_path / "response.XML"
    path.write_text(text, encoding="latin-1")
    found = read_response(path)
    (name,) = found.names
    assert name == "axis 1 node 61/axis 1 node 62"
    np.testing.assert_allclose(found.frequency, hertz[1:])
    np.testing.assert_allclose(found[name], system[1:], rtol=1e-9)
    np.testing.assert_allclose(found.coherence[name], 1.0, rtol=1e-9)


def test_its_time_signals_tell_the_same(tmp_path: Path) -> None:
    text, _, system = measured()
    path = tmp_path / "response.xml"
    path.write_text(text, encoding="latin-1")
    recording = read_recording(path)
    values = recording.read(recording.names)
    np.testing.assert_allclose(values["time"], STEP * np.arange(N), atol=1e-12)
    x, y = (np.array([np.fft.rfft(values[f"axis 1 node {node} run {k}"]) for k in (1, 2)]) for node in (62, 61))
    np.testing.assert_allclose(((y * x.conj()).sum(0) / (np.abs(x) ** 2).sum(0))[1:], system[1:], rtol=1e-9)
    assert recording.notes[0].code == "signals-not-named"


def trace(tmp_path: Path, rows: str) -> Path:
    path = tmp_path / "trace.xml"
    path.write_text(TRACE.format(rows=rows))
    return path


def test_a_trace_over_time(tmp_path: Path) -> None:
    """A signal that is sampled half as often, and one value that is none."""
    rows = '<rec time="0" f1="9218868437227405312"/>' + "".join(
        f'<rec time="{0.002 * k:.3f}" f1="{1.5 * k}"{f""" f2="{k}" """ if k % 2 else ""}/>' for k in range(1, 7)
    )
    recording = read_recording(trace(tmp_path, rows))
    assert recording.names == ("time", "nckServoDataActPos1stEnc64 2", "nckServoDataActCurr64 2")
    assert recording.units["nckServoDataActPos1stEnc64 2"] == "mm"
    values = recording.read(recording.names)
    np.testing.assert_allclose(values["time"], 0.002 * np.arange(1, 7))
    np.testing.assert_allclose(values["nckServoDataActPos1stEnc64 2"], 1.5 * np.arange(1, 7))
    assert values["nckServoDataActCurr64 2"].tolist() == [1, 1, 3, 3, 5, 5]
    (note,) = (note for note in recording.notes if note.code == "channel-resampled")
    assert "nckServoDataActCurr64 2" in note.text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<a/>", "<a> is no SINUMERIK trace (traceData) and no frequency response"),
        ("<a", "is no XML file that can be read"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "has a document type"),
        (TRACE.format(rows=""), "0 rows (rec)"),
        (TRACE.format(rows='<rec time="x" f1="1"/><rec time="1" f1="1"/>'), "a row (rec) of traceData"),
        (TRACE.format(rows='<rec time="0" f1="1"/><rec time="0,5" f1="1"/>'), "a row (rec) of traceData"),
        (TRACE.format(rows='<rec time="1" f1="1"/><rec time="1" f1="2"/>'), "the time 1 follows 1; it must increase"),
        (TRACE.format(rows='<rec time="1" f1="1"/><rec time="nan" f1="2"/>'), "row (rec) 2 of traceData: the time nan"),
        ("<ResponseTestCustom/>", "holds no signals"),
        (measured()[0].replace("m_TimeVector.end", "m_Other"), "a time series without its time"),
        (measured()[0].replace("<![CDATA[", "<![CDATA[%", 1), "which is no number in base85"),
        (measured()[0].replace(f'm_length">{N}<', f'm_length">{N + 1}<', 1), f"of {N + 1} numbers holds {N}"),
        (measured()[0].replace("base85", "base64", 1), "is in format 'base64'"),
    ],
)
def test_files_that_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "file.xml"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(InputError) as caught:
        read_recording(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_trace_is_no_response(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is no frequency response of a SINUMERIK"):
        read_response(trace(tmp_path, '<rec time="0" f1="1"/>'))


@pytest.mark.skipif("FEEDSIM_TRACE" not in os.environ, reason="FEEDSIM_TRACE: a measured response")
def test_a_real_control() -> None:
    """A closed speed loop, of which the ratio of the spectra of its time signals is known, too."""
    found = read_response(os.environ["FEEDSIM_TRACE"])
    (name,) = found.names
    recording = read_recording(os.environ["FEEDSIM_TRACE"])
    values = recording.read(recording.names)
    spectra = [
        np.array([np.fft.rfft(values[f"axis 1 node {node} run {k}"] - values[f"axis 1 node {node} run {k}"].mean())
                  for k in (1, 2)])
        for node in (61, 62)
    ]  # fmt: skip
    own = (spectra[0] * spectra[1].conj()).sum(0) / (np.abs(spectra[1]) ** 2).sum(0)
    band = slice(0, 102)  # to 400 Hz
    np.testing.assert_allclose(found[name][band], own[1:103], rtol=1e-9)
    assert found.coherence[name][:40].min() > 0.99
    assert 20 * np.log10(abs(found[name][19])) == pytest.approx(-4.7, abs=0.05)
    assert found.phase(name)[19] == pytest.approx(-75.7, abs=0.1)
