"""Where a study's numbers come from: its files, versions, seed, command and times."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from feedsim.report.provenance import InputFile, hashed, software
from feedsim.report.sweep.account import Account
from feedsim.report.tables import files_table, pairs_table, parameters_table


def study_files(account: Account) -> list[InputFile]:
    """Study file, scenario and machine files, data files."""
    study, scenario = account.study, account.study.base.scenario
    named = [("study", study.file)]
    named += [(place or "scenario", path) for place, path in scenario.files]
    named += [("data", path) for path in study.files]
    return hashed(named)


def provenance_section(account: Account) -> str:
    """The tables at the end of the page."""
    study, scenario = account.study, account.study.base.scenario
    sampling = study.sampling
    rows = [
        ("Study", f"{study.name} ({study.file.name})"),
        ("Scenario", f"{scenario.name} ({scenario.file.name})"),
        ("Set on the command line", ", ".join(study.overrides) or "nothing"),
        ("Sampling", f"{sampling.method}, {account.design.runs} runs, seed {sampling.seed}"),
        ("Machine", scenario.machine.name),
        *_told(account.record),
        ("Software of this page", ", ".join(f"{name} {text}" for name, text in software().items())),
    ]
    parts = [
        '<section class="provenance">\n<h2>Where the numbers come from</h2>',
        pairs_table(rows),
        files_table(study_files(account)),
        parameters_table(scenario.machine),
        '<p class="muted">The parameters are the scenario\'s; each run changes those above.</p>',
        "</section>",
    ]
    return "\n".join(parts)


def _told(provenance: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """What the table says of how it was made."""
    words = {
        "command": "Command", "workers": "Made by", "began": "Began", "ended": "Ended", "machine": "Computer",
        "versions": "Software of the runs", "fingerprint": "Fingerprint",
    }  # fmt: skip
    for key, name in words.items():
        value = provenance.get(key)
        if value in (None, "", {}, []):
            continue
        if isinstance(value, Mapping):
            yield name, ", ".join(f"{part} {text}" for part, text in value.items())
        elif isinstance(value, list):
            yield name, " ".join(str(part) for part in value)
        else:
            yield name, str(value)
    parts = provenance.get("parts")
    if isinstance(parts, Mapping):
        yield from ((f"Hash of {part}", str(text)) for part, text in parts.items() if isinstance(text, str))
