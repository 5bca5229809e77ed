"""Studies of axes with another friction law: its archive goes along and decides the rows."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from feedsim.design.sweep.bundle import Bundle
from feedsim.design.sweep.design import design
from feedsim.design.sweep.provenance import fingerprint, parts
from feedsim.design.sweep.study import run
from feedsim.scenario.study import load_study

Write = Callable[..., Path]
VALUES = "sigma_0: 300 N.m/rad, sigma_1: 0.8 N.m.s/rad, sigma_2: 0.006 N.m.s/rad, F_C: 1.6 N.m, F_S: 2.1 N.m"
GMS = f"{{law: gms, {VALUES}, v_s: 0.6 rad/s}}"
LUGRE = f"{{{VALUES}, v_s: 0.6 rad/s}}"
SPREADS = f"""name: Spread of a short move
scenario: short.yaml
sampling: {{method: grid}}
set: {{machine.axes.Z.friction: {GMS}}}
parameters:
  spread: {{key: machine.axes.Z.friction.spread, values: [5, 80]}}
"""
FILES = """name: Laws of a short move
scenario: short.yaml
sampling: {method: grid}
parameters:
  friction: {key: machine.axes.Z.friction, values: [gms.yaml, lugre.yaml]}
"""


def test_its_archive_decides_the_rows(study: Write, fmus: Path, tmp_path: Path) -> None:
    """Another archive of the law that an axis has is another study; of a law that no axis has, it is the same."""
    changed = tmp_path / "fmus"
    shutil.copytree(fmus, changed)
    with (changed / "friction_gms.fmu").open("ab") as file:
        file.write(b"other")
    plain, gms = load_study(study()), load_study(study(SPREADS))
    prints = [fingerprint(parts(each, design(each), at)) for each in (plain, gms) for at in (fmus, changed)]
    assert prints[0] == prints[1]
    assert prints[2] != prints[3]
    assert "friction_gms.fmu" in parts(gms, design(gms), fmus)


@pytest.mark.parametrize("text", [SPREADS, FILES], ids=["values", "laws"])
def test_its_archive_goes_to_workers(study: Write, fmus: Path, tmp_path: Path, text: str) -> None:
    """Also where the law comes with one of the values only."""
    for name, values in (("gms", GMS), ("lugre", LUGRE)):
        (tmp_path / f"{name}.yaml").write_text(values)
    read = load_study(study(text))
    assert "friction_gms.fmu" in Bundle.of(read, fmus).fmus
    table = run(read, tmp_path / "out", workers=1, fmus=fmus)
    assert table.ok.all()
    assert len(set(table["Z.overshoot"])) == 2


def test_without_it_nothing_more_is_sent(study: Write, fmus: Path) -> None:
    assert set(Bundle.of(load_study(study(FILES.partition("sampling")[0] + "sampling: {method: grid}\nparameters: "
        "{K_v: {key: machine.axes.Z.drive.K_v, values: [3 (m/min)/mm]}}\n")), fmus).fmus) == {
        "plant.fmu", "controller.fmu", "friction.fmu",
    }  # fmt: skip
