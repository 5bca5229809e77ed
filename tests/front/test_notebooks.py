"""The notebooks that come along: kept without outputs, and every cell runs, with less to compute."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

import feedsim as fs
from feedsim.jobs.examples import examples

pytestmark = pytest.mark.extensive

NOTEBOOKS = {each.name: each.file for each in examples() if each.kind == "notebook"}
# In place of the cell "parameters".
REDUCED = {
    "first_circle": {"changes": {"motions.0.radius": "2 mm", "motions.0.direction": "counterclockwise"}},
    "your_machine": {"gains": ["4 (m/min)/mm"]},
    "friction_from_traces": {
        "changes": {"motions.2.speeds.count": 4, "motions.1.duration": "1 s", "motions.2.duration": "1 s"}
    },
    "units_in_your_simulator": {"stop_time": 0.05, "changes": {}},
    "a_study": {"runs": 1, "workers": 1},
}
# What a notebook is there to show: text that one of its outputs holds.
SHOWN = {
    "first_circle": "circular deviation G",
    "your_machine": "machine.axes.X.drive.K_v: '4 mm'",
    "friction_from_traces": "F_C ",
    "units_in_your_simulator": "same",
    "a_study": "'of', 1",
}


def cells(name: str) -> list[dict[str, Any]]:
    return list(json.loads(NOTEBOOKS[name].read_text(encoding="utf-8"))["cells"])


def shown(value: object) -> str:
    """As a notebook shows it."""
    html, text = getattr(value, "_repr_html_", None), repr(value)
    picture = getattr(value, "_repr_png_", None)
    assert picture is None or picture().startswith(b"\x89PNG")
    return text if html is None else f"{text}\n{html()}"


def test_there_are_the_five() -> None:
    assert NOTEBOOKS.keys() == REDUCED.keys()


@pytest.mark.parametrize("name", REDUCED)
def test_is_kept_without_outputs(name: str) -> None:
    for cell in cells(name):
        assert cell["cell_type"] == "markdown" or (cell["outputs"], cell["execution_count"]) == ([], None)


@pytest.mark.parametrize("name", REDUCED)
def test_every_cell_runs(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    mpl.use("agg")
    assert fs.example(name) == [Path("notebooks") / f"{name}.ipynb"]
    names: dict[str, Any] = {"__name__": "__main__"}
    said = []
    for cell in cells(name):
        if cell["cell_type"] == "markdown":
            continue
        statements = ast.parse("".join(cell["source"])).body
        last = statements.pop() if isinstance(statements[-1], ast.Expr) else None
        exec(compile(ast.Module(statements, []), name, "exec"), names)
        if cell["metadata"].get("tags") == ["parameters"]:
            assert REDUCED[name].keys() == {each.targets[0].id for each in statements}  # type: ignore[attr-defined]
            names |= REDUCED[name]
        if isinstance(last, ast.Expr):
            said.append(shown(eval(compile(ast.Expression(last.value), name, "eval"), names)))
    output = "\n".join([*said, capfd.readouterr().out])
    assert SHOWN[name] in output
    assert not re.search(r"\bnan\b", output), "a value that was not found"
