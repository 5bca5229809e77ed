"""YAML text -> plain values and lines: YAML 1.2 words and numbers, duplicate keys, broken files."""

from pathlib import Path

import pytest

from feedsim.files import source
from feedsim.files.source import MAX_VALUES, Place, _brackets, parse, read_yaml
from feedsim.foundation.errors import InputError


def values(text: str) -> object:
    return parse(text, "test.yaml", Path()).data


def refusal(text: str) -> str:
    with pytest.raises(InputError) as caught:
        values(text)
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("6.5e7", 6.5e7),
        ("1e-3", 1e-3),
        ("12", 12),
        ("-0.5", -0.5),
        (".5", 0.5),
        ("0x10", 16),
        ("0o17", 15),
        ("true", True),
        ("False", False),
        ("null", None),
        ("~", None),
        # words, all of them something else in YAML 1.1
        ("on", "on"),
        ("off", "off"),
        ("yes", "yes"),
        ("no", "no"),
        ("y", "y"),
        ("1:30", "1:30"),
        ("2021-06-01", "2021-06-01"),
        ("1_000", "1_000"),
        ("=", "="),
        ("'12'", "12"),
        ("5000 mm/min", "5000 mm/min"),
        ("!!str 12", "12"),
        ("!!float 12", 12.0),
    ],
)
def test_scalars_follow_yaml_1_2(text: str, value: object) -> None:
    read_back = values(f"a: {text}")
    assert read_back == {"a": value}
    assert type(read_back["a"]) is type(value)


def test_every_value_knows_its_line() -> None:
    source = parse("# comment\na: 1\nb:\n  - x\n  - {c: 2,\n     d: 3}\n", "f.yaml", Path())
    lines = {place: mark.where for place, mark in source.marks.items()}
    expected: dict[Place, int] = {
        (): 2,
        ("a",): 2,
        ("b",): 3,
        ("b", 0): 4,
        ("b", 1): 5,
        ("b", 1, "c"): 5,
        ("b", 1, "d"): 6,
    }
    assert lines == {place: f"f.yaml:{line}" for place, line in expected.items()}
    assert source.mark(("b", 1, "missing")).where == "f.yaml:5"


def test_duplicate_keys_are_all_reported_with_both_lines() -> None:
    message = refusal("a: 1\nb: 2\na: 3\nc: {d: 1, d: 2}\n")
    assert "test.yaml:3: duplicate key 'a' (first in line 1)" in message
    assert "test.yaml:4: duplicate key 'd' (first in line 4)" in message


def test_anchors_and_merge_keys() -> None:
    text = "x: &base {a: 1, b: [2]}\ny: *base\nz:\n  <<: *base\n  a: 5\n"
    assert values(text) == {"x": {"a": 1, "b": [2]}, "y": {"a": 1, "b": [2]}, "z": {"a": 5, "b": [2]}}


