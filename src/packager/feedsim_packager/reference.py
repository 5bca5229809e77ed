"""Pinned reference results of a unit -> what an archive carries of them below extra/ (FMI layered standard FMI-LS-REF).

The files are those of tests/reference/<unit>, taken as they are; what comes to them here: a manifest, the list of
experiments, parameters as SSP parameter sets. Cases that replace a resource (<case>_modes.csv) stay at home, since
their file would have to be named by a path that only the importer knows.
"""

import csv
import io
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

from .documentation import REFERENCES as PAGE
from .errors import InputError
from .variables import Variable

ROOT = "extra/org.fmi-standard.fmi-ls-ref/"
HELD = "held/"
MANIFEST, EXPERIMENTS, README = "fmi-ls-manifest.xml", "experiments.exp", "README.md"
GUIDE = "integrators.md"  # what every unit's README goes on with, beside the units' folders
NAME, VERSION = "org.fmi-standard.fmi-ls-ref", "1.0.0-alpha.1"
DESCRIPTION = "Layered Standard providing information on related files included in an FMU."
_XML = '<?xml version="1.0" encoding="UTF-8"?>\n'
_SSP = "http://ssp-standard.org/SSP1/SystemStructure"
_OPTIONS = {"StartTime": "startTime", "StopTime": "stopTime", "StepSize": "stepSize"}


@dataclass(frozen=True)
class _Case:
    """A case by its name, what it is about, and its attributes of time as written."""

    name: str
    about: str
    times: Mapping[str, str]


def files(directory: Path, variables: Iterable[Variable]) -> dict[str, bytes]:
    """Path in the archive -> content, of the references in `directory`; nothing where there is no such folder.

    Raises InputError for a case that README.md does not name, or that sets a parameter that is none.
    """
    if not directory.is_dir():
        return {}
    away = {path.name.removesuffix("_modes.csv") for path in directory.glob("*_modes.csv")}
    result: dict[str, bytes] = {}
    for path in sorted(directory.rglob("*")):
        stem = re.sub(r"_(in|ref|par|modes)(\.tolerances|\.bounds)?\.(csv|opt|yaml)$", "", path.name)
        if path.is_file() and stem not in away and path.suffix in (".csv", ".opt", ".yaml", ".md"):
            result[path.relative_to(directory).as_posix()] = path.read_bytes()
    if README not in result:
        raise InputError(f"{directory}: has no {README}, which tells importers what the references are")
    result[README] += (directory.parent / GUIDE).read_bytes()
    cases = [_case(name, result, directory) for name in _names(result)]
    kinds = {variable.name: variable.row.kind for variable in variables}
    for case in cases:
        if parameters := result.get(f"{case.name}_par.csv"):
            result[f"{case.name}_par.ssv"] = _parameter_set(case, parameters, kinds, directory)
    result[EXPERIMENTS] = _experiments(cases, result)
    result[MANIFEST] = _manifest(cases, result)
    return {ROOT + path: content for path, content in result.items()}


def without(archive: Mapping[str, bytes]) -> dict[str, bytes]:
    """The files of an archive less its references, which are of one machine."""
    return {path: content for path, content in archive.items() if not path.startswith(ROOT) and path != PAGE}


def _names(result: Mapping[str, bytes]) -> list[str]:
    return sorted(path.removesuffix("_ref.opt") for path in result if path.endswith("_ref.opt"))


def _case(name: str, result: Mapping[str, bytes], directory: Path) -> _Case:
    """The case with its line of the README's table: | `name` | what it is about |"""
    text = result[README].decode("utf-8")
    line = re.search(rf"^\| `{re.escape(name)}` \| (.+?) \|$", text, re.MULTILINE)
    if not line:
        raise InputError(f"{directory / README}: its table has no row of the case '{name}' (| `{name}` | ... |)")
    options = dict(row.split(",") for row in result[f"{name}_ref.opt"].decode("ascii").split())
    return _Case(name, line[1].replace("`", ""), {_OPTIONS[key]: options[key] for key in _OPTIONS})


