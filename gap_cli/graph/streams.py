"""Latest-value streams: a producer never waits, a reader sees the newest item, and nothing piles up."""

from __future__ import annotations

from collections.abc import Callable
from threading import Condition
from typing import TYPE_CHECKING, Any

from gap_cli.contracts.failures import CancelledError, ToolError
from gap_cli.graph.compiled import UNSET

if TYPE_CHECKING:
    from gap_cli.graph.attempt import Attempt

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
            self._changed.notify_all()

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
