"""summary.json of a study: statistics of every figure, sensitivities, failures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from feedsim.report.provenance import InputFile, finite, hashed, inputs_part, software
from feedsim.report.style import Array
from feedsim.report.sweep.account import Account
from feedsim.sweep.sensitivity import CONFIDENCE, Indices, Trends

FORMAT = 1


def study_files(account: Account) -> list[InputFile]:
    """Study file, scenario and machine files, data files."""
    study, scenario = account.study, account.study.base.scenario
    named = [("study", study.file)]
    named += [(place or "scenario", path) for place, path in scenario.files]
    named += [("data", path) for path in study.files]
    return hashed(named)


def summary(account: Account, files: Sequence[str], answer: Sequence[str] = ()) -> dict[str, Any]:
    """Content of summary.json; what could not be determined is null. Values are SI, as in the table.

    answer: the lines that the report begins with.
    """
    study, scenario, found = account.study, account.study.base.scenario, account.sensitivities
    return {
        "format": FORMAT,
        "answer": list(answer),
        "warnings": list(account.warnings),
        "study": {
            "name": study.name,
            "file": study.file.name,
            "note": study.note,
            "method": study.sampling.method,
            "seed": study.sampling.seed,
            "overrides": list(study.overrides),
        },
        "scenario": {"name": scenario.name, "file": scenario.file.name, "note": scenario.note},
        "machine": {"name": scenario.machine.name, "note": scenario.machine.note},
        "runs": {"asked": account.design.runs, "done": len(account.table), "failed": account.failed},
        "parameters": {
            each.name: {"keys": list(each.parameter.keys), "unit": each.parameter.unit, "words": list(each.words)}
            for each in account.inputs
        },
        "figures": {
            each.name: {
                "unit": account.table.unit(each.name),
                "runs": len(each.known),
                "missing": int((account.ok & ~np.isfinite(each.values)).sum()),
                "nominal": finite(each.nominal / each.scale.factor),
                **{key: finite(value / each.scale.factor) for key, value in each.statistics.items()},
                **{
                    f"{key}_interval": _interval(np.asarray(ends) / each.scale.factor)
                    for key, ends in each.quantile_intervals.items()
                },
            }
            for each in account.outputs
        },
        "sobol_indices": {name: _indices(found.parameters, each) for name, each in found.sobol.items()},
        "trends": {name: _trends(found.parameters, each) for name, each in found.trends.items()},
        "failures": [
            {"message": each.message, "count": len(each.runs), "runs": list(each.runs), "where": account.where(each)}
            for each in account.failures
        ],
        "inputs": inputs_part(study_files(account)),
        "software": software(),
        "performance": {
            "busy": {"value": account.busy, "unit": "s"},
            "wall_time": {"value": account.wall_time, "unit": "s"},
            "processes": account.processes,
            "efficiency": account.efficiency,
        },
        "files": list(files),
    }


def _indices(names: Sequence[str], found: Indices) -> dict[str, Any]:
    return {
        "reason": found.reason,
        "points": found.used,
        "left_out": found.left_out,
        "confidence": CONFIDENCE,
        "parameters": {
            name: {
                "first": finite(found.first[k]),
                "first_interval": _interval(found.first_interval[k]),
                "total": finite(found.total[k]),
                "total_interval": _interval(found.total_interval[k]),
            }
            for k, name in enumerate(names)
        },
    }


def _trends(names: Sequence[str], found: Trends) -> dict[str, Any]:
    return {
        "reason": found.reason,
        "runs": found.used,
        "left_out": found.left_out,
        "explained": finite(found.explained),
        "noise": finite(found.noise),
        "parameters": {
            name: {
                "rank_correlation": finite(found.rank_correlation[k]),
                "regression": finite(found.regression[k]),
                "share": finite(found.share[k]),
            }
            for k, name in enumerate(names)
        },
    }


def _interval(ends: Array) -> list[float] | None:
    return [float(end) for end in ends] if all(map(math.isfinite, ends)) else None