def _parameter_set(case: _Case, parameters: bytes, kinds: Mapping[str, str], directory: Path) -> bytes:
    rows = []
    for row in csv.DictReader(io.StringIO(parameters.decode("ascii"))):
        name, value = row["name"], row["value"]
        if name not in kinds:
            raise InputError(f"{directory / case.name}_par.csv: the unit has no variable '{name}'")
        kind = kinds[name].capitalize()
        if kind == "Boolean":
            value = "true" if float(value) else "false"
        elif kind == "Integer":
            value = str(round(float(value)))
        rows.append(f'    <ssv:Parameter name={quoteattr(name)}><ssv:{kind} value="{value}"/></ssv:Parameter>\n')
    return (
        f'{_XML}<ssv:ParameterSet xmlns:ssv="{_SSP}ParameterValues" xmlns:ssc="{_SSP}Common" version="1.0"\n'
        f'    name="{case.name}" description={quoteattr(case.about)}>\n'
        f"  <ssv:Parameters>\n{''.join(rows)}  </ssv:Parameters>\n</ssv:ParameterSet>\n"
    ).encode()


def _experiments(cases: Iterable[_Case], result: Mapping[str, bytes]) -> bytes:
    """All cases in the experiments format; those with results for held inputs a second time."""
    text = ""
    for case in cases:
        for folder, how in (("", ""), (HELD, ", inputs held over each step")):
            if f"{folder}{case.name}_ref.csv" not in result:
                continue
            times = " ".join(f'{key}="{value}"' for key, value in case.times.items())
            text += f'  <Experiment name="{folder}{case.name}" description={quoteattr(case.about + how)} {times}>\n'
            for element, path in (
                ("Parameters", f"{case.name}_par.ssv"),
                ("Stimuli", f"{case.name}_in.csv"),
                ("References", f"{folder}{case.name}_ref.csv"),
            ):
                if path in result:
                    text += f'    <{element} source="{path}"/>\n'
            text += "  </Experiment>\n"
    about = "Pinned reference results that do not come from this unit's code; see README.md."
    return f'{_XML}<Experiments name="Reference results" description="{about}">\n{text}</Experiments>\n'.encode()


def _manifest(cases: Iterable[_Case], result: Mapping[str, bytes]) -> bytes:
    """fmi-ls-manifest.xml: every file with its type and role."""
    about = {case.name: case.about for case in cases}
    related = []
    for path in sorted(result):
        stem = path.removeprefix(HELD)
        case = re.sub(r"_(in|ref|par)(\.tolerances|\.bounds)?\.(csv|opt|ssv|yaml)$", "", stem)
        held_inputs = ", inputs held over each step" if path.startswith(HELD) else ""
        kind, role, what = _what(stem)
        description = f"{what}{': ' + about[case] if case in about else ''}{held_inputs}"
        related.append(
            f'  <Related type="{kind}" source="{path}" role="{role}" description={quoteattr(description)}/>\n'
        )
    return (
        f'{_XML}<fmiReferences xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest"\n'
        f'    fmi-ls:fmi-ls-name="{NAME}"\n    fmi-ls:fmi-ls-version="{VERSION}"\n'
        f'    fmi-ls:fmi-ls-description="{DESCRIPTION}">\n{"".join(related)}</fmiReferences>\n'
    ).encode()


def _what(path: str) -> tuple[str, str, str]:
    """MIME type, role and description of a file by its name."""
    for ending, kind, role, what in (
        (README, "text/markdown", "document", "What the references are and how to compare with them"),
        (EXPERIMENTS, "application/x-ma-hs-experiments", "experiment/validation", "All cases"),
        ("_par.ssv", "application/x-ssp-parameter-set", "parameter", "Parameters"),
        ("_par.csv", "text/csv", "other", "Parameters as CSV"),
        ("_in.csv", "text/csv", "other", "Inputs"),
        ("_ref.csv", "text/csv", "result", "Reference results"),
        (".bounds.csv", "text/csv", "other", "What lies between the rows of the reference results"),
        ("_ref.opt", "text/plain", "configuration", "Times and step size"),
        (".yaml", "application/yaml", "configuration", "Tolerances and their reasons"),
    ):
        if path.endswith(ending):
            return kind, role, what
    return "application/octet-stream", "other", path
