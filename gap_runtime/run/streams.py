"""Latest-value streams: a producer never waits, a reader sees the newest item, and nothing piles up."""

from __future__ import annotations

from collections.abc import Callable
from threading import Condition
from time import monotonic
from typing import TYPE_CHECKING, Any

from gap_runtime.contracts.failures import CancelledError, ToolError
from gap_runtime.graph.compiled import UNSET

if TYPE_CHECKING:
    from gap_runtime.run.attempt import Attempt

POLL_S = 0.02


class Stream:
    """One producer, any number of readers, one place. After `close` the last value stays readable.

    `taken` is called with every value a reader takes.
    """

    def __init__(self, name: str, taken: Callable[[Any], None] = lambda value: None) -> None:
        self.name, self._taken = name, taken
        self._changed = Condition()
        self._value: Any = UNSET
        self._count = 0
        self._closed = False
        self._waiting: set[Attempt] = set()
        self._at_work: set[Attempt] = set()

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

    def following(self, seen: int, attempt: Attempt) -> tuple[int, Any] | None:
        """The newest value once more than `seen` items were published, with their number; None after the end.

        Until it asks again, the node counts as being at work on the value.
        """
        with self._changed:
            self._at_work.discard(attempt)
            self._waiting.add(attempt)
            self._changed.notify_all()
            try:
                while self._count <= seen:
                    attempt.check()
                    if self._closed:
                        return None
                    self._changed.wait(POLL_S)
            finally:
                self._waiting.discard(attempt)
            self._at_work.add(attempt)
            found = self._count, self._value
        self._taken(found[1])
        return found

    def wait_for_first(self, longest_s: float) -> None:
        """Until something was published or nothing will be."""
        with self._changed:
            self._changed.wait_for(lambda: self._count > 0 or self._closed, longest_s)

    def wait_for_readers(self, longest_s: float) -> None:
        """Until no node is at work on a value it took; those that were told to stop, or look at the world, apart."""
        limit = monotonic() + longest_s
        with self._changed:
            while not self._closed and monotonic() < limit and any(a.keeps_pace for a in self._at_work):
                self._changed.wait(POLL_S)

    def close(self) -> None:
        """No more items. Idempotent."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def latest(self, attempt: Attempt | None = None) -> Any:
        """The newest value; waits for the first one as long as `attempt` may run (not at all without one).

        Raises `ToolError` code `stream` where there is none and none will come.
        """
        if self._count == 0:
            return self.after(0, attempt)
        value = self._value
        self._taken(value)
        return value

    def reader(self, attempt: Attempt, seen: int = 0) -> Feed:
        """A place in this stream for one node, after the first `seen` items."""
        return Feed(self, attempt, seen)

    def after(self, seen: int, attempt: Attempt | None = None) -> Any:
        """The newest value once more than `seen` items were published; else as `latest`."""
        with self._changed:
            while self._count <= seen:
                if self._closed or attempt is None:
                    raise ToolError("stream", f"{self.name} has {'ended' if seen else 'published nothing'}.")
                attempt.check()
                self._changed.wait(POLL_S)
            value = self._value
        self._taken(value)
        return value


class Feed:
    """One node's place in a stream: what `in.observation_stream` is to a script."""

    def __init__(self, stream: Stream, attempt: Attempt, seen: int = 0) -> None:
        self._stream, self._attempt, self._seen = stream, attempt, seen

    def next(self) -> Any:
        """The newest value that was not taken before, waited for; None once the stream has ended.

        In a rehearsal world time stands still from here to the next call, so that what is made of a value never depends
        on how fast the machine is. Raises `CancelledError` when the node was told to stop.
        """
        found = self._stream.following(self._seen, self._attempt)
        if found is None:
            return None
        self._seen, value = found
        return value
