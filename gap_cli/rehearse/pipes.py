"""Lines of JSON between a rehearsal and its workers, over file descriptors that nothing else writes to."""

from __future__ import annotations

import json
import os
from typing import Any

CHUNK = 1 << 16
MAX_LINE = 64 << 20


class Reader:
    """Reads messages from a file descriptor that may deliver them in pieces."""

    def __init__(self, fd: int) -> None:
        self.fd = fd
        self._rest = b""

    def read(self) -> list[dict[str, Any]] | None:
        """The messages one read completes (maybe none); None once the other side is gone."""
        try:
            data = os.read(self.fd, CHUNK)
        except ConnectionError:
            data = b""
        if not data:
            return None
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > MAX_LINE:
            return None
        return [json.loads(line) for line in lines]

    def wait(self) -> dict[str, Any] | None:
        """Block until the next message; None once the other side is gone. For a side that gets one at a time."""
        while True:
            messages = self.read()
            if messages is None:
                return None
            if messages:
                return messages[0]


def send(fd: int, message: dict[str, Any]) -> None:
    """Write one message. Raises `BrokenPipeError` when the other side is gone."""
    data = json.dumps(message, ensure_ascii=False).encode() + b"\n"
    while data:
        data = data[os.write(fd, data) :]
