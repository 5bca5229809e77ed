"""The page: one file of HTML that asks nobody for anything. All text of a scenario is escaped.

What a viewer without scripts shows is the scenario as it is written: still pictures, and the table of figures.
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from html import escape
from importlib import resources
from itertools import groupby
from pathlib import Path
from typing import Any

from feedsim.analysis import CircleTask, Diagnosis, Figure, PositioningTask, evaluate, tasks
from feedsim.analysis.circle import describe_vibrations, explain_circle
from feedsim.analysis.evaluate import cause_figures
from feedsim.files.trace.files import written_whole
from feedsim.foundation.errors import InputError
from feedsim.report.content import Picture, Table
from feedsim.report.formatting import PALETTE, display_unit, duration, figure_text, typeset
from feedsim.report.live_page.content import Content, content, pack_bytes
from feedsim.report.page import drawing_script, style
from feedsim.report.run.axis_plots import contour_picture, positioning_picture, torque_picture
from feedsim.report.run.pose import diagnosis_section
from feedsim.simulation.judge import JudgedRun

# --- The scripts and styles of a page: what computes, for a worker, and what shows, for the page itself ---------------


COMPUTING_SCRIPTS = ("packed.js", "unit.js", "plan.js", "figures.js", "warnings.js", "bode.js", "work.js")
SHOWING_SCRIPTS = ("packed.js", "figures.js", "signs.js", "pictures.js", "lessons.js", "page.js")


@cache
def computing_script() -> str:
    """Unit, planner, figures: without anything of a browser, so that node runs it as well."""
    return "".join(text(name) for name in COMPUTING_SCRIPTS)


@cache
def worker() -> str:
    """The worker's script."""
    return '"use strict";\n' + _without_comments(computing_script() + text("worker.js"))


@cache
def showing_script() -> str:
    """The page's own script: charts of reports, and what is about knobs."""
    script = drawing_script() + "".join(text(name) for name in SHOWING_SCRIPTS)
    return '"use strict";\n(() => {\n' + _without_comments(script) + "})();\n"


def styles() -> str:
    """The style sheet: that of reports, and the page's own."""
    return style() + text("page.css")


def text(name: str) -> str:
    """A file of the template folder."""
    return (resources.files("feedsim.report.live_page") / "template" / name).read_text(encoding="utf-8")


def _without_comments(script: str) -> str:
    """Without the lines that are comments alone, which are for readers of the sources: pages travel by mail."""
    return "".join(line for line in script.splitlines(keepends=True) if not line.lstrip().startswith("//"))


# With a plant of thousands of modes or a grid of poses; a mail takes it, and a phone.
MAX_PAGE_BYTES = 1_500_000  # bytes
MARK = b'content="feedsim export"'


def write(run: JudgedRun, out: Path, wanted: Sequence[str] = (), fmus: Path | None = None) -> int:
    """Write the page of a run's scenario, whole or not at all; returns its size [bytes].

    wanted, fmus: as for :func:`page`. Raises InputError as that, and OutputError: `out` cannot be written.
    """
    content = page(run, wanted, fmus)
    with written_whole(out) as file:
        file.write(content)
    return len(content)


def page(run: JudgedRun, wanted: Sequence[str] = (), fmus: Path | None = None) -> bytes:
    """The page of a run's scenario.

    wanted: patterns of the knobs, see :func:`feedsim.report.live_page.content.chosen`. fmus: folder of archives and
        module.

    Raises InputError: there is no such page (:func:`feedsim.report.live_page.content.content`), or it is too large.
    """
    content = html(run, wanted, fmus).encode()
    if len(content) > MAX_PAGE_BYTES:
        raise InputError(
            f"{run.scenario.file}: its page takes {len(content) / 1e6:.3g} MB; allowed are {MAX_PAGE_BYTES / 1e6:g} "
            "MB: "
            "take fewer modes (feedsim machine build), no grid of poses, or shorter motions that a page does not plan"
        )
    return content


