"""Files of a size that a machine or a vandal makes: nested, long, wide, or many of one thing. A row for each.

Every file is answered in time that grows with its size alone: `SIZE` bytes in `SECONDS` of a processor, of which a
reader takes some tenths to two, and one that grows with the square many more. `files` makes content of the rows of a
kind (kinds.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

SIZE, SECONDS = 1_000_000, 4  # bytes; s of a processor

Shape = Callable[[int], str]  # bytes -> text of about that many


def nested(opening: str, closing: str, inner: str = "", around: str = "{}") -> Shape:
    """Something within itself."""

    def shape(size: int) -> str:
        depth = size // len(opening + closing)
        return around.replace("{}", depth * opening + inner + depth * closing)

    return shape


def many(piece: str, around: str = "{}") -> Shape:
    """A piece again and again; `#` in it counts."""

    def shape(size: int) -> str:
        count = size // (len(piece) + 5 * piece.count("#"))
        return around.replace("{}", "".join(piece.replace("#", str(k)) for k in range(count)))

    return shape


def wide(head: str, cells: str, separator: str = ",", rows: int = 2, ahead: str = "") -> Shape:
    """A table of many columns and few rows; `#` counts the columns, `@` the rows."""

    def shape(size: int) -> str:
        count = size // (rows * (len(cells) + 1) + len(head) + 6)
        names = separator.join(head.replace("#", str(k)) for k in range(count))
        body = [separator.join(["@"] + [cells] * (count - 1)).replace("@", str(k)) for k in range(rows)]
        return "\n".join([f"{ahead}time{separator}{names.partition(separator)[2]}", *body]) + "\n"

    return shape


_TABLES = {
    "a long name": many("m", "time,x{}\n0,1\n1,2\n"),
    "a long unit": many("m*", "time,x [{}m]\n0,1\n1,2\n"),
    "blanks in a name": many(" ", "time,x{}y\n0,1\n1,2\n"),
    "brackets in a name": many("[a", "time,x{}\n0,1\n1,2\n"),
    "cells in brackets": many("[,", "time,x{}\n0,1\n1,2\n"),
    "a long cell": many("9", "time,x\n0,{}\n1,2\n"),
    "a cell of letters": many("m ", "time,x\n0,{}\n1,2\n"),
    "many columns": wide("c#", "1.5"),
    "many columns of one name": wide("c", "1.5"),
    "many columns of text": wide("c#", "a"),
    "many columns without a name": wide("", "1.5"),
    "many columns with units": wide("c# [mm]", "1,5", ";"),
    "many columns of stamps": wide("c#", "10:00:00.00@"),
    "many columns of control paths": wide("/a/b# [u1; 2]", "1"),
    "many rows": many("#,1.5\n", "time,x\n{}"),
    "many rows of stamps": many("2025-03-04 10:00:00,#\n", "time,x\n{}"),
    "many dates": many("1/1/2#,#\n", "time,x\n{}"),
    "many short lines": many("\n", "a\n{}time,x\n0,1\n"),
    "many lines of words": many("a b c\n", "{}time,x\n0,1\n"),
    "many lines ahead": many("a,b\n", "{}time,x\n0,1\n"),
    "many quotes": many('"', "time,x\n0,{}\n"),
    "one line": many("abc "),
    "separators": many(","),
    "nothing but numbers": many("#,"),
}
_CAPTURE = '{"Header": {"CycleTimeMs": 2, "SignalListHFData": [{"Name": "CYCLE"}, {"Name": "A|1"}]}, "Payload": [{}]}'
_SIGNAL = '{"Name": "S|#"}, '
_FRAME = '<traceData><dataFrame><dataSignal id="f1" name="a"/>{}</dataFrame></traceData>'
_SCOPE = "Name\tA\tName\tB\nSampleTime[ms]\t2\tSampleTime[ms]\t4\n\n{}"
_YAML = {
    "nested brackets": nested("[", "]", around="name: {}"),
    "nested braces": nested("{a: ", "}", "1"),
    "nested lists": nested("- ", "", "1"),
    "many keys": many("k#: 1\n"),
    "a long text": many("a ", "name: {}"),
    "a long quoted text": many("a ", 'name: "{}"'),
    "aliases": many("*a, ", "x: &a 1\ny: [{}1]"),
    "one line": many("abc "),
}
SIZES: dict[str, dict[str, Shape]] = {
    **dict.fromkeys(("csv", "trace", "series", "response"), _TABLES),
    "capture": {
        "nested": nested("[", "]", around='{"a": {}}'),
        "nested objects": nested('{"a": ', "}", "1"),
        "nested in a row": nested("[", "]", around=_CAPTURE.replace("[{}]", '[{"HFData": [[0, 1], [1, {}]]}]')),
        "nested header": nested("[", "]", around='{"Header": {}}'),
        "brackets alone": nested("[", "]"),
        "many rows": many("[#, 1], ", _CAPTURE.replace("[{}]", '[{"HFData": [{}[9999999, 1]]}]')),
        "many messages": many('{"a": 1}, ', _CAPTURE.replace("[{}]", '[{}{"a": 1}]')),
        "many axes": many(
            '{"Name": "TORQUE|#"}, {"Name": "POWER|#"}, {"Name": "ENC_POS|#"}, ',
            '{"Header": {"CycleTimeMs": 2, "SignalListHFData": [{}{"Name": "CYCLE"}]}}',
        ),
        "many signals": many(_SIGNAL, '{"Header": {"CycleTimeMs": 2, "SignalListHFData": [{}{"Name": "CYCLE"}]}}'),
        "a long text": many("a", '{"a": "{}"}'),
        "a long number": many("9", '{"a": {}}'),
        "many members": many('"k#": 1, ', '{{}"a": 1}'),
    },
    "xml": {
        "nested": nested("<a>", "</a>"),
        "nested frame": nested("<a>", "</a>", around=_FRAME),
        "nested measurement": nested("<a>", "</a>", around="<ResponseTestCustom>{}</ResponseTestCustom>"),
        "many rows": many('<rec time="#" f1="1"/>', _FRAME),
        "many signals": many('<dataSignal id="f#" name="s"/>', _FRAME),
        "many attributes": many('a#="1" ', "<traceData {}/>"),
        "a long text": many("a ", "<traceData>{}</traceData>"),
        "a long name": many("a ", '<traceData><dataFrame><dataSignal name="{}"/></dataFrame></traceData>'),
    },
    "scope": {
        "many rows": many("#\t1\t#\t2\n", _SCOPE),
        "many channels": many("Name\tA\t", "Starttime of export\t1\n{}\n0\t1\n1\t2\n"),
        "many keys": many("SampleTime[ms]\t2\n", "Name\tA\nStarttime of export\t1\n{}\n0\t1\n1\t2\n"),
        "a long cell": many("9", _SCOPE.replace("{}", "0\t{}\t0\t1\n2\t1\t2\t1\n")),
        "halscope's rows": many("a.b +1.0 c -1.0 \n", "Sampling period is 1000 nSec\n\n{}"),
        "halscope's channels": many("a# +1.0 ", "Sampling period is 1000 nSec\n\n{}\n"),
        "halscope's labels": many("a;", "# Sampling period is 1000 ns\n{}\n1;2\n"),
        "halscope's values": many("1;", "# Sampling period is 1000 ns\na\n{}\n"),
    },
    **dict.fromkeys(("machine", "scenario", "columns", "tolerances"), _YAML),
}


def files(kind: str) -> Iterator[tuple[str, bytes]]:
    """Name and content of every row of a kind."""
    for name, shape in SIZES[kind].items():
        yield name, shape(SIZE).encode()
