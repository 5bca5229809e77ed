"""documentation/ of an archive: index.html from the unit's README.md, its variables and the licence.

What belongs to the machine in the archive stands in parts of the page that are marked, so that a machine is packed
without the sources that the rest of the page was made from.
"""

import html
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from . import terminals
from .errors import InputError
from .machine import Machine
from .resources import Resources
from .table import Table
from .variables import Variable

if TYPE_CHECKING:  # renders the README; packing a machine does without it
    from markdown_it.token import Token

INDEX = "documentation/index.html"
REFERENCES = "documentation/fmi-ls-ref.html"  # where FMI-LS-REF recommends a page on the references

_STYLE = """\
body { font: 16px/1.5 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem; color: #1c2126; }
h1, h2, h3 { line-height: 1.2; }
pre, code { font-family: ui-monospace, Consolas, monospace; font-size: 0.9em; background: #f3f5f7; }
pre { padding: 0.8rem; overflow-x: auto; }
table { border-collapse: collapse; display: block; overflow-x: auto; }
th, td { border: 1px solid #ccd3da; padding: 0.25rem 0.6rem; text-align: left; vertical-align: top; }
th { background: #eef1f4; }
td.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
"""

_BUILD = """\
cc -std=c99 -O2 -ffp-contract=off -fPIC -shared -fvisibility=hidden -I FOLDER *.c -lm -o {unit}.so
"""


_SYNTHETIC = "Start values are those of a synthetic default machine; no existing machine has them."

_CONNECT = (
    "<p>Inputs and outputs that belong together. Connect a terminal to the one of the same name (behind the axis) of "
    "the unit on its other side, which has an output for each input here and the other way round, of the same names. "
    "Tools that know terminals find them in terminalsAndIcons/terminalsAndIcons.xml.</p>\n"
)

_HEADERS = """
The headers of the FMI standard that the binaries were compiled with are under a licence of their own: fmi-headers.txt.
"""


_LINK = '<p>The archive carries <a href="fmi-ls-ref.html">reference results</a> to compare an importer\'s with.</p>\n'

_MARKS = {part: (f"<!-- {part} -->\n", f"<!-- end of {part} -->\n") for part in ("machine", "variables")}


def pages(
    table: Table,
    variables: Sequence[Variable],
    resources: Resources | None,
    *,
    readme: str | None,
    licence: str | None,
    standard_header: str,
    version: str,
    machine: Machine,
    references: str | None = None,
) -> dict[str, bytes]:
    """Archive path -> content. Without `readme` or `licence` that part is left out (the caller warns).

    `references` is the text that goes with the archive's reference results, where it has any.
    `standard_header` is a header of the FMI standard, whose opening comment holds the standard's licence.
    """
    body = _rendered(readme) if readme else f"<h1>{table.unit}</h1>\n<p>{html.escape(table.summary)}.</p>\n"
    parts = _marked_parts(variables, resources, machine, with_references=references is not None)
    result = {INDEX: _index(table, body, parts, licence, version).encode()}
    if references is not None:
        result[REFERENCES] = _page(f"{table.unit} {version}: reference results", _rendered(references)).encode()
    if licence is not None:
        result["documentation/licenses/license.txt"] = (licence + _HEADERS).encode()
    result["documentation/licenses/fmi-headers.txt"] = _licence_of(standard_header).encode()
    return result


def for_machine(
    index: bytes, variables: Sequence[Variable], resources: Resources, machine: Machine, where: str
) -> bytes:
    """The page `index` of another archive of the same unit, with this machine in the place of the one there.

    Raises:
        InputError: the page has not the parts to replace; `where` names it.
    """
    text = index.decode("utf-8", errors="replace")
    for part, content in _marked_parts(variables, resources, machine).items():
        begin, end = _MARKS[part]
        if text.count(begin) != 1 or text.count(end) != 1:
            raise InputError(f"{where}: has no part '{part}' to put another machine into")
        text = text.partition(begin)[0] + content + text.partition(end)[2]
    return text.encode()


def _marked_parts(
    variables: Sequence[Variable], resources: Resources | None, machine: Machine, *, with_references: bool = False
) -> dict[str, str]:
    """What the page says of the machine, between its marks."""
    about = _about(resources, machine) if resources and not machine.default else ""
    parts = {
        "machine": about + (_LINK if with_references else ""),
        "variables": _terminal_table(variables)
        + "<h2>Variables</h2>\n"
        + (_synthetic(resources) if machine.default else "")
        + _variable_table(variables),
    }
    return {part: text.join(_MARKS[part]) for part, text in parts.items()}


def _about(resources: Resources, machine: Machine) -> str:
    noun = resources.noun.lower()
    name = f"the {noun} <strong>{html.escape(machine.name)}</strong>" if machine.name else f"a {noun} of its own"
    note = f"<p>{html.escape(machine.note)}</p>\n" if machine.note else ""
    return (
        f"<p>This archive holds {name}. {html.escape(resources.summary())} Numbers that the text below gives for the "
        f"default {noun} are not this {noun}'s.</p>\n{note}"
    )


