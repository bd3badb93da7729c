"""Calls a listener at its own rate of world time, with a frame taken for it."""

from __future__ import annotations

from collections.abc import Callable

from gap_runtime.contracts.cell import CellFrame


class Subscription:
    """One subscription. Called after every physics step; `take` makes a frame when one is due."""

    def __init__(
        self,
        listener: Callable[[CellFrame], None],
        hz: float,
        clock: Callable[[], float],
        take: Callable[[], CellFrame],
    ) -> None:
        self._listener, self._period, self._clock, self._take = listener, 1 / hz, clock, take
        self._last, self._count = 0.0, 0

    def __call__(self) -> None:
        """Deliver a frame when the next one is due."""
        now = self._clock()
        if now < self._last:  # a new episode
            self._count = 0
        self._last = now
        if now >= self._count * self._period - 1e-9:
            self._count = int(now / self._period + 1e-9) + 1
            self._listener(self._take())