def html(run: JudgedRun, wanted: Sequence[str] = (), fmus: Path | None = None) -> str:
    """The text of the page; arguments and errors as for :func:`page`."""
    contents = content(run.scenario, run.program, wanted, fmus)
    scenario, machine = run.scenario, run.scenario.machine
    shown_tasks = [task for task in tasks(scenario, run.program) if isinstance(task, CircleTask | PositioningTask)]
    moved = [axis for axis in machine.axes if any(axis in segment.axes for segment in run.program.segments)]
    figures = _computed_figures(run, shown_tasks)
    planes = [list(task.turn.axes) for task in shown_tasks if isinstance(task, CircleTask)]
    data = contents.data | {
        "axes": list(machine.axes), "moved": moved, "plane": planes[0] if planes else None,
        "signs": contents.data["machine"]["signs"], "written": _figures_as_written(figures),
    }  # fmt: skip
    # The axis whose loop is shown at first stands last: that of the circle's ordinate, or the one that moves.
    order = [axis for axis in machine.axes if axis not in moved] + moved
    script, cycle = showing_script(), f"control cycle {duration(machine.cycles.T_c)}"
    parts = {
        "policy": _policy(script),
        "title": escape(scenario.name),
        "style": styles(),
        "machine": escape(f"{machine.name}: axes {', '.join(machine.axes)}; {cycle}"),
        "notes": "\n".join(f'<p class="note">{escape(note)}</p>' for note in _notes(run, contents)),
        "knobs": "\n".join(_groups(contents.data["knobs"])),
        "pictures": "\n".join(_pictures(run, shown_tasks)),
        "axes": "".join(f"<option{' selected' * (axis == order[-1])}>{escape(axis)}</option>" for axis in order),
        "keys": "".join(_keys(shown_tasks, figures)),
        "figures": _table(figures),
        "footer": _footer(contents),
        "worker": pack_bytes(worker().encode()),
        "script": script,
        "charts": _json({"charts": {}, "arrays": [], "palette": {n: c for n, c, _ in PALETTE} | {"ground": "#ffffff"}}),
        "data": _json(data | {"axes": order}),
    }
    return re.sub(r"\{(\w+)\}", lambda match: parts[match[1]], text("page.html"))


def _policy(script: str) -> str:
    """This script and no other, its worker and the module within; nobody is asked for anything."""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
    return (
        "default-src 'none'; style-src 'unsafe-inline'; img-src data: blob:; worker-src blob:; "
        f"script-src 'sha256-{digest}' 'wasm-unsafe-eval'"
    )


def _json(data: Mapping[str, Any]) -> str:
    """For an element of the page: nothing in it ends the element."""
    written = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return written.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _notes(run: JudgedRun, contents: Content) -> Iterable[str]:
    yield from filter(None, [run.scenario.machine.note, run.scenario.note])
    if contents.left_out:
        yield "Not in this page: " + "; ".join(contents.left_out) + "."
    if run.warnings:
        yield "As written, a run warns: " + "; ".join(map(str, run.warnings)) + "."


def _groups(knobs: Sequence[Mapping[str, Any]]) -> Iterable[str]:
    numbered = list(enumerate(knobs))
    for group, members in groupby(numbered, key=lambda entry: entry[1]["group"]):
        rows = "\n".join(_row(k, knob) for k, knob in members)
        yield f"<fieldset><legend>{escape(group)}</legend>\n{rows}\n</fieldset>"


def _row(k: int, knob: Mapping[str, Any]) -> str:
    unit = f" [{display_unit(knob['shown'])}]" if display_unit(knob["shown"]) else ""
    name, about = escape(f"{knob['name']}{unit}"), escape(str(knob["text"]))
    label = escape(f"{knob['group']}, {knob['name']}: {knob['text']}", quote=True)
    if knob["choices"]:
        options = "".join(f"<option>{escape(choice)}</option>" for choice in knob["choices"])
        control = f'<select id="value-{k}" aria-label="{label}">{options}</select>'
    else:
        control = (
            f'<input type="range" min="0" max="400" step="1" aria-label="{label}, slider">'
            f'<input type="number" id="value-{k}" step="any" aria-label="{label}">'
        )
    back = f'<button type="button" aria-label="{label}: back to the scenario\'s value" title="back">↺</button>'
    return f'<div class="knob" id="knob-{k}"><label for="value-{k}"><b>{name}</b> {about}</label>{control}{back}</div>'


def _computed_figures(run: JudgedRun, shown_tasks: Sequence[CircleTask | PositioningTask]) -> dict[str, Figure]:
    """Figures that a page computes, too: without those of causes."""
    causes = {task.prefix: task.diagnosis(run.trace) for task in shown_tasks if isinstance(task, CircleTask)}
    left_out = {f"{prefix}.{name}" for prefix, found in causes.items() if found for name in cause_figures(found)}
    return {name: figure for name, figure in evaluate(run).items() if name not in left_out}


def _pictures(run: JudgedRun, shown: Sequence[CircleTask | PositioningTask]) -> Iterable[str]:
    signs = {name: axis.display_sign for name, axis in run.scenario.machine.axes.items()}
    for task in shown:
        end = _slug(task.prefix)
        if isinstance(task, CircleTask):
            diagnosis = task.diagnosis(run.trace)
            if diagnosis is not None:
                yield _explain_circle(task.prefix, end, diagnosis)
            yield _figure(contour_picture(run.trace, task.turn, f"contour-{end}", task.back, diagnosis))
            if (torque := torque_picture(run.trace, task.turn, signs, f"torque-{end}")) is not None:
                yield _figure(torque, bare=True)
        else:
            stop = positioning_picture(
                run.trace, task.approach, task.figures(run.trace), f"stop-{end}", band=task.band,
                torque_sign=signs[task.approach.axis],
            )  # fmt: skip
            yield _figure(stop)


