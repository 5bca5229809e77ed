"""Names of constants say their quantity."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "master" / "feedsim"
FILES = sorted(PACKAGE.rglob("*.py"))
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
