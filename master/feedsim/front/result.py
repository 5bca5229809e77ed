"""A run with its figures, for a person at a prompt or in a notebook."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from feedsim import analysis
from feedsim.analysis import Figure
from feedsim.cosim import Run
from feedsim.findings import ranked, severity
from feedsim.report import run as report
from feedsim.report.formatting import shown, typeset
from feedsim.report.picture import Picture
from feedsim.report.run.report import HEADER, draw, is_leading
from feedsim.report.run.signals import signals_picture
from feedsim.trace import Array

if TYPE_CHECKING:
    import pandas


class Result(Run):
    """What a run leaves behind, with its figures, pictures and files.

    >>> import feedsim as fs
    >>> result = fs.run("z_positioning.yaml")
    >>> result  # doctest: +ELLIPSIS
    Result of 'Z positioning': 2.448 s, 9793 rows, 66 columns; Z.duration 1.247 s, Z.overshoot 3.13... um, ...
    >>> float(result["Z.x_a"][-1].round(6))
    0.2
    """

    @classmethod
    def of(cls, run: Run) -> Result:
        """A run, as it is."""
        return cls(**vars(run))

    @cached_property
    def figures(self) -> Mapping[str, Figure]:
        """Name -> figure, such as "XZ.G", as the scenario's `evaluate` asks for them."""
        return analysis.evaluate(self)

    @cached_property
    def causes(self) -> Mapping[str, analysis.Diagnosis]:
        """Prefix of a circle's figures -> why it is not round."""
        return analysis.diagnoses(self)

    @cached_property
    def pictures(self) -> tuple[Picture, ...]:
        """All pictures of the report."""
        return tuple(draw(self, self.figures))

    def __getitem__(self, name: str) -> Array:
        """A recorded signal in SI units, such as ``result["Z.x_a"]``."""
        return self.trace[name]

    def plot(self, *signals: str) -> Picture:
        """The main picture of the report, or signals over time: ``result.plot("Z.x_a", "Z.M_fr")``, also "Z.*".

        A notebook shows it; ``.save("circle.png")`` or ``.save("circle.svg")`` writes it.
        """
        if signals:
            return signals_picture(self.trace.select(signals), self.scenario.name)
        return self.pictures[0] if self.pictures else signals_picture(self.trace.select(["*.x_a"]), self.scenario.name)

    def to_pandas(self) -> pandas.DataFrame:
        """All recorded signals over time [s]; their units are in ``.attrs["units"]``. Needs the package pandas."""
        return self.trace.to_pandas()

    def save(self, directory: str | Path) -> tuple[Path, ...]:
        """Write what ``feedsim run`` leaves: result.csv, summary.json, report.html, figures. Returns the paths."""
        report.check_writable(Path(directory), report.input_paths(self.scenario))
        return report.write(self, self.figures, directory)

    def __repr__(self) -> str:
        figures = [f"{name} {figure}" for name, figure in self._leading().items()][:4]
        wrong = [each for each in self.warnings if severity(each) != "note"]
        told = [f"{len(wrong)} warning{'s'[: len(wrong) != 1]}, see .warnings"] if wrong else []
        return "; ".join(
            [
                f"Result of {self.scenario.name!r}: {self.program.duration:.4g} s, {len(self.trace)} rows, "
                f"{len(self.trace.names)} columns",
                *([", ".join(figures)] if figures else []),
                *told,
            ]
        )

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><th style='text-align:left'>{escape(name)}</th>"
            f"<td style='white-space:nowrap'>{escape(' '.join(shown(figure)))}</td>"
            f"<td style='text-align:left'>{escape(typeset(figure.meaning))}</td></tr>"
            for name, figure in self._leading().items()
        )
        said = "".join(f"<li>{escape(typeset(each))}</li>" for each in ranked(self.warnings))
        answer = "".join(f"<p>{escape(typeset(each))}</p>" for each in report.answers(self, self.figures, self.causes))
        plot = self.plot()
        alt = escape(f"{plot.title}. {plot.caption}", quote=True)
        picture = f"<img alt='{alt}' style='max-width:100%' src='data:image/png;base64,{_text(plot.png)}'>"
        machine = self.scenario.machine
        note = f"<p><small>{escape(machine.note)}</small></p>" if machine.note else ""
        return (
            f"<b>{escape(self.scenario.name)}</b> · {escape(machine.name)}, {self.program.duration:.4g} s{answer}"
            f"<table>{rows}</table>{f'<ul>{said}</ul>' if said else ''}{picture}{note}"
        )

    def _leading(self) -> dict[str, Figure]:
        return {name: figure for name, figure in self.figures.items() if is_leading(name, HEADER)}

    def __dir__(self) -> list[str]:
        return [name for name in super().__dir__() if not name.startswith("_") or name.startswith("__")]


def _text(content: bytes) -> str:
    return b64encode(content).decode("ascii")
