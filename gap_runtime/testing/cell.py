"""A world without physics and arms without motors."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from gap_runtime.contracts.cell import CellFrame, Setpoint
from gap_runtime.contracts.failures import MotionError, UnknownNameError
from gap_runtime.contracts.privilege import assert_privileged
from gap_runtime.contracts.robot import GripperSpec, JointLimits, RobotSpec
from gap_runtime.contracts.simulator import Instance
from gap_runtime.contracts.snapshot import ArmTruth, BodyState, WorldSnapshot
from gap_runtime.contracts.types import (
    ArmState,
    Array,
    CameraObservation,
    DepthImage,
    GripperState,
    Image,
    JointState,
    Matrix3x3,
    Observation,
    OrientedBoundingBox,
    Quaternion,
    Se3Pose,
    Trajectory,
    Vec3,
)

STEP_S = 0.02
UPRIGHT = Quaternion(1.0, 0.0, 0.0, 0.0)
FAKE_ROBOT = RobotSpec(
    name="fake",
    model_file=Path("fake.xml"),
    base_link="base",
    flange_link="flange",
    joints=("shoulder", "elbow"),
    limits=(JointLimits(-3.0, 3.0, 2.0, 10.0, 100.0, 50.0),) * 2,
    home=(0.0, 0.0),
    tcp_offset_position=(0.0, 0.0, 0.1),
    tcp_offset_quaternion=(1.0, 0.0, 0.0, 0.0),
    gripper=GripperSpec(0.08, 70.0, 0.1, 0.02, (0.01, 0.01, 0.02), ("finger",)),
    tcp_velocity=1.0,
    reach=0.8,
)


class FakeArm:
    """An arm whose joints go where they are told, in world time; `commands` lists everything it was asked to do.

    `stops` counts calls of `stop`; `stop_problem` is raised by it, `deaf` makes it hang.
    """

    def __init__(self, cell: FakeCell, arm_id: int, spec: RobotSpec = FAKE_ROBOT) -> None:
        self.spec, self.base_pose = spec, Se3Pose(Vec3(-0.6, 0.0, 0.0), UPRIGHT)
        self.commands: list[str] = []
        self.stops = 0
        self.stop_problem: BaseException | None = None
        self.deaf = False
        self._cell, self._arm_id = cell, arm_id
        self._joints = np.array(spec.home)
        self._width = spec.gripper.max_width
        self._stop = threading.Event()
        self._under_way: tuple[Trajectory, float] | None = None

    def state(self) -> ArmState:
        """Joints, gripper and a made-up TCP pose that depends on the joints."""
        x, y = float(np.cos(self._joints).sum()) / 4, float(np.sin(self._joints).sum()) / 4
        gripper = GripperState(self._width, self._width / self.spec.gripper.max_width)
        return ArmState(self._arm_id, JointState(self._joints), gripper, Se3Pose(Vec3(x, y, 0.3), UPRIGHT))

    def execute(self, trajectory: Trajectory, *, tolerance: float = 0.01) -> None:
        """Follow the trajectory, one `STEP_S` of world time after the other."""
        self.commands.append("execute")
        _refuse_not_finite(trajectory)
        self._stop.clear()
        self.finish()
        for t in np.arange(0.0, trajectory.duration + 1e-9, STEP_S):
            self._cell.advance(STEP_S, self._stop)
            if self._stop.is_set():
                raise MotionError("stopped", f"Arm {self._arm_id} was stopped.")
            self._joints = _at(trajectory, t)

    def start(self, trajectory: Trajectory, *, tolerance: float = 0.01, replace: bool = False) -> None:
        """Begin to follow the trajectory; it goes on whenever world time passes."""
        self.commands.append("start")
        _refuse_not_finite(trajectory)
        self._stop.clear()
        if not replace:
            self.finish()
        self._under_way = (trajectory, self._cell.time)

    def finish(self) -> None:
        """Let time pass until what was started is done."""
        while self._under_way is not None:
            self._cell.advance(STEP_S, self._stop)

    def setpoint(self) -> Setpoint:
        """Where the joints are, and how they move."""
        now, slope = self._joints, np.zeros_like(self._joints)
        goal = now
        if self._under_way is not None:
            trajectory, began = self._under_way
            slope = (_at(trajectory, self._cell.time - began + STEP_S) - now) / STEP_S
            goal = trajectory.positions[-1]
        return Setpoint(now, slope, np.zeros_like(now), goal)

    def follow(self) -> None:
        """After time has passed: be where the trajectory that was started is by now."""
        if self._under_way is not None:
            trajectory, began = self._under_way
            self._joints = _at(trajectory, self._cell.time - began)
            if self._cell.time - began >= trajectory.duration - 1e-9:
                self.drop()

    def drop(self) -> None:
        """Forget what was started."""
        self._under_way = None

    def set_gripper(
        self, width: float, *, force: float | None = None, settle: float = 0.5, wait: bool = True
    ) -> GripperState:
        """Set the jaws."""
        self.commands.append("set_gripper")
        if wait:
            self._cell.advance(settle, self._stop)
        self._width = float(np.clip(width, 0.0, self.spec.gripper.max_width))
        return self.state().gripper

    def stop(self) -> None:
        """Stop following."""
        self.stops += 1
        self._stop.set()
        self.drop()
        if self.deaf:
            threading.Event().wait(3600)
        if self.stop_problem is not None:
            raise self.stop_problem


class FakeCell:
    """A world of boxes that never move. `pace` is wall seconds per second of world time (0: as fast as it can)."""

    def __init__(
        self, *, arms: int = 1, objects: Mapping[str, Vec3] | None = None, pace: float = 0.0, real_time: bool = False
    ) -> None:
        self.arms: tuple[FakeArm, ...] = tuple(FakeArm(self, i) for i in range(arms))
        self.camera_names: tuple[str, ...] = ("agentview", "wrist")
        self.real_time = real_time
        self.time = 0.0
        self._pace = pace
        self._lock = threading.Lock()
        self._home = {name: Se3Pose(p, UPRIGHT) for name, p in (objects or {"can": Vec3(0.0, 0.1, 0.05)}).items()}
        self._poses = dict(self._home)
        self._start: WorldSnapshot | None = None
        self._listeners: dict[int, tuple[Callable[[CellFrame], None], float, float]] = {}
        self.closed = False

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
        self.time, self._start = 0.0, None
        self._start = self.snapshot()

    def observe(self, cameras: Sequence[str] | None = None) -> Observation:
        """Tiny grey frames, stamped with world time."""
        frames = tuple(self._frame(name) for name in cameras or self.camera_names)
        return Observation(frames, tuple(arm.state() for arm in self.arms), self.time)

    def camera_pose(self, name: str) -> Se3Pose:
        """One metre above the origin, looking down."""
        if name not in self.camera_names:
            raise UnknownNameError("camera", name, self.camera_names)
        return Se3Pose(Vec3(0.0, 0.0, 1.0), Quaternion(0.0, 1.0, 0.0, 0.0))

    def wait(self, seconds: float) -> None:
        """Let world time pass."""
        self.advance(seconds, None)

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
        """Call `listener` at `hz` of world time."""
        key = max(self._listeners, default=0) + 1
        self._listeners[key] = (listener, 1.0 / hz, self.time)
        return lambda: self._listeners.pop(key, None) and None

    def close(self) -> None:
        """Nothing to free."""
        self.closed = True

    def advance(self, seconds: float, stop: threading.Event | None) -> None:
        """Let time pass, call the listeners that are due, and take as long as `pace` says."""
        with self._lock:
            self.time += seconds
            for arm in self.arms:
                arm.follow()
            for key, (listener, period, last) in list(self._listeners.items()):
                if self.time >= last + period - 1e-9:
                    self._listeners[key] = (listener, period, self.time)
                    listener(CellFrame(self.time, self.observe(), None))
        if self._pace:
            (stop or threading.Event()).wait(seconds * self._pace)

    def _frame(self, name: str) -> CameraObservation:
        rgb = np.full((4, 6, 3), 128, np.uint8)
        K = Matrix3x3(np.array([[6.0, 0, 3], [0, 6.0, 2], [0, 0, 1]]))
        depth = DepthImage(np.ones((4, 6), np.float32))
        return CameraObservation(name, Image(rgb), depth, K, self.camera_pose(name), self.time)


def _at(trajectory: Trajectory, t: float) -> Array:
    times = trajectory.times - trajectory.times[0]
    return np.array([np.interp(t, times, column) for column in trajectory.positions.T])


def _refuse_not_finite(trajectory: Trajectory) -> None:
    if not np.isfinite(trajectory.positions).all():
        raise MotionError("refused", "The trajectory is not finite.")


def _body(name: str, pose: Se3Pose) -> BodyState:
    box = OrientedBoundingBox(pose.position, Vec3(0.03, 0.03, 0.05), pose.rotation)
    return BodyState(name, pose, box, 0.0, 0.0, frozenset({"floor"}))
