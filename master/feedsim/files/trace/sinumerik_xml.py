"""XML files of a SINUMERIK: traces of signals over time, and measured frequency responses with their time signals.

A trace (`traceData`) lists signals (`dataSignal`) and rows (`rec`), whose attributes f1, f2, ... are the values of the
signals; one that is sampled less often is missing in rows between. A frequency response (`ResponseTestCustom` and other
`ResponseTest...`) holds for each of its signals time series, its own spectrum and cross spectra; numbers are doubles,
most significant byte first, in an alphabet of 85 characters of its own, in which "." is four bytes of zero. The
alphabet: as documented by Trace-Tools of E. Rhoden.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from feedsim.files import source
from feedsim.files.trace.response import Complexes, FrequencyResponse
from feedsim.files.trace.scopes import Signals, unique
from feedsim.files.trace.trace import Array
from feedsim.foundation.errors import Finding, InputError, shorten_list
from feedsim.foundation.units import known_unit, spell_unit

SUFFIX = ".xml"
ALPHABET = "0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ!#$`()*+-/:;=?@[]^_{|}~"
NO_VALUE_LIMIT = 9.2188684372274e18  # and above: no value, the bits of an infinity as a whole number
MAX_TRACE_BYTES = 256 << 20  # bytes of a file


class _PlainTreeBuilder(ElementTree.TreeBuilder):
    """Of files without a document type, which is where entities grow."""

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        raise InputError("has a document type, as no trace of a control has")


def _root(path: Path) -> ElementTree.Element:
    parser = ElementTree.XMLParser(target=_PlainTreeBuilder())
    try:
        parser.feed(source.content(path, MAX_TRACE_BYTES))
        root: ElementTree.Element = parser.close()
    except ElementTree.ParseError as error:
        raise InputError(f"{path} is no XML file that can be read: {error}") from None
    except (LookupError, ValueError) as error:
        raise InputError(f"{path} is no XML file that can be read: {error}") from None
    except InputError as error:
        raise InputError(f"{path} {error}" if str(error).startswith("has a") else str(error)) from None
    return root


def read_signals(path: Path) -> Signals:
    """Signals over time of either kind. InputError: neither, nothing recorded, a value that is none."""
    root = _root(path)
    if (frame := root.find(".//traceData/dataFrame")) is None:
        frame = root.find("dataFrame") if root.tag == "traceData" else None
    if frame is not None:
        return _trace(path, root, frame)
    if root.tag.startswith("ResponseTest"):
        return _time_signals(path, root)
    raise InputError(
        f"{path}: <{root.tag}> is no SINUMERIK trace (traceData) and no frequency response (ResponseTestCustom) of one"
    )


def _trace(path: Path, root: ElementTree.Element, frame: ElementTree.Element) -> Signals:
    described = {element.get("key", element.get("name", "")): element for element in root.iter("signal")}
    listed = frame.findall("dataSignal")
    if not listed:
        raise InputError(f"{path}: traceData lists no dataSignal")
    names, keys, units = [], [], []
    for k, signal in enumerate(listed, 1):
        more: Mapping[str, str] = described[signal.get("key", "")].attrib if signal.get("key", "") in described else {}
        both = {**more, **signal.attrib}
        # The path names signal and axis, "/Nck/!SD/nckServoDataActPos1stEnc64 [u1, 1]"; the description may be of both.
        names.append(both.get("name") or both.get("description") or f"f{k}")
        own = signal.get("id", "")
        keys.append(own if own.startswith("f") else f"f{k}")
        units.append(both.get("unit") or both.get("units") or "")
    rows = frame.findall("rec")
    try:
        time = np.array([float(row.attrib["time"]) for row in rows])
        table = np.array([[float(row.get(key, "nan")) for key in keys] for row in rows])
    except (KeyError, ValueError) as error:
        raise InputError(f"{path}: a row (rec) of traceData: {error}") from None
    if len(rows) < 2:
        raise InputError(f"{path}: {len(rows)} rows (rec) in traceData; at least 2 are needed")
    back = np.flatnonzero(~(np.diff(time) > 0))
    if back.size:
        before, after = time[back[0] : back[0] + 2]
        raise InputError(
            f"{path}: row (rec) {back[0] + 2} of traceData: the time {after:.9g} follows {before:.9g}; it must increase"
        )
    with np.errstate(invalid="ignore"):
        table[np.abs(table) >= NO_VALUE_LIMIT] = np.nan
    short = {name.rpartition("/")[2] for name in names}
    titles = unique(_title(name.rpartition("/")[2] if len(short) == len(names) else name) for name in names)
    notes = []
    known = np.isfinite(table)
    if empty := [title for title, rows_of in zip(titles, known.T, strict=True) if not rows_of.any()]:
        notes.append(
            Finding("channel-empty", "doubt", f"{path}: {shorten_list(empty, 4)}: no value is recorded", str(path))
        )
    whole = [k for k in range(len(titles)) if known[:, k].any()]
    first = max(int(np.argmax(known[:, k])) for k in whole) if whole else 0
    if not whole or first > len(rows) - 2:
        raise InputError(f"{path}: its signals have no rows in common")
    if slow := [titles[k] for k in whole if not known[first:, k].all()]:
        text = f"{path}: {shorten_list(slow, 4)}: sampled less often; values are kept until the next one"
        notes.append(Finding("channel-resampled", "doubt", text, str(path)))
    columns, result = {"time": time[first:]}, {"time": "s"}
    for k in whole:
        last = np.maximum.accumulate(np.where(known[:, k], np.arange(len(rows)), 0))
        columns[titles[k]] = table[last, k][first:]
        unit = units[k]
        result[titles[k]] = spell_unit(unit) if unit and known_unit(unit) else ""
        if unit and not result[titles[k]]:
            text = f"{path}: {titles[k]} is in {unit!r}, a unit that is not known"
            notes.append(Finding("unit-unknown", "doubt", text, str(path)))
    return Signals(columns, result, tuple(notes))


def _title(name: str) -> str:
    """ "nckServoDataActPos1stEnc64 [u1, 2]" -> "nckServoDataActPos1stEnc64 2": the signal, and the axis."""
    match = re.fullmatch(r"(.*?)\s*\[u\d+[,;]\s*(\d+)\]", name.strip())
    return f"{match[1]} {match[2]}" if match else name


# --- frequency responses ---


def _doubles(path: Path, array: ElementTree.Element | None) -> Array:
    """Numbers of a NumericArray; complex ones as pairs."""
    if array is None:
        raise InputError(f"{path}: a NumericArray is missing")
    if array.get("format") not in ("base85", None):
        raise InputError(f"{path}: a NumericArray is in format {array.get('format')!r}; known is base85")
    text = "".join((array.findtext("raw") or "").split())
    words: list[int] = []
    at = 0
    while at < len(text):
        if text[at] == ".":
            words.append(0)
            at += 1
            continue
        digits = [_DIGIT.get(c, -1) for c in text[at : at + 5]]
        value = sum(digit * 85**k for k, digit in zip(range(4, -1, -1), digits, strict=False))
        if len(digits) < 5 or min(digits) < 0 or value >= 1 << 32:
            raise InputError(f"{path}: a NumericArray holds {text[at : at + 5]!r}, which is no number in base85")
        words.append(value)
        at += 5
    if len(words) % 2:
        raise InputError(f"{path}: a NumericArray ends within a number")
    values = np.array(words, dtype=">u4").view(">f8").astype(np.float64)
    wanted = array.findtext("unsigned_int[@name='m_length']")
    numbers = values.size // (2 if array.get("elementtype") == "ComplexNumber" else 1)
    if wanted is not None and wanted.strip() != str(numbers):
        raise InputError(f"{path}: a NumericArray of {wanted.strip()} numbers holds {numbers}")
    if not np.all(np.isfinite(values)):
        raise InputError(f"{path}: a NumericArray holds a value that is no finite number")
    return values


_DIGIT = {character: k for k, character in enumerate(ALPHABET)}


def _nodes(path: Path, root: ElementTree.Element) -> dict[str, ElementTree.Element]:
    """Title -> signal of the measurement, the instance's number among its children."""
    elements = root.findall(".//LinkedList[@name='m_MeasurementSignalNodeList']/PlatformSignalNode")
    if not elements:
        raise InputError(f"{path}: {root.tag} holds no signals (m_MeasurementSignalNodeList)")
    titles = unique(f"axis {_text(node, 'm_uAxis')} node {_text(node, 'm_uNodeId')}" for node in elements)
    return dict(zip(titles, elements, strict=True))


