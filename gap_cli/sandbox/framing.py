"""Length-prefixed messages over a pipe; the host's side trusts no byte of them and waits for none past its deadline."""

from __future__ import annotations

import contextlib
import fcntl
import os
import select
import struct
import time
from collections.abc import Callable

HEADER = struct.Struct("<I")
SLICE_S = 0.05  # how often a waiting host looks whether it was cancelled
PIPE_BYTES = 1 << 20


class DeadlineError(Exception):
    """The other side did not answer, or take our message, in time."""


class FloodError(Exception):
    """The other side announced a message larger than allowed."""


class HangUpError(Exception):
    """The other side is gone."""


class Pipes:
    """The host's ends of a child's two pipes. `deadline` is on the monotonic clock; `check` may raise to give up."""

    def __init__(self, deadline: float, check: Callable[[], None] | None = None) -> None:
        self.deadline, self._check = deadline, check
        self.child_reads, self._writing = os.pipe()
        self._reading, self.child_writes = os.pipe()
        for fd in (self._writing, self._reading):
            os.set_blocking(fd, False)
            with contextlib.suppress(OSError):
                fcntl.fcntl(fd, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        self._readable, self._writable = select.poll(), select.poll()
        self._readable.register(self._reading, select.POLLIN)
        self._writable.register(self._writing, select.POLLOUT)
        self._open = {self.child_reads, self._writing, self._reading, self.child_writes}

    def give_away(self) -> None:
        """Close the child's ends here, once the child has them."""
        self._close(self.child_reads, self.child_writes)

    def close(self) -> None:
        """Close whatever is still open."""
        self._close(*self._open)

    def _close(self, *fds: int) -> None:
        for fd in fds:
            if fd in self._open:
                self._open.discard(fd)
                os.close(fd)

    def send(self, payload: bytes) -> None:
        """Write one message. Raises `DeadlineError`, `HangUpError`."""
        rest = memoryview(HEADER.pack(len(payload)) + payload)
        while rest:
            try:
                rest = rest[os.write(self._writing, rest) :]
            except BlockingIOError:
                self._wait(self._writable)
            except BrokenPipeError:
                raise HangUpError from None

    def receive(self, limit: int) -> bytearray:
        """Read one message of at most `limit` bytes. Raises `DeadlineError`, `FloodError`, `HangUpError`."""
        (length,) = HEADER.unpack(self._exactly(HEADER.size))
        if length > limit:
            raise FloodError(length)
        return self._exactly(length)

    def _exactly(self, count: int) -> bytearray:
        buffer = bytearray(count)
        view, got = memoryview(buffer), 0
        while got < count:
            try:
                n = os.readv(self._reading, [view[got:]])
            except BlockingIOError:
                self._wait(self._readable)
                continue
            if n == 0:
                raise HangUpError
            got += n
        return buffer

    def _wait(self, poll: select.poll) -> None:
        while True:
            if self._check is not None:
                self._check()
            left = self.deadline - time.monotonic()
            if left <= 0:
                raise DeadlineError
            if poll.poll(min(left, SLICE_S) * 1000 + 1):
                return


def read_frame(fd: int) -> bytes:
    """Read one message, blocking; the child's side. Raises EOFError when the host is gone."""

    def exactly(count: int) -> bytes:
        buffer = bytearray(count)
        view, got = memoryview(buffer), 0
        while got < count:
            n = os.readv(fd, [view[got:]])
            if n == 0:
                raise EOFError
            got += n
        return bytes(buffer)

    return exactly(HEADER.unpack(exactly(HEADER.size))[0])


def write_frame(fd: int, payload: bytes) -> None:
    """Write one message, blocking; the child's side."""
    rest = memoryview(HEADER.pack(len(payload)) + payload)
    while rest:
        rest = rest[os.write(fd, rest) :]
