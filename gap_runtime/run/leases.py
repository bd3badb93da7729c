"""Who holds which actuator: a claim is granted whole or refused at once, so nobody ever waits while holding."""

from __future__ import annotations

from collections.abc import Iterable
from threading import Lock
from typing import Protocol

from gap_runtime.contracts.failures import ToolError

CLOCK = "clock"


class Holder(Protocol):
    """Who holds: a single execution of the node at `path`. Holders are told apart by identity."""

    @property
    def id(self) -> int:
        """In the order they began."""

    @property
    def path(self) -> str:
        """Of the node."""


class Leases:
    """`arm:0`, `gripper:0`, ... have one holder at a time; `clock` one that moves, or many that only look."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._holders: dict[str, Holder] = {}
        self._sensing: set[Holder] = set()

    def claim(self, holder: Holder, resources: Iterable[str], *, moves: bool) -> None:
        """Hold `resources`, and the clock alone (`moves`) or beside others. Raises `ToolError` code `lease`."""
        wanted = sorted({*resources, CLOCK} if moves else set(resources))
        with self._lock:
            for resource in wanted:
                other = self._holders.get(resource)
                if other is not None and other is not holder:
                    raise _refused(holder, resource, other)
            others = self._sensing - {holder}
            if moves and others:
                raise _refused(holder, CLOCK, min(others, key=lambda a: a.id))
            clock = self._holders.get(CLOCK)
            if not moves and clock is not None and clock is not holder:
                raise _refused(holder, CLOCK, clock)
            for resource in wanted:
                self._holders[resource] = holder
            if not moves:
                self._sensing.add(holder)

    def holds(self, holder: Holder, resource: str) -> bool:
        """True while `holder` holds `resource`."""
        return self._holders.get(resource) is holder

    def held(self) -> tuple[str, ...]:
        """Every resource held now, the clock included."""
        with self._lock:
            return tuple(sorted(self._holders)) + ((CLOCK,) if self._sensing and CLOCK not in self._holders else ())

    def yield_clock(self, holder: Holder) -> None:
        """The node has ended: time may pass for the next one, its actuators stay its own until the step is over."""
        with self._lock:
            self._sensing.discard(holder)
            if self._holders.get(CLOCK) is holder:
                del self._holders[CLOCK]

    def release(self, holder: Holder) -> None:
        """Give back everything."""
        with self._lock:
            self._sensing.discard(holder)
            for resource in [r for r, other in self._holders.items() if other is holder]:
                del self._holders[resource]


def _refused(holder: Holder, resource: str, other: Holder) -> ToolError:
    return ToolError(
        "lease",
        f"{holder.path} wants {resource}, which {other.path} holds.",
        hint="Put one of the two behind the other with an edge.",
    )
