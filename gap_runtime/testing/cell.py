"""A cell without physics, on a clock that is stepped or runs by itself."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from time import monotonic, sleep
from typing import cast

import numpy as np

from gap_runtime.contracts.access import assert_privileged
from gap_runtime.contracts.cell import CellFrame
from gap_runtime.contracts.failures import UnknownNameError
from gap_runtime.contracts.simulator import Instance, Process, SteppedClock, TimedCommand
from gap_runtime.contracts.snapshot import ArmTruth, BodyState, WorldSnapshot
from gap_runtime.contracts.types import (
    CameraObservation,
    DepthImage,
    Image,
    Matrix3x3,
    Observation,
    OrientedBoundingBox,
    Quaternion,
    Se3Pose,
    Vec3,
)
from gap_runtime.testing.arm import STEP_S, UPRIGHT, FakeArm, T, steps


class FakeCell:
    """A cell of boxes that never move. `pace` is wall seconds per second of cell time (0: as fast as it can).

    With `real_time` time passes by itself, `pace` (then not 0) wall seconds to the second; else commands step it.
    """

    def __init__(
        self, *, arms: int = 1, objects: Mapping[str, Vec3] | None = None, pace: float = 0.0, real_time: bool = False
    ) -> None:
        self.arms: tuple[FakeArm, ...] = tuple(FakeArm(self, i) for i in range(arms))
        self.camera_names: tuple[str, ...] = ("agentview", "wrist")
        self.real_time = real_time
        self.clock = SteppedClock(lambda call: call(), self._step)
        self._time, self._began = 0.0, monotonic()
        self._pace = pace
        self._lock = threading.Lock()
        self._home = {name: Se3Pose(p, UPRIGHT) for name, p in (objects or {"can": Vec3(0.0, 0.1, 0.05)}).items()}
        self._poses = dict(self._home)
        self._start: WorldSnapshot | None = None
        self._listeners: dict[int, tuple[Callable[[CellFrame], None], float, float]] = {}
        self.closed = False

    @property
    def time(self) -> float:
        """Cell time [s]."""
        return (monotonic() - self._began) / self._pace if self.real_time else self._time

    def sample(self, seed: int) -> Instance:
        """Every object within 5 cm of where it was put when the world was made."""
        rng = np.random.default_rng(seed)
        poses = {n: Se3Pose(Vec3.of(p.position.array + rng.uniform(-0.05, 0.05, 3) * [1, 1, 0]), UPRIGHT)
                 for n, p in sorted(self._home.items())}  # fmt: skip
        return Instance(seed, "fake", poses)

    def reset(self, instance: Instance) -> None:
        """Put the objects where the instance says, and the clock to 0."""
        assert_privileged("a fresh episode")
        for arm in self.arms:
            arm.drop()
        self._poses = dict(instance.poses)
        self._time, self._began, self._start = 0.0, monotonic(), None
        self._start = self.snapshot()

    def observe(self, cameras: Sequence[str] | None = None) -> Observation:
        """Tiny grey frames, stamped with cell time."""
        frames = tuple(self._frame(name) for name in cameras or self.camera_names)
        return Observation(frames, tuple(arm.state() for arm in self.arms), self.time)

    def camera_pose(self, name: str) -> Se3Pose:
        """One metre above the origin, looking down."""
        if name not in self.camera_names:
            raise UnknownNameError("camera", name, self.camera_names)
        return Se3Pose(Vec3(0.0, 0.0, 1.0), Quaternion(0.0, 1.0, 0.0, 0.0))

    def wait(self, seconds: float) -> None:
        """Let cell time pass."""
        self.take(steps(seconds))

    def snapshot(self) -> WorldSnapshot:
        """Ground truth."""
        assert_privileged("the world's state")
        bodies = {name: _body(name, pose) for name, pose in self._poses.items()}
        arms = tuple(
            ArmTruth(tuple(s.joints.positions), s.ee_pose, s.gripper.width) for s in (a.state() for a in self.arms)
        )
        return WorldSnapshot(self.time, bodies, {}, arms, start=self._start)

    def subscribe(
        self, listener: Callable[[CellFrame], None], hz: float, cameras: Sequence[str] = ()
    ) -> Callable[[], None]:
        """Call `listener` at `hz` of cell time."""
        key = max(self._listeners, default=0) + 1
        self._listeners[key] = (listener, 1.0 / hz, self.time)
        return lambda: self._listeners.pop(key, None) and None

    def close(self) -> None:
        """Nothing to free."""
        self.closed = True

    def take(self, process: Process[T]) -> T:
        """Let time pass, `STEP_S` whenever the process yields, until it is over; its result."""
        if not self.real_time:
            return self.clock.run(process)
        command = TimedCommand(process)
        command.resume()
        while not command.over:
            sleep(STEP_S * self._pace)
            with self._lock:
                self._update()
                command.resume()
        return cast(T, command.result())

    def _step(self) -> None:
        with self._lock:
            self._time += STEP_S
            self._update()
        if self._pace:
            sleep(STEP_S * self._pace)

    def _update(self) -> None:
        """Time has passed: move what was started, and call the listeners that are due."""
        for arm in self.arms:
            arm.follow()
        for key, (listener, period, last) in list(self._listeners.items()):
            if self.time >= last + period - 1e-9:
                self._listeners[key] = (listener, period, self.time)
                listener(CellFrame(self.time, self.observe(), None))

    def _frame(self, name: str) -> CameraObservation:
        rgb = np.full((4, 6, 3), 128, np.uint8)
        K = Matrix3x3(np.array([[6.0, 0, 3], [0, 6.0, 2], [0, 0, 1]]))
        depth = DepthImage(np.ones((4, 6), np.float32))
        return CameraObservation(name, Image(rgb), depth, K, self.camera_pose(name), self.time)


def _body(name: str, pose: Se3Pose) -> BodyState:
    box = OrientedBoundingBox(pose.position, Vec3(0.03, 0.03, 0.05), pose.rotation)
    return BodyState(name, pose, box, 0.0, 0.0, frozenset({"floor"}))