def _text(element: ElementTree.Element, name: str) -> str:
    result = element.find(f"*[@name='{name}']")
    return (result.text or "").strip() if result is not None else ""


def _time_signals(path: Path, root: ElementTree.Element) -> Signals:
    columns: dict[str, Array] = {}
    time: Array | None = None
    for title, node in _nodes(path, root).items():
        for k, series in enumerate(node.iter("TimeSeries"), 1):
            values = _doubles(path, series.find("NumericArray"))
            try:
                begin, end = (float(_text(series, f"m_TimeVector.{which}")) for which in ("start", "end"))
            except ValueError:
                raise InputError(f"{path}: {title}: a time series without its time (m_TimeVector)") from None
            own = np.linspace(begin, end, values.size)
            if time is None:
                time = own
            elif own.size != time.size or np.abs(own - time).max(initial=0.0) > 1e-9:
                raise InputError(f"{path}: {title}: its time series are of different times")
            columns[f"{title} run {k}"] = values
    if time is None or time.size < 2:
        raise InputError(f"{path}: {root.tag} holds no time signals; its spectra are read as a frequency response")
    text = f"{path}: neither units nor names of the signals are in the file; nodes are the control's numbers of them"
    note = Finding("signals-not-named", "doubt", text, str(path))
    return Signals({"time": time} | columns, {"time": "s"} | dict.fromkeys(columns, ""), (note,))


