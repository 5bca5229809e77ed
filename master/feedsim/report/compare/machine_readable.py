"""Comparisons for programs: JUnit XML, as GitHub, GitLab and Jenkins show it, and JSON."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from math import isfinite
from typing import Any
from xml.etree import ElementTree

from feedsim.compare import Comparison, Variable

# Characters that XML 1.0 cannot hold.
_ILLEGAL = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit(comparisons: Sequence[Comparison], durations: Sequence[float] = ()) -> bytes:
    """JUnit XML: a suite per pair, called by both its files, a case per variable, and one for the pair itself.

    What differs or is missing is a failure, what cannot be compared an error. durations: [s] of the pairs.
    """
    root = ElementTree.Element("testsuites", name="feedsim compare")
    totals = dict.fromkeys(("tests", "failures", "errors"), 0)
    for i, comparison in enumerate(comparisons):
        seconds = durations[i] if i < len(durations) else 0.0
        pair = _text(f"{comparison.result} against {comparison.reference}")
        suite = ElementTree.SubElement(root, "testsuite", name=pair)
        counts = dict.fromkeys(totals, 0)
        whole = ElementTree.SubElement(suite, "testcase", classname=pair, name="(whole)", time=f"{seconds:.3f}")
        counts["tests"] += 1
        if comparison.problem:
            broken = comparison.verdict == "unusable" and not comparison.those("same", "different")
            _fault(whole, "error" if broken else "failure", comparison.problem, comparison.problem)
            counts["errors" if broken else "failures"] += 1
        for variable in comparison.variables:
            case = ElementTree.SubElement(suite, "testcase", classname=pair, name=_text(variable.name), time="0.000")
            counts["tests"] += 1
            if variable.verdict == "unusable":
                _fault(case, "error", variable.reason, variable.reason)
                counts["errors"] += 1
            elif variable.verdict != "same":
                _fault(case, "failure", variable.line, _details(comparison, variable))
                counts["failures"] += 1
        out = [f"result: {comparison.result}", f"reference: {comparison.reference}", comparison.line, *comparison.notes]
        for name, number in counts.items():
            suite.set(name, str(number))
            totals[name] += number
        suite.set("skipped", "0")
        suite.set("time", f"{seconds:.3f}")
        ElementTree.SubElement(suite, "system-out").text = _text("\n".join(out))
    for name, number in totals.items():
        root.set(name, str(number))
    root.set("time", f"{sum(durations):.3f}")
    ElementTree.indent(root)
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def to_json(comparisons: Sequence[Comparison]) -> str:
    """JSON text: verdicts, every variable in full precision; null where there is no number."""
    data = {
        "verdict": overall(comparisons),
        "comparisons": [
            {
                "result": each.result,
                "reference": each.reference,
                "verdict": each.verdict,
                "problem": each.problem,
                "notes": list(each.notes),
                "start": each.start,
                "end": each.end,
                "shift": each.shift,
                "worst": each.worst.name if each.worst is not None else None,
                "variables": [_variable(variable) for variable in each.variables],
            }
            for each in comparisons
        ],
    }
    return json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def overall(comparisons: Sequence[Comparison]) -> str:
    """The worst verdict of all."""
    return max((each for each in comparisons), key=lambda each: each.exit_code).verdict


def _variable(variable: Variable) -> dict[str, Any]:
    names = (
        "name", "source", "verdict", "unit", "time", "value", "expected", "deviation", "allowed", "ratio", "reach",
        "rows", "outside", "first", "reason",
    )  # fmt: skip
    values = {name: getattr(variable, name) for name in names}
    return {k: None if isinstance(v, float) and not isfinite(v) else v for k, v in values.items()}


def _details(comparison: Comparison, variable: Variable) -> str:
    if variable.verdict == "missing":
        return variable.reason
    unit = f" {variable.unit}" if variable.unit not in ("", "1") else ""
    lines = [
        f"{variable.name}: {variable.line}",
        f"outside in {variable.outside} of {variable.rows} rows, first at {variable.first} s",
        f"result {variable.value!r}{unit}, reference {variable.expected!r}{unit}",
        f"result: {comparison.result}, column {variable.source}",
        f"reference: {comparison.reference}",
    ]
    return "\n".join(lines + ([variable.reason] if variable.reason else []))


def _fault(case: ElementTree.Element, kind: str, message: str, text: str) -> None:
    ElementTree.SubElement(case, kind, message=_text(message), type=kind).text = _text(text)


def _text(text: str) -> str:
    return _ILLEGAL.sub("\ufffd", text)
