"""Messages and constants have words of the field: none of those that mean too many things."""

from __future__ import annotations

import ast
import csv
import re
import tokenize
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "master" / "feedsim"
FILES = sorted(PACKAGE.rglob("*.py"))
# Determined, known, named, separated or declared say which of these is meant.
PRIVATE = re.compile(
    r"\b(?:is|are|be|been|not|hardly|best|neither|can) told\b|\btold (?:apart|from|within|to)\b|, which tells\b"
    r"|\b(?:header|records?|data|traces|plateaus|file|side|reference|result|size|stage) tells?\b"
    r"|\b(?:not|cannot|hardly) tell\b(?! apart| which|$)|\bone of both\b|\bof now\b|\bhangs? together\b"
)
# Adjectives and degrees without a noun: what is longest, how near, which usual?
WITHOUT_A_NOUN = frozenset(
    [
        "ALIKE",
        "APART",
        "AROUND",
        "BEHIND",
        "BEYOND",
        "CERTAIN",
        "CHANGE",
        "CLEAR",
        "CLOSE",
        "COARSE",
        "DEEPEST",
        "EVEN",
        "FAR",
        "FEW",
        "FEWEST",
        "FLOOR",
        "GOOD",
        "HIDDEN",
        "HIGHEST",
        "KEPT",
        "KINDS",
        "LARGE",
        "LARGEST",
        "LEAST",
        "LONG",
        "LONGEST",
        "LOOKED_AT",
        "LOWEST",
        "MANY",
        "MORE",
        "MOST",
        "NAMED",
        "NEAR",
        "OWN",
        "POOR",
        "QUIET",
        "ROUGH",
        "ROUNDING",
        "ROUNDS",
        "SAME",
        "SEEN",
        "SETTLED",
        "SHARE",
        "SHARES",
        "SHORTEST",
        "SHOWN",
        "SLACK",
        "SLOW",
        "SMALL",
        "SMALLEST",
        "STEP",
        "STEPS",
        "TIMES",
        "TOLD",
        "UNKNOWN",
        "UNSEEN",
        "USUAL",
        "VAGUE",
        "WHOLE",
        "WIDE",
        "WIDEST",
        "WORTH",
    ]
)
# What a command, a picture or a kind of result declares under one name, with one meaning everywhere.
DECLARED = frozenset({"COMMAND", "DESCRIPTION", "EPILOG", "KIND", "FORMAT", "NOTE", "T"})


def texts(tree: ast.Module) -> list[ast.Constant]:
    """Texts of a file but for docstrings."""
    docstrings = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings
    ]


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(PACKAGE)))
def test_messages_are_in_words_of_the_field(file: Path) -> None:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    assert [(each.lineno, each.value) for each in texts(tree) if PRIVATE.search(str(each.value))] == []


def constants(tree: ast.Module) -> Iterator[str]:
    """Names in capitals that a module gives a value."""
    for node in tree.body:
        targets = (
            node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        )
        for target in targets:
            for name in target.elts if isinstance(target, ast.Tuple) else [target]:
                if isinstance(name, ast.Name) and name.id.isupper():
                    yield name.id


def test_constants_say_their_quantity() -> None:
    wrong = [f"{file.relative_to(PACKAGE)}: {name}" for file in FILES
             for name in constants(ast.parse(file.read_text(encoding="utf-8"))) if name in WITHOUT_A_NOUN]  # fmt: skip
    assert wrong == []


def test_a_name_has_no_more_than_two_meanings() -> None:
    """Of different rooms: the same name in three of them is a word that says too little."""
    rooms = defaultdict(set)
    for file in FILES:
        for name in constants(ast.parse(file.read_text(encoding="utf-8"))):
            rooms[name].add(file.relative_to(PACKAGE).parts[0])
    assert {name: sorted(of) for name, of in rooms.items() if len(of) > 2 and name not in DECLARED} == {}


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(PACKAGE)))
def test_comments_say_shown_given_or_determined(file: Path) -> None:
    """What "tells" may mean any of these."""
    with tokenize.open(file) as lines:
        found = [
            (token.start[0], token.string)
            for token in tokenize.generate_tokens(lines.readline)
            if (token.type == tokenize.COMMENT or token.string.startswith('"""'))
            and re.search(r"\b(?:told|tells?)\b", token.string)
        ]
    assert found == []


# Verbs and pronouns as names: of what?
WITHOUT_A_THING = frozenset({"each", "found", "held", "left", "told"})
MAX_NAMES_WITHOUT_A_THING = 111  # in the whole package, 1,700 once; only ever fewer


def bound(tree: ast.Module) -> Iterator[str]:
    """Names that a file's functions bind, and their own."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name.lower().strip("_")


def without_a_thing(names: list[str]) -> int:
    """How many there are; beside a right or a top, left is a side."""
    sides = {"left"} if {"right", "top"} & set(names) else set()
    return sum(name in WITHOUT_A_THING - sides for name in names)


def test_names_say_what_they_are_of() -> None:
    files = {str(file.relative_to(PACKAGE)): list(bound(ast.parse(file.read_text(encoding="utf-8")))) for file in FILES}
    counts = {file: without_a_thing(names) for file, names in files.items()}
    assert sum(counts.values()) <= MAX_NAMES_WITHOUT_A_THING, {name: count for name, count in counts.items() if count}


def test_a_private_word_is_found() -> None:
    tree = ast.parse('"""It is told."""\ndef f():\n    """Not told."""\n    raise E(f"{x} cannot be told")\n')
    assert [each.lineno for each in texts(tree) if PRIVATE.search(str(each.value))] == [4]


# --- codes of findings ------------------------------------------------------------------------------------------------


def produced() -> dict[str, list[str]]:
    """Codes with which the package makes findings -> where. A call without a literal code fails, but for one that has
    the fields of an entry (``**entry``)."""
    found = defaultdict(list)
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Finding"):
                continue
            if not node.args and [keyword.arg for keyword in node.keywords] == [None]:
                continue
            code = node.args[0]
            for each in (code.body, code.orelse) if isinstance(code, ast.IfExp) else (code,):
                assert isinstance(each, ast.Constant), f"{path}:{node.lineno}: the code is no literal"
                found[str(each.value)].append(f"{path.relative_to(PACKAGE)}:{node.lineno}")
    return found


def test_every_code_of_a_finding_is_in_the_table_and_every_code_of_the_table_is_produced() -> None:
    with (PACKAGE / "foundation" / "findings.csv").open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    assert head == ["code", "meaning"]
    codes, places = [code for code, _ in rows], produced()
    assert codes == sorted({*codes})
    assert {code: places[code] for code in {*places} - {*codes}} == {}
    assert {*codes} - {*places} == set()
    for code, meaning in rows:
        assert re.fullmatch(r"[a-z]+(-[a-z]+)+", code), code
        assert meaning
        assert not PRIVATE.search(meaning), code
    # One place, or a few that mean the same.
    assert max(map(len, places.values())) <= 4
