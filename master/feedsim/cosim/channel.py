"""Messages between two processes of which one executes programs of other makers, which may write into the pipe or close
it: nothing of what arrives is believed before it is known to be whole, and nobody waits for what does not come."""

from __future__ import annotations

import os
import pickle
import select
import struct
import zlib
from typing import Any

TOKEN = 16  # bytes that nobody else knows
_HEAD = struct.Struct(f"<{TOKEN}sQI")  # token, bytes of the message, their CRC-32
_BLOCK = 1 << 20


class GarbledError(Exception):
    """What has arrived is no message."""


class Sender:
    """The end that messages are sent by; a process that a unit has forked off from its own ends at the first."""

    def __init__(self, descriptor: int, token: bytes) -> None:
        self.descriptor, self._token, self._owner = descriptor, token, os.getpid()

    def send(self, message: Any) -> None:
        """OSError: nobody listens, or another program has closed this end."""
        if os.getpid() != self._owner:
            os._exit(0)
        content = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
        for part in (_HEAD.pack(self._token, len(content), zlib.crc32(content)), content):
            remaining = memoryview(part)
            while remaining:
                remaining = remaining[os.write(self.descriptor, remaining) :]


class Receiver:
    """The end that messages arrive at.

    begun: bytes of a message that is not whole yet.
    """

    def __init__(self, descriptor: int, token: bytes) -> None:
        os.set_blocking(descriptor, False)
        self.descriptor, self._token = descriptor, token
        self._arrived = bytearray()
        self._poll = select.poll()
        self._poll.register(descriptor, select.POLLIN)

    @property
    def begun(self) -> int:
        return len(self._arrived)

    def receive(self, wait: float | None) -> Any:
        """The next message; None where nothing more arrives within `wait` [s], which is for ever where it is None.

        Raises:
            EOFError: nobody can send any more.
            GarbledError: somebody else has written into it.
            OSError: another program has closed this end.
        """
        while (content := self._whole()) is None:
            if not self._poll.poll(None if wait is None else 1000 * wait):
                return None
            if not (block := os.read(self.descriptor, _BLOCK)):
                raise EOFError
            self._arrived += block
        return pickle.loads(content)

    def _whole(self) -> bytes | None:
        """Content of the first message, once it is there."""
        head = bytes(self._arrived[: _HEAD.size])
        if head[:TOKEN] != self._token[: len(head)]:
            raise GarbledError
        if len(head) < _HEAD.size:
            return None
        _, size, check = _HEAD.unpack(head)
        if len(self._arrived) < _HEAD.size + size:
            return None
        content = bytes(memoryview(self._arrived)[_HEAD.size : _HEAD.size + size])
        del self._arrived[: _HEAD.size + size]
        if zlib.crc32(content) != check:
            raise GarbledError
        return content