def read_response_xml(path: Path) -> FrequencyResponse:
    """The measured response, output over input, with its coherence.

    It is the mean cross spectrum over the input's own spectrum (H1), as the file has them. InputError: another file, or
    one without spectra.
    """
    root = _root(path)
    if not root.tag.startswith("ResponseTest"):
        raise InputError(f"{path}: <{root.tag}> is no frequency response of a SINUMERIK (ResponseTestCustom)")
    nodes = _nodes(path, root)
    by_instance = {_text(node, "m_iUniqueInstanceId"): title for title, node in nodes.items()}
    pairs = [
        (by_instance.get(_text(element, "m_iOutputSigNodeUniqueInstanceID")),
         by_instance.get(_text(element, "m_iInputSigNodeUniqueInstanceID")))
        for element in root.iter("PrimaryFreqRespSigNodeData")
    ]  # fmt: skip
    if not pairs:
        raise InputError(f"{path}: {root.tag} does not say which signal is input and which is output")
    frequency: Array | None = None
    columns: dict[str, Complexes] = {}
    coherence: dict[str, Array] = {}
    for output, given in pairs:
        if output is None or given is None:
            raise InputError(f"{path}: a response is of a signal that the file does not hold")
        hertz, own_in = _spectrum(path, given, nodes[given].find("SigNodeCrossSpectrumInfo"))
        _, own_out = _spectrum(path, output, nodes[output].find("SigNodeCrossSpectrumInfo"))
        list_of = nodes[output].find("LinkedList[@name='m_crossSpecInfoList']")
        wanted = _text(nodes[given], "m_uNodeId")
        infos = [] if list_of is None else [e for e in list_of if _text(e, "m_uSignodeId") == wanted] or list(list_of)
        if not infos:
            raise InputError(f"{path}: {output} has no cross spectrum with {given}")
        _, cross = _spectrum(path, output, infos[0])
        power, out = own_in.real, own_out.real
        kept = (hertz > 0) & (power > 0)
        if not kept.any() or cross.size != hertz.size or out.size != hertz.size:
            raise InputError(f"{path}: spectra of {output} and {given} of different lengths, or without power")
        name = f"{output}/{given}"
        # The file has the mean of conj(output) input: the time signals in it give the same to the last digits.
        columns[name] = (cross.conj() / np.where(power > 0, power, 1.0))[kept]
        with np.errstate(divide="ignore", invalid="ignore"):
            coherent = np.abs(cross) ** 2 / (power * out)
        coherence[name] = np.clip(np.nan_to_num(coherent), 0.0, 1.0)[kept]
        frequency = hertz[kept]
    assert frequency is not None
    try:
        return FrequencyResponse(frequency, columns, {}, coherence)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _spectrum(path: Path, title: str, info: Any) -> tuple[Array, Complexes]:
    """Frequencies [Hz] and values of a spectrum."""
    spectrum = info.find("CrossSpectrum") if info is not None else None
    if spectrum is None:
        raise InputError(f"{path}: {title} has no spectrum; save it with spectra")
    arrays = {entry.get("name"): entry for entry in spectrum.findall("NumericArray")}
    parts = _doubles(path, arrays.get("m_ValueVector"))
    hertz = _doubles(path, arrays.get("m_FrequencyVector"))
    if parts.size != 2 * hertz.size:
        raise InputError(f"{path}: {title}: a spectrum of {parts.size // 2} values over {hertz.size} frequencies")
    return hertz, parts[::2] + 1j * parts[1::2]