def _slug(prefix: str) -> str:
    return re.sub(r"[^A-Za-z0-9]+", "-", prefix)


def _explain_circle(prefix: str, end: str, diagnosis: Diagnosis) -> str:
    """Why a circle is not round, of the scenario as written: the answer, and a row for every cause."""
    table = next(part for part in diagnosis_section(prefix, diagnosis).parts if isinstance(part, Table))
    kinds = {"l": "", "r": ' class="number"', "p": ' class="meaning"'}
    marks = [kinds[letter] for letter in table.columns]
    heads = "".join(f'<th scope="col"{mark}>{escape(head)}</th>' for mark, head in zip(marks, table.heads, strict=True))
    rows = "".join(
        f"<tr>{''.join(f'<td{mark}>{escape(str(cell))}</td>' for mark, cell in zip(marks, row, strict=True))}</tr>"
        for row in table.rows
    )
    words = typeset(" ".join(filter(None, [explain_circle(diagnosis), describe_vibrations(diagnosis)])))
    return (
        f'<section id="why-{end}" aria-labelledby="why-head-{end}"><h2 id="why-head-{end}">{escape(prefix)}: why the '
        f'circle is not round, as written</h2><p class="answer">{escape(words[:1].upper() + words[1:])}</p>'
        '<details><summary>All causes, their amounts and shares</summary><div class="scroll"><table>'
        f"<thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div></details></section>"
    )


def _figure(picture: Picture, *, bare: bool = False) -> str:
    """bare: without a still picture, which would make the page half as large again."""
    kept = "" if bare or picture.chart is None else picture.svg
    title = escape(picture.title)
    return (
        f'<figure id="{picture.stem}"{" class=needs" * bare} data-title="{title}"><h2>{title}</h2>'
        f'<div class="scroll still">{kept}</div></figure>'
    )


def _keys(shown_tasks: Sequence[CircleTask | PositioningTask], figures: Mapping[str, Figure]) -> Iterable[str]:
    """What one looks at first: a tile for each of few figures, as written; the page writes what they are now."""
    for task in shown_tasks:
        if isinstance(task, CircleTask):
            words = {"G": "circular deviation G"}
            words |= {f"glitch_{axis}": f"quadrant glitch where {axis} reverses" for axis in task.turn.axes}
            words |= {"G_b": "G(b), both directions"} if task.back is not None else {}
        else:
            axis = task.approach.axis
            words = {"overshoot": f"overshoot of {axis}", "settling_time": f"settling time of {axis}",
                     "peak_torque": f"largest torque of {axis}"}  # fmt: skip
        for name, meaning in words.items():
            key = f"{task.prefix}.{name}"
            value = " ".join(filter(None, figure_text(figures[key])))
            yield (
                f'<div class="key" data-figure="{escape(key, quote=True)}"><b>{escape(value)}</b>'
                f'<span>{escape(meaning)}<br><small class="needs">as written {escape(value)}</small></span></div>'
            )


def _figures_as_written(figures: Mapping[str, Figure]) -> dict[str, tuple[float | None, str]]:
    """Figures of the scenario as written, for the page's comparisons."""
    return {
        name: (figure.value if math.isfinite(figure.value) else None, figure.unit) for name, figure in figures.items()
    }


def _table(figures: Mapping[str, Figure]) -> str:
    rows = "".join(
        f'<tr{_secondary_class(name)}><th scope="row">{escape(name)}</th><td '
        f'class="number">{escape(str(figure))}</td></tr>'
        for name, figure in figures.items()
    )
    head = '<th scope="col">figure</th><th scope="col" class="number">as written</th>'
    return f"<thead><tr>{head}</tr></thead><tbody>{rows}</tbody>"


def _secondary_class(name: str) -> str:
    """Of figures that many others stand for: of the tool point, of the other direction, of one quadrant."""
    more = ".tool." in name or ".clockwise." in name or re.search(r"\.glitch_.*[+-]$", name)
    return ' class="more"' if more else ""


def _footer(contents: Content) -> str:
    return (
        f"feedsim; the unit machine {escape(str(contents.data['guid']))}, WebAssembly module SHA-256 "
        f"<code>{contents.sha256}</code>. It computes here, and nothing leaves this page."
    )