def _synthetic(resources: Resources | None) -> str:
    return f"<p>{resources.default_note if resources else _SYNTHETIC}</p>\n"


def _licence_of(header: str) -> str:
    """From the copyright line to the end of the comment it stands in, without the indentation."""
    match = re.search(r"^ *Copyright .*?(?=\*/)", header, re.DOTALL | re.MULTILINE)
    if match is None:
        raise ValueError("the header of the FMI standard has no copyright notice")
    return "\n".join(line.removeprefix("   ").rstrip() for line in match[0].rstrip().splitlines()) + "\n"


def _index(table: Table, body: str, parts: Mapping[str, str], licence: str | None, version: str) -> str:
    texts = [
        parts["machine"],
        body,
        parts["variables"],
        "<h2>Building from the sources</h2>\n",
        "<p>The folder <code>sources</code> is complete but for the three headers of FMI 2.0 (fmi2Functions.h, ",
        "fmi2FunctionTypes.h, fmi2TypesPlatform.h), which every importer has: the standard wants the importer's to be ",
        "used. The C files to compile are listed in modelDescription.xml and, with compiler options and library, in ",
        "sources/buildDescription.xml. Nothing needs to be defined, and nothing but the C library and libm is needed. ",
        "FOLDER is that of the headers:</p>\n",
        f"<pre><code>{html.escape(_BUILD.format(unit=table.unit))}</code></pre>\n",
        "<p>To link several units into one program, compile each with ",
        f"<code>-DFMI2_FUNCTION_PREFIX={table.unit}_</code> (the unit's own name and an underscore).</p>\n",
    ]
    if licence is not None:
        texts.append(f"<h2>Licence</h2>\n<pre>{html.escape(licence)}</pre>\n")
    return _page(f"{table.unit} {version}", "".join(texts))


def _page(title: str, body: str) -> str:
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{html.escape(title)}</title>\n'
        f"<style>\n{_STYLE}</style>\n</head>\n<body>\n{body}</body>\n</html>\n"
    )


def _rendered(text: str) -> str:
    """Markdown -> HTML. Links to files of the repository become plain text: the archive has no such files."""
    from markdown_it import MarkdownIt

    markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = markdown.parse(text)
    for token in tokens:
        if token.children:
            token.children = _without_relative_links(token.children)
    rendered: str = markdown.renderer.render(tokens, markdown.options, {})
    return rendered


def _without_relative_links(tokens: Sequence["Token"]) -> list["Token"]:
    kept: list[Token] = []
    relative = False  # links do not nest
    for token in tokens:
        if token.type == "link_open":
            relative = not re.match(r"https?:|mailto:|#", str(token.attrGet("href")))
        if not (relative and token.type in ("link_open", "link_close")):
            kept.append(token)
        if token.type == "link_close":
            relative = False
    return kept


def _terminal_table(variables: Sequence[Variable]) -> str:
    """Inputs and outputs as they are connected; empty where none belong together."""
    result = terminals.find(variables)
    if not result:
        return ""
    by_name = {variable.name: variable.row for variable in variables}
    rows = []
    for terminal in result:
        inputs, outputs = (
            ", ".join(f"<code>{name}</code>" for name in terminal.members.values() if by_name[name].causality == wanted)
            for wanted in ("input", "output")
        )
        cells = (f"<code>{terminal.name}</code>", html.escape(terminal.description), inputs, outputs)
        rows.append(f"<tr>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>\n")
    heads = "".join(f"<th>{head}</th>" for head in ("Terminal", "What it is", "Inputs", "Outputs"))
    return f"<h2>Connections</h2>\n{_CONNECT}<table>\n<tr>{heads}</tr>\n{''.join(rows)}</table>\n"


def _variable_table(variables: Sequence[Variable]) -> str:
    heads = ("Name", "Unit", "Shown in", "Causality", "Variability", "Start", "Min", "Max", "Description")
    lines = [f"<table>\n<tr>{''.join(f'<th>{head}</th>' for head in heads)}</tr>\n"]
    for variable in variables:
        row = variable.row
        start = "" if variable.start is None else variable.start
        if row.kind == "BOOLEAN" and start:
            start = "true" if int(start) else "false"
        shown = (row.unit or row.kind.capitalize(), row.display_unit)
        texts = (f"<code>{variable.name}</code>", *map(html.escape, shown))
        numbers = (start, row.min.removeprefix("NO_MIN"), row.max.removeprefix("NO_MAX"))
        cells = (
            *(f"<td>{text}</td>" for text in (*texts, row.causality, row.variability)),
            *(f'<td class="number">{html.escape(number)}</td>' for number in numbers),
            f"<td>{html.escape(row.description)}</td>",
        )
        lines.append(f"<tr>{''.join(cells)}</tr>\n")
    return "".join((*lines, "</table>\n"))
