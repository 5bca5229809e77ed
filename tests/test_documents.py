"""The documents: links lead somewhere, and the README's figures are those of a run."""

from __future__ import annotations

import re
import shlex
import subprocess
from pathlib import Path

import pytest

from feedsim import analysis, cli, scenario
from feedsim.simulation import cosim, ssp
from feedsim.simulation.judge import judge_run

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


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_prose_has_lines_that_an_editor_shows(document: Path) -> None:
    """Tables and what programs print have none to break."""
    prose = re.sub(r"^( *)```.*?^\1```", "", document.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    assert not [line for line in prose.splitlines() if len(line) > 200 and not line.lstrip().startswith("|")]


def test_no_document_names_a_registry_of_packages() -> None:
    """What a tool is, its own project says; where one gets it from is everybody's own."""
    hosts = r"pypi\.org|pythonhosted\.|npmjs\.|crates\.io|golang\.org/dl|repo1?\.maven|anaconda\.org"
    kinds = ("*.md", "*.py", "*.c", "*.h", "*.toml", "*.lock", "*.yaml", "Makefile")
    listed = subprocess.run(["git", "ls-files", *kinds], cwd=ROOT, capture_output=True, text=True).stdout.split()
    found = [name for name in listed if re.search(hosts, (ROOT / name).read_text(encoding="utf-8"))]
    assert found in ([], ["tests/test_documents.py"])


def test_the_walk_through_the_house_meets_files_that_are_there() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([\w.*]+(?:/[\w.*]*)+|\w+\.py)`", page))
    assert len(named) > 50
    for name in named:
        assert any(any(base.glob(name)) for base in (ROOT, ROOT / "master" / "feedsim")), name


def test_commands_of_the_page_on_ssp_files(fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What they run is only opened, with what they set; one file, the smaller one, serves all."""
    page = (ROOT / "docs" / "ssp.md").read_text(encoding="utf-8")
    commands = [shlex.split(found) for found in re.findall(r"(?m)(?:^|`)feedsim ((?:export|run) [^`\n]*)", page)]
    assert {command[0] for command in commands} == {"export", "run"}
    assert sum("--set" in command for command in commands) == 2
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenarios").symlink_to(ROOT / "scenarios", target_is_directory=True)
    written = tmp_path / "z_positioning.ssp"
    assert cli.main(["export", "scenarios/z_positioning.yaml", "--out", str(written)]) == 0
    for command in commands:
        options = cli.parser().parse_args(command)
        if command[0] == "export":
            scenario.load(options.subject, vars(options).get("set", ()))
            options.out.symlink_to(written)
            continue
        if options.scenario.name == "x.ssp":  # what the page calls any such file
            options.scenario = written
        with ssp.open_system(options.scenario, vars(options).get("set", ())) as found:
            assert found.scenario.machine.axes


def test_figures_of_the_readme(fmus: Path) -> None:
    """Every number of the README's table of figures, to the digits it is written with."""
    runs = {
        "Z, ": judge_run(cosim.run(scenario.load(ROOT / "scenarios" / "z_positioning.yaml"), fmus=fmus)),
        "X-Z": judge_run(cosim.run(scenario.load(ROOT / "scenarios" / "xz_circle.yaml"), fmus=fmus)),
        "pure": judge_run(
            cosim.run(
                scenario.load(ROOT / "scenarios" / "xz_circle.yaml", ["machine.axes.*.friction.W=0 rad"]), fmus=fmus
            )
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
