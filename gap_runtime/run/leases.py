"""Who holds which actuator: a claim is granted whole or refused at once, so nobody ever waits while holding."""

from __future__ import annotations

from collections.abc import Iterable
from threading import Lock
from typing import TYPE_CHECKING

from gap_runtime.contracts.failures import ToolError

if TYPE_CHECKING:
    from gap_runtime.run.attempt import Attempt

CLOCK = "clock"


class Leases:
    """`arm:0`, `gripper:0`, ... have one holder at a time; `clock` one that moves, or many that only look."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._holders: dict[str, Attempt] = {}
        self._watchers: set[Attempt] = set()

    def claim(self, attempt: Attempt, resources: Iterable[str], *, moves: bool) -> None:
        """Hold `resources`, and the clock alone (`moves`) or beside others. Raises `ToolError` code `lease`."""
        wanted = sorted({*resources, CLOCK} if moves else set(resources))
        with self._lock:
            for resource in wanted:
                holder = self._holders.get(resource)
                if holder is not None and holder is not attempt:
                    raise _refused(attempt, resource, holder)
            others = self._watchers - {attempt}
            if moves and others:
                raise _refused(attempt, CLOCK, min(others, key=lambda a: a.id))
            clock = self._holders.get(CLOCK)
            if not moves and clock is not None and clock is not attempt:
                raise _refused(attempt, CLOCK, clock)
            for resource in wanted:
                self._holders[resource] = attempt
            if not moves:
                self._watchers.add(attempt)

    def holds(self, attempt: Attempt, resource: str) -> bool:
        """True while `attempt` holds `resource`."""
        return self._holders.get(resource) is attempt

    def held(self) -> tuple[str, ...]:
        """Every resource held now, the clock included."""
        with self._lock:
            return tuple(sorted(self._holders)) + ((CLOCK,) if self._watchers and CLOCK not in self._holders else ())

    def yield_clock(self, attempt: Attempt) -> None:
        """The node has ended: time may pass for the next one, its actuators stay its own until the step is over."""
        with self._lock:
            self._watchers.discard(attempt)
            if self._holders.get(CLOCK) is attempt:
                del self._holders[CLOCK]

    def release(self, attempt: Attempt) -> None:
        """Give back everything."""
        with self._lock:
            self._watchers.discard(attempt)
            for resource in [r for r, holder in self._holders.items() if holder is attempt]:
                del self._holders[resource]


def _refused(attempt: Attempt, resource: str, holder: Attempt) -> ToolError:
    return ToolError(
        "lease",
        f"{attempt.node.path} wants {resource}, which {holder.node.path} holds.",
        hint="Put one of the two behind the other with an edge.",
    )
