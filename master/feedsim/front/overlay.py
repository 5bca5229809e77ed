"""Results and records over each other, at a prompt and in a notebook."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from html import escape
from pathlib import Path

from feedsim import cosim
from feedsim.analysis import Figure
from feedsim.analysis.alignment import aligned
from feedsim.analysis.side_by_side import Source, differing, named_apart, read_sources
from feedsim.errors import InputError
from feedsim.front.result import Result
from feedsim.owned import TemporaryFolder
from feedsim.report import page
from feedsim.report import show as report
from feedsim.report.picture import Picture
from feedsim.report.show.pictures import pictures_of
from feedsim.report.show.report import files_of, report_of
from feedsim.sweep.case import case, scenario_of

Shown = str | Path | Result
HEIGHT = 900  # [px] of a report in a notebook; it scrolls


class Overlay:
    """Results and records over each other: what :func:`feedsim.show` returns.

    Attributes:
        names: of the results, in their order.

    >>> import feedsim as fs
    >>> over: fs.Overlay = fs.show(fs.run("z_positioning.yaml"))
    >>> over.names
    ('Z positioning',)
    """

    def __init__(self, results: Mapping[str, Shown]) -> None:
        """results: name -> a result, its folder, or a CSV file. Raises InputError: nothing, or what is no result."""
        if not results:
            raise InputError("nothing can be shown: no result is given")
        self.names = tuple(results)
        # The report reads results from where they are written; those of a prompt are written for as long as this lives.
        self._folder = TemporaryFolder()
        paths = [_at(each, self._folder.path / str(k)) for k, each in enumerate(results.values())]
        found = zip(self.names, read_sources(paths), strict=True)
        self._sources = aligned([replace(source, name=name) for name, source in found])

    @property
    def figures(self) -> dict[str, tuple[Figure | None, ...]]:
        """Name -> the figure of every result; None where it has none of that name."""
        names = dict.fromkeys(name for source in self._sources for name in source.figures)
        return {name: tuple(_figure(source, name) for source in self._sources) for name in names}

    @property
    def parameters(self) -> dict[str, tuple[str, ...]]:
        """Parameters in which the results differ: name -> the value of every result, "" of records."""
        return {name: tuple(values) for name, values in differing(self._sources)}

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """Contours, following errors, torques, ..., over each other."""
        return tuple(pictures_of(self._sources))

    @property
    def lines(self) -> list[str]:
        """What ``feedsim show`` says: parameters that differ, leading figures, how all was aligned."""
        return report.lines(self._sources)

    @property
    def files(self) -> list[Path]:
        """The files that the results are read from."""
        return files_of(self._sources)

    def save(self, directory: str | Path, *, drawn: Sequence[str] = ()) -> tuple[Path, ...]:
        """Write what ``feedsim show`` leaves; drawn: kinds of its figures, png and svg. Returns the paths."""
        report.check_writable(Path(directory), self.files)
        return report.write(self._sources, directory, drawn=drawn)

    def __repr__(self) -> str:
        return "\n".join([f"Overlay of {', '.join(self.names)}", *self.lines])

    def _repr_html_(self) -> str:
        inside = escape(page.html(report_of(self._sources)), quote=True)
        return f"<iframe style='width:100%;height:{HEIGHT}px;border:0' srcdoc=\"{inside}\"></iframe>"


def show(*results: Shown, **named: Shown) -> Overlay:
    """Lay results over each other: what :func:`run` returned, folders of ``feedsim run``, CSV files with a time.

    A run of a study is named by its folder and its number or what is least or largest: "results/z_stop:17",
    "results/z_stop:max=Z.overshoot". named: results under names of your own; the others are called by their scenario or
    file.

    >>> import feedsim as fs
    >>> now = fs.run("z_positioning.yaml")
    >>> stiff = fs.run("z_positioning.yaml", set={"machine.axes.Z.drive.K_v": "5 (m/min)/mm"})
    >>> over = fs.show(now=now, stiff=stiff)
    >>> over.parameters["machine.axes.Z.drive.K_v"]
    ('66.6666667 1/s', '83.3333333 1/s')
    """
    given: dict[str, Shown] = {}
    files = list(dict.fromkeys(str(each) for each in results if not isinstance(each, Result)))
    names = dict(zip(files, named_apart([Path(each) for each in files]), strict=True))
    for each in results:
        plain = each.scenario.name if isinstance(each, Result) else _called(str(each), names[str(each)])
        same = sum(re.fullmatch(rf"{re.escape(plain)}( \(\d+\))?", name) is not None for name in given)
        given[f"{plain} ({same + 1})" if same else plain] = each
    for name, each in named.items():
        if name in given:
            raise InputError(f"two results are called {name!r}; give one of them another name")
        given[name] = each
    return Overlay(given)


def _called(text: str, name: str) -> str:
    chosen = case(text)
    return name if chosen is None else chosen.name


def _at(each: Shown, folder: Path) -> Path:
    """Where a result stands; one of the prompt, and a run of a study, is written there."""
    if not isinstance(each, Result):
        chosen = case(str(each))
        if chosen is None:
            return Path(each)
        scenario, fmus = scenario_of(chosen)
        each = Result.of(cosim.run(scenario, fmus=fmus))
    each.save(folder)
    return folder


def _figure(source: Source, name: str) -> Figure | None:
    return Figure(*source.figures[name], "") if name in source.figures else None
