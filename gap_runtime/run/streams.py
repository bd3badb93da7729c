"""Latest-value streams: a producer never waits, a reader sees the newest item, and nothing piles up."""

from __future__ import annotations

from collections.abc import Callable
from threading import Condition
from time import monotonic
from typing import Any

from gap_runtime.contracts.failures import CancelledError, ToolError
from gap_runtime.graph.compiled import UNSET, StreamOwner

POLL_S = 0.02


class Stream:
    """One producer, any number of readers, one place. After `close` the last value stays readable.

    `on_read` is called with every value a reader takes.
    """

    def __init__(self, name: str, on_read: Callable[[Any], None] = lambda value: None) -> None:
        self.name, self._on_read = name, on_read
        self._changed = Condition()
        self._value: Any = UNSET
        self._count = 0
        self._closed = False
        self._waiting: set[StreamOwner] = set()
        self._at_work: set[StreamOwner] = set()

    @property
    def count(self) -> int:
        """How many items were published so far."""
        return self._count

    @property
    def closed(self) -> bool:
        """True once the producer has ended."""
        return self._closed

    def publish(self, value: Any) -> None:
        """Replace the latest value. Raises `CancelledError` after `close`."""
        with self._changed:
            if self._closed:
                raise CancelledError(f"{self.name} published after its end.")
            self._value = value
            self._count += 1
            self._at_work |= self._waiting
            self._changed.notify_all()

    def wait_next(self, seen: int, owner: StreamOwner) -> tuple[int, Any] | None:
        """The newest value once more than `seen` items were published, with their number; None after the end.

        Until it asks again, the node counts as being at work on the value.
        """
        with self._changed:
            self._at_work.discard(owner)
            self._waiting.add(owner)
            self._changed.notify_all()
            try:
                while self._count <= seen:
                    owner.check()
                    if self._closed:
                        return None
                    self._changed.wait(POLL_S)
            finally:
                self._waiting.discard(owner)
            self._at_work.add(owner)
            found = self._count, self._value
        self._on_read(found[1])
        return found

    def wait_for_first(self, longest_s: float) -> None:
        """Until something was published or nothing will be."""
        with self._changed:
            self._changed.wait_for(lambda: self._count > 0 or self._closed, longest_s)

    def wait_for_readers(self, longest_s: float) -> None:
        """Until no node that the cell may wait for is at work on a value it took."""
        limit = monotonic() + longest_s
        with self._changed:
            while not self._closed and monotonic() < limit and any(a.paces_cell for a in self._at_work):
                self._changed.wait(POLL_S)

    def close(self) -> None:
        """No more items. Idempotent."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def latest(self, owner: StreamOwner | None = None) -> Any:
        """The newest value; waits for the first one as long as `owner` may run (not at all without one).

        Raises `ToolError` code `stream` where there is none and none will come.
        """
        if self._count == 0:
            return self.after(0, owner)
        value = self._value
        self._on_read(value)
        return value

    def reader(self, owner: StreamOwner, seen: int = 0) -> StreamReader:
        """A place in this stream for one node, after the first `seen` items."""
        return StreamReader(self, owner, seen)

    def after(self, seen: int, owner: StreamOwner | None = None) -> Any:
        """The newest value once more than `seen` items were published; else as `latest`."""
        with self._changed:
            while self._count <= seen:
                if self._closed or owner is None:
                    raise ToolError("stream", f"{self.name} has {'ended' if seen else 'published nothing'}.")
                owner.check()
                self._changed.wait(POLL_S)
            value = self._value
        self._on_read(value)
        return value


class StreamReader:
    """One node's place in a stream: what `in.observation_stream` is to a script."""

    def __init__(self, stream: Stream, owner: StreamOwner, seen: int = 0) -> None:
        self._stream, self._owner, self._seen = stream, owner, seen

    def next(self) -> Any:
        """The newest value that was not read before, waited for; None once the stream has ended.

        In a rehearsal cell time stands still from here to the next call, so that what is made of a value never depends
        on how fast the machine is. Raises `CancelledError` when the node was told to stop.
        """
        found = self._stream.wait_next(self._seen, self._owner)
        if found is None:
            return None
        self._seen, value = found
        return value
