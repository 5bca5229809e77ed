"""JSON read piece by piece, for files that would fill the memory as Python's objects.

May use errors. A caller walks through objects and arrays with members() and items(), and takes whole what is small.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

from feedsim.errors import InputError
from feedsim.files.regular import check_depth

CHUNK = 1 << 20  # characters
MAX_VALUE_LENGTH = 1 << 26  # characters of a value that is taken whole
_BLANK = re.compile(r"[ \t\n\r]*")


class JsonStream:
    """A JSON text from a file. Whatever is wrong with it is an InputError that names the file."""

    def __init__(self, text: TextIO, path: Path) -> None:
        self._text, self._path = text, path
        self._decode = json.JSONDecoder().raw_decode
        self._buffer, self._at, self._before = "", 0, 0
        self._chunk = CHUNK

    def _fill(self) -> bool:
        more = self._text.read(self._chunk)
        self._before += self._at
        self._buffer, self._at = self._buffer[self._at :] + more, 0
        return bool(more)

    def peek(self) -> str:
        """The next character that is no blank; "" at the end."""
        while True:
            result = _BLANK.match(self._buffer, self._at)
            assert result is not None
            self._at = result.end()
            if self._at < len(self._buffer):
                return self._buffer[self._at]
            if not self._fill():
                return ""

    def wrong(self, expected: str) -> InputError:
        """That something else is expected where the reader is."""
        where = f"at character {self._before + self._at}"
        return InputError(f"{self._path} is no JSON file that can be read: {expected} is expected {where}")

    def _take(self, allowed: str) -> str:
        text = self.peek()
        if not text or text not in allowed:
            raise self.wrong(" or ".join(allowed))
        self._at += 1
        return text

    def value(self) -> Any:
        """The next value, whole."""
        self.peek()
        while True:
            try:
                value, end = self._decode(self._buffer, self._at)
            except json.JSONDecodeError:
                if len(self._buffer) - self._at > MAX_VALUE_LENGTH:
                    raise InputError(
                        f"{self._path} is no JSON file that can be read: the value at character "
                        f"{self._before + self._at} does not end within {MAX_VALUE_LENGTH:,} characters"
                    ) from None
                if self._fill():
                    self._chunk *= 2  # a long value, which is scanned again
                    continue
                raise self.wrong("a value") from None
            except RecursionError:
                raise InputError(f"{self._path}: its values are nested too deep") from None
            except ValueError as error:  # a whole number of thousands of digits
                raise InputError(f"{self._path} is no JSON file that can be read: {error}") from None
            if end == len(self._buffer) and self._fill():
                continue  # a number may go on
            check_depth(value, self._buffer[self._at : end], str(self._path))
            self._at, self._chunk = end, CHUNK
            return value

    def members(self) -> Iterator[str]:
        """Names of an object; behind each one its value must be taken."""
        self._take("{")
        if self.peek() == "}":
            self._at += 1
            return
        while True:
            if self.peek() != '"':
                raise self.wrong("a name")
            name = self.value()
            self._take(":")
            yield name
            if self._take(",}") == "}":
                return

    def items(self) -> Iterator[int]:
        """Numbers from 0 of the items of an array; behind each one it must be taken."""
        self._take("[")
        if self.peek() == "]":
            self._at += 1
            return
        number = 0
        while True:
            yield number
            number += 1
            if self._take(",]") == "]":
                return

    def end(self) -> None:
        """InputError: something follows."""
        if self.peek():
            raise self.wrong("the end")
