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
    def path(self) -> str:
        """Of the node."""


class Leases:
    """`arm:0`, `gripper:0`, ... have one holder at a time. `clock`, the right to let time pass, is shared by all that
    move: time passes when all of them wait for it."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._holders: dict[str, Holder] = {}
        self._moving: set[Holder] = set()

    def claim(self, holder: Holder, resources: Iterable[str], *, moves: bool) -> None:
        """Hold `resources`, and the clock where it `moves`. Raises `ToolError` code `lease`."""
        wanted = sorted({*resources} - {CLOCK})
        with self._lock:
            for resource in wanted:
                other = self._holders.get(resource)
                if other is not None and other is not holder:
                    raise ToolError(
                        "lease",
                        f"{holder.path} wants {resource}, which {other.path} holds.",
                        hint="Put one of the two behind the other with an edge.",
                    )
            for resource in wanted:
                self._holders[resource] = holder
            if moves:
                self._moving.add(holder)

    def holds(self, holder: Holder, resource: str) -> bool:
        """True while `holder` holds `resource`."""
        return holder in self._moving if resource == CLOCK else self._holders.get(resource) is holder

    def held(self) -> tuple[str, ...]:
        """Every resource held now, the clock included."""
        with self._lock:
            return (*sorted(self._holders), *([CLOCK] if self._moving else []))

    def arms_of(self, holder: Holder) -> set[int]:
        """The arm_id of every arm and gripper that it holds."""
        with self._lock:
            held = [r.partition(":") for r, other in self._holders.items() if other is holder]
        return {int(which) for kind, _, which in held if kind in ("arm", "gripper") and which.isdigit()}

    def release(self, holder: Holder) -> None:
        """Give back everything."""
        with self._lock:
            self._moving.discard(holder)
            for resource in [r for r, other in self._holders.items() if other is holder]:
                del self._holders[resource]