def test_alias_bomb_is_refused_before_it_goes_off() -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 12)]
    assert f"more than {MAX_VALUES} values, an alias counted as all that it stands for" in refusal("\n".join(lines))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: &a [*a]", "test.yaml:1: an alias refers to the value that it is part of"),
        ("a: *.x_a", "; text that begins with '*' needs quotes"),
        ("a: *x_a", "test.yaml:1: found undefined alias 'x_a'; text that begins with '*' needs quotes"),
        ("a:\n\tb: 1", "test.yaml:2: a tab cannot indent or start a value; use blanks"),
        ("a: 1\nb: c: 2", "test.yaml:2: a second ': ' in a line; put text that holds ': ' in quotes"),
        ("a: 1\nb\n", "test.yaml:3: expected 'key: value'"),
        ("a: [1, 2\nb: 3\n", "test.yaml:2: "),
        ("a: 1\n---\nb: 2\n", "test.yaml:2: a second document begins"),
        ("a: !!python/object:os.system 1", "tag 'tag:yaml.org,2002:python/object:os.system' is not known here"),
        ("a: !!set {x}", "is not known here"),
        ("a: !", "test.yaml:1: '!' alone says nothing; text needs quotes"),
        ("b: 1\na: ! 12", "test.yaml:2: '!' alone says nothing"),
        ("a:\tb", "test.yaml:1: a tab cannot indent or start a value; use blanks"),
        ("a: 1\nb: [1,\tb]", "test.yaml:2: a tab cannot"),
        ("b:\n  a: 1\t# comment", "test.yaml:2: a tab cannot"),
        ("a\t: 1", "test.yaml:1: a tab cannot"),
        ("a: >#x\n  t", "test.yaml:1: expected chomping or indentation indicators, but found '#'"),
        ("a: {x:1?}", "test.yaml:1: "),
        ("a: !!int x", "test.yaml:1: 'x' is no int"),
        ("[a, b]: 1", "test.yaml:1: a key must be a word"),
        ("a: 1\x07", "line 1 holds the control character U+0007"),
        ("a: " + "[" * 5000, "nested too deeply"),
    ],
)
def test_what_is_wrong_and_where(text: str, message: str) -> None:
    assert message in refusal(text)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "s.yaml: the file is empty"),
        (b" \n\n", "s.yaml: the file is empty"),
        (b"a: 1\nb: \xb5m\n", "s.yaml:2: not UTF-8 (byte 0xb5); save the file as UTF-8"),
    ],
)
def test_files_that_cannot_be_read(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "s.yaml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"s\.yaml") as caught:
        read_yaml(path)
    assert message in str(caught.value)


def test_missing_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no such file: .*none\.yaml"):
        read_yaml(tmp_path / "none.yaml")
    with pytest.raises(InputError, match="is a folder"):
        read_yaml(tmp_path)


def test_byte_order_mark_and_other_line_ends(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1\r\nb: 2\r\n")
    source = read_yaml(path)
    assert source.data == {"a": 1, "b": 2}
    assert source.mark(("b",)).where == f"{path}:2"


@pytest.mark.skipif(source._FastLoader is None, reason="PyYAML has no libyaml here")
@pytest.mark.parametrize(
    "text",
    [
        "a:\tb", "a: 1\t# comment", "a: 'x\ty'", "a: |\n  x\ty\n", "- \ta", "a:\n\tb: 1", "# a\tb\na: 1", "{a:\t1}",
        "a: !", "a: ! 12", "a: [!]", "a: !!str 12", "a: !x 1", "a: '!'", "a: b! # !",
        "a: >#x\n  t\n", "a: |-2#\n  t\n", "a: > # x\n  t\n", "{x:1?}", "a: {b: c?, d: ?e}", "a: [?b]", "? a\n: b",
        "a: b?", "# why?\na: {b: 1}", "a: b\ufeff", "\ufeffa: 1", "\n\ufeffa: 1", "a: \x85b", "a: \u2028b",
        "%YAML 1.2\n---\na: 1", "%YAML 1.1#\n---\na: 1", "a: b%", "---\n# nothing", "a:\n# nothing",
    ],
)  # fmt: skip
def test_both_parsers_are_one(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a file means, and what is said of its faults, must not depend on how PyYAML was built."""

    def found() -> object:
        try:
            read_back = parse(text, "test.yaml", Path())
        except InputError as error:
            return str(error)
        return read_back.data, read_back.marks

    fast = found()
    monkeypatch.setattr(source, "_FastLoader", None)
    assert fast == found()


def test_questions_in_comments_are_read_fast(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source, "_Loader", None)
    if source._FastLoader is not None:
        assert values("  # why?\na: {b: 1} \n") == {"a": {"b": 1}}


@pytest.mark.extensive
def test_a_file_of_too_many_values_is_given_up_early() -> None:
    """A list of a hundred thousand groups, in brackets: neither parser composes it to its end first."""
    text = "motions:\n" + "  - {kind: dwell, duration: 10 ms}\n" * 100_000
    assert "more than 100000 values" in refusal(text)
    assert "more than 100000 values" in refusal(text + "note: 'quoted'\n")


def test_brackets_that_lie_side_by_side_are_not_deep() -> None:
    assert _brackets("- {a: [1, 2]}\n" * 40_000) == 2
    assert _brackets("[" * 30_000) == 30_000
    assert _brackets("- {a: '}'}\n" * 40_000) == 40_000  # a quote may hide a bracket: all count
