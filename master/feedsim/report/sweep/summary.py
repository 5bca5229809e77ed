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
    study, scenario, result = account.study, account.study.base.scenario, account.sensitivities
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
            entry.name: {"keys": list(entry.parameter.keys), "unit": entry.parameter.unit, "words": list(entry.words)}
            for entry in account.inputs
        },
        "figures": {
            output.name: {
                "unit": account.table.unit(output.name),
                "runs": len(output.known),
                "missing": int((account.ok & ~np.isfinite(output.values)).sum()),
                "nominal": finite(output.nominal / output.scale.factor),
                **{key: finite(value / output.scale.factor) for key, value in output.statistics.items()},
                **{
                    f"{key}_interval": _interval(np.asarray(ends) / output.scale.factor)
                    for key, ends in output.quantile_intervals.items()
                },
            }
            for output in account.outputs
        },
        "sobol_indices": {name: _indices(result.parameters, indices) for name, indices in result.sobol.items()},
        "trends": {name: _trends(result.parameters, trend) for name, trend in result.trends.items()},
        "failures": [
            {
                "message": failure.message,
                "count": len(failure.runs),
                "runs": list(failure.runs),
                "where": account.where(failure),
            }
            for failure in account.failures
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


def _indices(names: Sequence[str], indices: Indices) -> dict[str, Any]:
    return {
        "reason": indices.reason,
        "points": indices.used,
        "left_out": indices.left_out,
        "confidence": CONFIDENCE,
        "parameters": {
            name: {
                "first": finite(indices.first[k]),
                "first_interval": _interval(indices.first_interval[k]),
                "total": finite(indices.total[k]),
                "total_interval": _interval(indices.total_interval[k]),
            }
            for k, name in enumerate(names)
        },
    }


def _trends(names: Sequence[str], trends: Trends) -> dict[str, Any]:
    return {
        "reason": trends.reason,
        "runs": trends.used,
        "left_out": trends.left_out,
        "explained": finite(trends.explained),
        "noise": finite(trends.noise),
        "parameters": {
            name: {
                "rank_correlation": finite(trends.rank_correlation[k]),
                "regression": finite(trends.regression[k]),
                "share": finite(trends.share[k]),
            }
            for k, name in enumerate(names)
        },
    }


def _interval(ends: Array) -> list[float] | None:
    return [float(end) for end in ends] if all(map(math.isfinite, ends)) else None
