"""Answers that are kept between processes: the same as without, found anew where anything has changed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from feedsim.foundation import outputs
from feedsim.report.content import Report
from feedsim.report.page import html
from feedsim.scenario import load_machine
from feedsim.structure import pose_change as room
from feedsim.structure.pose_change import pose_change

MACHINE = Path(__file__).resolve().parents[1] / "scenarios" / "machines" / "test_centre"
RANGES = {"Z": (0.02, 0.35)}


class Counted:
    """Something dear to find, and how often it was."""

    def __init__(self, answer: Any = (1.0, "two")) -> None:
        self.answer, self.times = answer, 0

    def __call__(self) -> Any:
        self.times += 1
        return self.answer


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "kept"
    monkeypatch.setenv(outputs.CACHE_VARIABLE, str(folder))
    return folder


@pytest.fixture
def code(tmp_path: Path) -> Path:
    (tmp_path / "code").mkdir()
    (tmp_path / "code" / "solver.py").write_text("x = 1\n")
    return tmp_path / "code"


def test_an_answer_is_found_once(place: Path, code: Path) -> None:
    find = Counted([0.1 + 0.2, 1e-300, "words", None])
    answers = [outputs.cache_answer("kind", ["a", 1.5], [code], find) for _ in range(3)]
    assert answers == [find.answer] * 3  # to the last bit
    assert find.times == 1
    assert [file.name.startswith("kind-") for file in place.iterdir()] == [True]


def test_what_follows_from_something_else_is_found_anew(place: Path, code: Path) -> None:
    find = Counted()
    for follows_from in (["a", 1.0], ["a", 1.0 + 1e-15], ["b", 1.0]):
        outputs.cache_answer("kind", follows_from, [code], find)
    assert find.times == 3
    (code / "solver.py").write_text("x = 2\n")
    outputs._versions.cache_clear()
    outputs.cache_answer("kind", ["a", 1.0], [code], find)
    assert find.times == 4


@pytest.mark.parametrize(
    "content", ["", "no JSON", "[]", '{"asked": "other", "answer": 3}', "\x00" * 40, "[" * 100_000]
)
def test_a_damaged_file_is_replaced(content: str, place: Path, code: Path) -> None:
    find = Counted(7)
    outputs.cache_answer("kind", [], [code], find)
    (file,) = place.iterdir()
    file.write_text(content)
    assert outputs.cache_answer("kind", [], [code], find) == 7
    assert find.times == 2
    assert json.loads(file.read_text())["answer"] == 7


def test_a_folder_that_cannot_be_written_is_none(tmp_path: Path, code: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    for folder in ("", str(tmp_path / "file"), str(tmp_path / "file" / "below")):
        monkeypatch.setenv(outputs.CACHE_VARIABLE, folder)
        find = Counted(3)
        assert [outputs.cache_answer("kind", [], [code], find) for _ in range(2)] == [3, 3]
        assert find.times == 2


@pytest.mark.skipif(sys.platform == "win32", reason="folders of POSIX")
@pytest.mark.parametrize(
    ("set_to", "expected"),
    [({"HOME": "/home/a"}, Path("/home/a/.cache/feedsim")), ({}, None), ({"HOME": "relative"}, None),
     ({"HOME": "/home/a", "XDG_CACHE_HOME": "/b"}, Path("/b/feedsim"))],
)  # fmt: skip
def test_where_answers_are_kept(set_to: dict[str, str], expected: Path | None, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (outputs.CACHE_VARIABLE, "HOME", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in set_to.items():
        monkeypatch.setenv(name, value)
    assert outputs.cache_folder() == expected


def test_the_oldest_answers_go(place: Path, code: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outputs, "MAX_ANSWERS", 3)
    for k in range(6):
        outputs.cache_answer("kind", [k], [code], Counted(k))
        for file in place.iterdir():  # a clock may be coarse
            if json.loads(file.read_text())["answer"] == k:
                os.utime(file, (k, k))
    assert sorted(json.loads(file.read_text())["answer"] for file in place.iterdir()) == [3, 4, 5]


def test_the_pose_is_judged_the_same_and_solved_once(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Modes over the pose and the check of the table: without a kept answer, with one, and without solving at all."""
    machine = load_machine(MACHINE)

    def judged() -> tuple[Any, Any]:
        for each in (room._changes_between, room._end, room._solve_pose, room._modes_of_table):
            each.cache_clear()
        return pose_change(machine, RANGES), room.table_mismatch(machine)

    monkeypatch.setenv(outputs.CACHE_VARIABLE, "")
    plain = judged()
    assert plain[0].axes[0].modes
    monkeypatch.setenv(outputs.CACHE_VARIABLE, str(place))
    assert judged() == plain
    monkeypatch.setattr(room, "_model", lambda *_, **__: pytest.fail("solved again"))
    monkeypatch.setattr(room, "_modes_of_table", lambda *_: pytest.fail("solved again"))
    room._modes_of_table.cache_clear = lambda: None  # type: ignore[attr-defined]
    assert judged() == plain


def test_a_run_whose_pose_is_known_loads_no_structure(place: Path) -> None:
    """What a structure is described and solved by is not loaded where the answer is kept."""
    code = (
        "import sys\nfrom feedsim.scenario import load_machine\nfrom feedsim.structure.pose_change import pose_change\n"
        f"pose_change(load_machine({str(MACHINE)!r}), {RANGES!r})\n"
        "print('feedsim.structure.geometry.assemble' in sys.modules, 'feedsim.structure.solve' in sys.modules)\n"
    )
    said = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
        for _ in range(2)
    ]
    assert said == [["True", "True"], ["False", "False"]]


def test_templates_of_reports_are_compiled_once(place: Path) -> None:
    """The page is the same without kept templates, with new ones, with kept and with damaged ones."""
    report = Report("Title", "subtitle", main=[], footer="")
    pages = [html(report), html(report)]
    (folder,) = place.iterdir()
    kept = [*folder.iterdir()]
    assert kept
    for file in kept:
        file.write_bytes(b"damaged")
    pages.append(html(report))
    assert pages == pages[:1] * 3


def test_folders_of_other_code_are_few(place: Path, code: Path) -> None:
    for k in range(8):
        (code / "solver.py").write_text(f"x = {k}\n")
        outputs._versions.cache_clear()
        own = outputs.own_folder("compiled", [code])
        assert own is not None
        os.utime(own, (k, k))
    assert len([*place.iterdir()]) == 5
    assert own in place.iterdir()


@pytest.mark.skipif(sys.platform == "win32", reason="rights of POSIX")
def test_a_folder_that_others_can_write_to_is_not_used(place: Path, code: Path) -> None:
    own = outputs.own_folder("compiled", [code])
    assert own is not None
    own.chmod(0o777)
    assert outputs.own_folder("compiled", [code]) is None
