"""The documents: links lead somewhere, and the README's figures are those of a run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from feedsim import analysis, cosim, scenario

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = sorted(
    path
    for pattern in ("*.md", "docs/*.md", "src/*/README.md", "fmus/*.md", "tests/**/README.md")
    for path in ROOT.glob(pattern)
)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_relative_links_exist(document: Path) -> None:
    for target in re.findall(r"\]\(([^)#\s]+)", document.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (document.parent / target).exists(), f"{document.name} links to {target}"


def test_figures_of_the_readme(fmus: Path) -> None:
    """Every number of the README's table of figures, to the digits it is written with."""
    runs = {
        "Z, ": cosim.run(scenario.load(ROOT / "scenarios" / "z_positioning.yaml"), fmus=fmus),
        "X-Z": cosim.run(scenario.load(ROOT / "scenarios" / "xz_circle.yaml"), fmus=fmus),
        "pure": cosim.run(
            scenario.load(ROOT / "scenarios" / "xz_circle.yaml", ["machine.axes.*.friction.W=0 rad"]), fmus=fmus
        ),
    }
    found = {name: analysis.evaluate(run) for name, run in runs.items()}
    expected = [
        found["Z, "]["Z.overshoot"].value,
        found["Z, "]["Z.settling_time"].value,
        found["Z, "]["Z.ringing_frequency"].value,
        found["X-Z"]["XZ.G"].value,
        found["X-Z"]["XZ.glitch_X"].value,
        found["X-Z"]["XZ.glitch_Z"].value,
        found["pure"]["XZ.glitch_X"].value,
        found["pure"]["XZ.glitch_Z"].value,
    ]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    table = readme[readme.index("| figure | value |") :].split("\n\n")[0]
    written = re.findall(r"\d+(?:\.\d+)?", " ".join(row.split("|")[2] for row in table.splitlines()[2:]))
    assert len(written) == len(expected)
    for text, value in zip(written, expected, strict=True):
        assert text == f"{value:.{len(text.partition('.')[2])}f}"
