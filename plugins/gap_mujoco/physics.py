"""Physics, one guarded step at a time: what blows up, resets itself or runs backwards voids the episode."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import mujoco
import numpy as np

from gap_mujoco.model.compiled import TIMESTEP
from gap_mujoco.model.scene import Scene
from gap_runtime.contracts.failures import GapError, SimulationDivergedError
from gap_runtime.contracts.simulator import Process

_MAX_SPEED = 100.0  # m/s or rad/s: nothing in a cell moves faster and is still physics


class Physics:
    """State and clock of a compiled cell.

    Before every step `writers` write actuator controls; after it `observers` are called, which must not change
    anything, then `updaters` prepare the next.
    """

    period = TIMESTEP  # [s]

    def __init__(self, scene: Scene) -> None:
        self.model, self.data = scene.model, mujoco.MjData(scene.model)
        self.writers: Sequence[Callable[[], None]] = ()
        self.updaters: Sequence[Callable[[], None]] = ()
        self.observers: list[Callable[[], None]] = []
        self._clock = 0.0
        self.placed = False  # before the first reset there is nothing to simulate

    @property
    def time(self) -> float:
        """[s] since reset."""
        return float(self.data.time)

    def clear(self) -> None:
        """Back to the model's initial state, at time zero."""
        mujoco.mj_resetData(self.model, self.data)
        self._clock = 0.0

    def forward(self) -> None:
        """Make positions, contacts and sensors agree with the joints, without moving time."""
        mujoco.mj_forward(self.model, self.data)

    def start_clock(self) -> None:
        """Call this instant time zero."""
        self.data.time = self._clock = 0.0

    def step(self) -> None:
        """One time step. Raises `SimulationDivergedError`, or `GapError` before the first reset."""
        self.require_placed()
        for write in self.writers:
            write()
        mujoco.mj_step(self.model, self.data)
        before, self._clock = self._clock, self.data.time
        if not 0 < self._clock - before < 2 * TIMESTEP:
            raise SimulationDivergedError(f"Simulated time jumped from {before:.3f} s to {self._clock:.3f} s.")
        self._check()
        for observer in tuple(self.observers):
            observer()
        for update in self.updaters:
            update()

    def require_placed(self) -> None:
        """Raise `GapError` before the first reset."""
        if not self.placed:
            raise GapError("The cell is empty until it is reset.", hint="Call simulator.reset(simulator.sample(seed)).")

    def run(self, seconds: float) -> None:
        """Let `seconds` of world time pass, in whole steps."""
        for _ in range(round(seconds / TIMESTEP)):
            self.step()

    def wait(self, seconds: float) -> Process[None]:
        """The same as a process."""
        self.require_placed()
        yield from [None] * round(seconds / TIMESTEP)

    @contextmanager
    def unobserved(self) -> Iterator[None]:
        """Steps in here are no part of an episode: nobody is told of them."""
        observers, self.observers = self.observers, []
        try:
            yield
        finally:
            self.observers = observers

    def _check(self) -> None:
        """Raise `SimulationDivergedError` when the state is no longer physics."""
        warned = self.data.warning.number
        if warned.any():
            names = ", ".join(mujoco.mjtWarning(int(i)).name.removeprefix("mjWARN_") for i in np.flatnonzero(warned))
            raise SimulationDivergedError(f"The simulation warned of {names} at {self.time:.3f} s.")
        speed = np.abs(self.data.qvel).max(initial=0.0)
        if not speed < _MAX_SPEED:
            raise SimulationDivergedError(f"Something moves at {speed:.0f} m/s or rad/s at {self.time:.3f} s.")
