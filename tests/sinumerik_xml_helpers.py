"""XML files of a SINUMERIK, written by their description: numbers in base85, a trace over time, a measured response."""

from __future__ import annotations

import struct

import numpy as np

from feedsim.files.trace.sinumerik_xml import ALPHABET

N, STEP = 255, 125e-6


def base85(values: np.ndarray) -> str:
    """By the description alone: four bytes are five digits, four of zero a point."""
    text = []
    data = struct.pack(f">{len(values)}d", *values)
    for k in range(0, len(data), 4):
        number = int.from_bytes(data[k : k + 4], "big")
        text.append("." if not number else "".join(ALPHABET[number // 85**p % 85] for p in (4, 3, 2, 1, 0)))
    whole = "".join(text)
    return "\n".join(whole[k : k + 77] for k in range(0, len(whole), 77))


def array(name: str, values: np.ndarray) -> str:
    kind = "ComplexNumber" if np.iscomplexobj(values) else "double"
    flat = np.column_stack([values.real, values.imag]).ravel() if np.iscomplexobj(values) else values
    return (
        f'<NumericArray elementtype="{kind}" format="base85" name="{name}"><unsigned_int name="m_length">{len(values)}'
        f'</unsigned_int><raw name="m_pNumberArray"><![CDATA[{base85(flat)}]]></raw></NumericArray>'
    )


def spectrum(tag: str, own: int, values: np.ndarray, hertz: np.ndarray) -> str:
    return (
        f'<SigNodeCrossSpectrumInfo name="{tag}"><unsigned_int name="m_uSignodeId">{own}</unsigned_int><CrossSpectrum>'
        f"{array('m_ValueVector', values)}{array('m_FrequencyVector', hertz)}"
        "</CrossSpectrum></SigNodeCrossSpectrumInfo>"
    )


def node(number: int, instance: int, runs: list[np.ndarray], own: np.ndarray, cross: str, hertz: np.ndarray) -> str:
    series = "".join(
        f'<TimeSeries>{array("m_ValueVector", run)}<float name="m_TimeVector.start">0</float>'
        f'<float name="m_TimeVector.end">{(N - 1) * STEP!r}</float></TimeSeries>'
        for run in runs
    )
    return (
        f'<PlatformSignalNode><unsigned_int name="m_uNodeId">{number}</unsigned_int><unsigned_int name="m_uAxis">1'
        f'</unsigned_int><integer name="m_iUniqueInstanceId">{instance}</integer><LinkedList name="m_TimeSeriesList">'
        f"{series}</LinkedList>{spectrum('m_autospectrumInfo', number, own.astype(complex), hertz)}"
        f'<LinkedList name="m_crossSpecInfoList">{cross}</LinkedList></PlatformSignalNode>'
    )


def measured() -> tuple[str, np.ndarray, np.ndarray]:
    """A file, its frequencies and the response of the system in it: a lag of first order with a dead time."""
    rng = np.random.default_rng(2)
    hertz = np.fft.rfftfreq(N, STEP)
    system = np.exp(-2j * np.pi * hertz * 3 * STEP) / (1 + 1j * hertz / 200)
    inputs = [rng.choice([-1.0, 1.0], N) for _ in range(2)]
    X = [np.fft.rfft(x) for x in inputs]
    Y = [each * system for each in X]
    outputs = [np.fft.irfft(y, N) for y in Y]
    own_x, own_y = (np.mean([np.abs(each) ** 2 for each in spectra], axis=0) for spectra in (X, Y))
    cross = np.mean([y.conj() * x for x, y in zip(X, Y, strict=True)], axis=0)
    text = (
        '<?xml version="1.0" encoding="ISO-8859-1"?><ResponseTestCustom>'
        '<LinkedList name="m_MeasurementSignalNodeList">'
        + node(61, 0, outputs, own_y, spectrum("m_crossSpecInfoList_el", 62, cross, hertz), hertz)
        + node(62, 1, inputs, own_x, "", hertz)
        + '</LinkedList><LinkedList name="m_listPrimaryFreqRespSigNodeData"><PrimaryFreqRespSigNodeData>'
        '<integer name="m_iInputSigNodeUniqueInstanceID">1</integer>'
        '<integer name="m_iOutputSigNodeUniqueInstanceID">0</integer></PrimaryFreqRespSigNodeData></LinkedList>'
        "</ResponseTestCustom>"
    )
    return text, hertz, system


TRACE = """<traceDataRoot><traceDisplaySetup><signals>
<signal key="a" name="/Nck/!SD/nckServoDataActPos1stEnc64 [u1, 2]" description="Actual position" unit="mm"/>
<signal key="b" name="/Nck/!SD/nckServoDataActCurr64 [u1, 2]" description="Current"/></signals></traceDisplaySetup>
<traceData><dataFrame><frameHeader startTime="x"/>
<dataSignal id="f1" key="a" interval="0.002"/><dataSignal id="f2" key="b" interval="0.004"/>
{rows}</dataFrame></traceData></traceDataRoot>"""
