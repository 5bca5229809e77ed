"""Messages and constants have words of the field: none of those that mean too many things."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "master" / "feedsim"
FILES = sorted(PACKAGE.rglob("*.py"))
# Determined, known, named, separated or declared say which of these is meant.
PRIVATE = re.compile(
    r"\b(?:is|are|be|been|not|hardly|best|neither|can) told\b|\btold (?:apart|from|within)\b|, which tells\b"
)
# Names of constants that stood in several files, with another meaning in each.
VAGUE = {"APART", "VAGUE", "AMISS"}


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
def test_messages_and_constants_are_in_words_of_the_field(file: Path) -> None:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    assert [(each.lineno, each.value) for each in texts(tree) if PRIVATE.search(str(each.value))] == []
    assigned = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    assert assigned & VAGUE == set()


def test_a_private_word_is_found() -> None:
    tree = ast.parse('"""It is told."""\ndef f():\n    """Not told."""\n    raise E(f"{x} cannot be told")\n')
    assert [each.lineno for each in texts(tree) if PRIVATE.search(str(each.value))] == [4]
