"""Arms without motors and grippers without jaws, which keep their contracts in a `FakeCell`."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Literal, Protocol, TypeVar

import numpy as np

from gap_runtime.contracts.arm import NO_WRENCH, Compliance, ContactMotion, Setpoint
from gap_runtime.contracts.failures import MotionError
from gap_runtime.contracts.robot import GripperSpec, JointLimits, RobotSpec
from gap_runtime.contracts.simulator import Process
from gap_runtime.contracts.types import (
    ArmState,
    Array,
    GripperState,
    JointState,
    Quaternion,
    Se3Pose,
    Trajectory,
    Vec3,
    Wrench,
)

T = TypeVar("T")
STEP_S = 0.02
FORCE = 30.0  # [N] of jaws that find something
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


class Timeline(Protocol):
    """What a fake arm needs of its cell."""

    @property
    def time(self) -> float:
        """Cell time [s]."""

    def take(self, process: Process[T]) -> T:
        """Let cell time pass, `STEP_S` whenever the process yields, until it is over; its result."""


class FakeGripper:
    """Jaws that go where they are told; `object_width` [m] is what they find between them, None for nothing."""

    def __init__(self, arm: FakeArm, timeline: Timeline, spec: GripperSpec) -> None:
        self.spec = spec
        self.object_width: float | None = None
        self._arm, self._timeline = arm, timeline
        self._width, self._force, self._holding = spec.max_width, 0.0, False

    def state(self) -> GripperState:
        """Where the jaws are, and whether they found something."""
        return GripperState(self._width, self._width / self.spec.max_width, self._force, self._holding)

    def open(self, *, settle: float = 0.5, wait: bool = True) -> GripperState:
        """Open fully."""
        return self._timeline.take(self._drive("open", self.spec.max_width, None, settle if wait else 0.0))

    def close(self, *, force: float | None = None, settle: float = 0.5, wait: bool = True) -> GripperState:
        """Close, as far as `object_width`."""
        return self._timeline.take(self._drive("close", 0.0, force, settle if wait else 0.0))

    def set_width(
        self, width: float, *, force: float | None = None, settle: float = 0.5, wait: bool = True
    ) -> GripperState:
        """Set the jaws."""
        return self._timeline.take(self._drive("set_width", width, force, settle if wait else 0.0))

    def set_force(self, force: float) -> GripperState:
        """Squeeze what is held with `force` [N]."""
        self._arm.commands.append("set_force")
        self._force = force if self._holding else 0.0
        return self.state()

    def _drive(self, command: str, width: float, force: float | None, settle: float) -> Process[GripperState]:
        self._arm.commands.append(command)
        yield from steps(settle)
        found = self.object_width or 0.0
        self._holding = width < found
        self._width = float(np.clip(max(width, found), 0.0, self.spec.max_width))
        self._force = (force or FORCE) if self._holding else 0.0
        return self.state()


class FakeArm:
    """An arm whose joints go where they are told, in cell time; `commands` lists everything it was asked to do.

    `stops` counts calls of `stop`; `stop_problem` is raised by it, `deaf` makes it hang. `felt` says what its
    force-torque sensor reports at a cell time [s].
    """

    def __init__(self, timeline: Timeline, arm_id: int, spec: RobotSpec = FAKE_ROBOT) -> None:
        self.spec, self.base_pose = spec, Se3Pose(Vec3(-0.6, 0.0, 0.0), UPRIGHT)
        self.commands: list[str] = []
        self.stops = 0
        self.stop_problem: BaseException | None = None
        self.deaf = False
        self.felt: Callable[[float], Wrench] = lambda time: NO_WRENCH
        self.stopped = threading.Event()
        self.gripper = FakeGripper(self, timeline, spec.gripper)
        self._timeline, self._arm_id = timeline, arm_id
        self._joints = np.array(spec.home)
        self._tcp: Se3Pose | None = None  # where a compliant motion left it
        self._under_way: tuple[Trajectory, float] | None = None

    def state(self) -> ArmState:
        """Joints, gripper and a made-up TCP pose that depends on the joints."""
        x, y = float(np.cos(self._joints).sum()) / 4, float(np.sin(self._joints).sum()) / 4
        pose = self._tcp or Se3Pose(Vec3(x, y, 0.3), UPRIGHT)
        return ArmState(self._arm_id, JointState(self._joints), self.gripper.state(), pose)

    def wrench(self) -> Wrench:
        """What `felt` says now."""
        return self.felt(self._timeline.time)

    def execute(self, trajectory: Trajectory, *, tolerance: float = 0.01) -> None:
        """Follow the trajectory, one `STEP_S` of cell time after the other."""
        self._timeline.take(self._follow("execute", trajectory, lambda: False))

    def move_guarded(self, trajectory: Trajectory, *, force: float, tolerance: float = 0.01) -> ContactMotion:
        """Follow the trajectory until `felt` differs from what it was at the start."""
        before = self.wrench().force.array
        touched = self._timeline.take(
            self._follow(
                "move_guarded", trajectory, lambda: bool(np.linalg.norm(self.wrench().force.array - before) > force)
            )
        )
        return self._ended("contact" if touched else "reached")

    def move_compliant(
        self, target: Se3Pose, compliance: Compliance, *, force_limit: float, timeout: float, speed: float = 0.05
    ) -> ContactMotion:
        """Be at the target after the time that takes, whatever is felt on the way, up to the limit."""
        return self._timeline.take(self._yield_to(target, force_limit, timeout, speed))

    def _yield_to(self, target: Se3Pose, force_limit: float, timeout: float, speed: float) -> Process[ContactMotion]:
        self.commands.append("move_compliant")
        self.stopped.clear()
        yield from self._finish()
        start, began = self.state().ee_pose.position.array, self._timeline.time
        needed = float(np.linalg.norm(target.position.array - start)) / speed
        while self._timeline.time - began < min(needed, timeout) - 1e-9:
            yield
            self._raise_if_stopped()
            if np.linalg.norm(self.wrench().force.array) > force_limit:
                raise MotionError("force", f"Arm {self._arm_id} felt more than {force_limit:g} N.")
        share = min(1.0, timeout / needed) if needed else 1.0
        self._tcp = Se3Pose(Vec3.of(start + share * (target.position.array - start)), target.rotation)
        return self._ended("reached" if share == 1.0 else "timeout")

    def start(self, trajectory: Trajectory, *, tolerance: float = 0.01, replace: bool = False) -> None:
        """Begin to follow the trajectory; it goes on whenever cell time passes."""
        self._timeline.take(self._start(trajectory, replace))

    def _start(self, trajectory: Trajectory, replace: bool) -> Process[None]:
        self.commands.append("start")
        _refuse_not_finite(trajectory)
        self.stopped.clear()
        if not replace:
            yield from self._finish()
        self._under_way, self._tcp = (trajectory, self._timeline.time), None

    def finish(self) -> None:
        """Let time pass until what was started is done."""
        self._timeline.take(self._finish())

    def _finish(self) -> Process[None]:
        while self._under_way is not None:
            yield

    def setpoint(self) -> Setpoint:
        """Where the joints are, and how they move."""
        now, slope = self._joints, np.zeros_like(self._joints)
        goal = now
        if self._under_way is not None:
            trajectory, began = self._under_way
            slope = (_at(trajectory, self._timeline.time - began + STEP_S) - now) / STEP_S
            goal = trajectory.positions[-1]
        return Setpoint(now, slope, np.zeros_like(now), goal)

    def follow(self) -> None:
        """After time has passed: be where the trajectory that was started is by now."""
        if self._under_way is not None:
            trajectory, began = self._under_way
            self._joints = _at(trajectory, self._timeline.time - began)
            if self._timeline.time - began >= trajectory.duration - 1e-9:
                self.drop()

    def drop(self) -> None:
        """Forget what was started."""
        self._under_way = None

    def stop(self) -> None:
        """Stop following."""
        self.stops += 1
        self.stopped.set()
        self.drop()
        if self.deaf:
            threading.Event().wait(3600)
        if self.stop_problem is not None:
            raise self.stop_problem

    def _follow(self, command: str, trajectory: Trajectory, touched: Callable[[], bool]) -> Process[bool]:
        """Until the end (False) or until it has touched something (True)."""
        self.commands.append(command)
        _refuse_not_finite(trajectory)
        self.stopped.clear()
        yield from self._finish()
        self._tcp = None
        for t in np.arange(0.0, trajectory.duration + 1e-9, STEP_S):
            yield
            self._raise_if_stopped()
            self._joints = _at(trajectory, t)
            if touched():
                return True
        return False

    def _raise_if_stopped(self) -> None:
        if self.stopped.is_set():
            raise MotionError("stopped", f"Arm {self._arm_id} was stopped.")

    def _ended(self, reason: Literal["reached", "contact", "timeout"]) -> ContactMotion:
        return ContactMotion(reason, self.state().ee_pose, self.wrench())


def steps(seconds: float) -> Process[None]:
    """As many steps as it takes for `seconds` of cell time to pass."""
    yield from [None] * math.ceil(seconds / STEP_S - 1e-9)


def _at(trajectory: Trajectory, t: float) -> Array:
    times = trajectory.times - trajectory.times[0]
    return np.array([np.interp(t, times, column) for column in trajectory.positions.T])


def _refuse_not_finite(trajectory: Trajectory) -> None:
    if not np.isfinite(trajectory.positions).all():
        raise MotionError("refused", "The trajectory is not finite.")
