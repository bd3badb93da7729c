"""The world as a node's tools see it: leases are checked on every command, and a stopped node commands nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from time import monotonic
from typing import Any

from gap_runtime.contracts.cell import Arm, Cell, CellFrame, LockstepCell, Setpoint
from gap_runtime.contracts.failures import MotionError, PrivilegedReadError, ToolError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.simulator import Instance
from gap_runtime.contracts.snapshot import WorldSnapshot
from gap_runtime.contracts.types import ArmState, GripperState, Observation, Se3Pose, Trajectory
from gap_runtime.run.attempt import Attempt, deadline_error
from gap_runtime.run.leases import CLOCK, Leases


class GuardedCell:
    """A `World` for one attempt. What a robot could not do (`reset`, `snapshot`) raises `PrivilegedReadError`."""

    def __init__(self, cell: Cell, attempt: Attempt, leases: Leases) -> None:
        self._cell, self._attempt, self._leases = cell, attempt, leases
        if attempt.world_deadline == math.inf and not attempt.node.streaming:
            attempt.world_deadline = cell.time + attempt.deadline_s

    @property
    def arms(self) -> tuple[GuardedArm, ...]:
        """By arm_id."""
        return tuple(GuardedArm(arm, i, self) for i, arm in enumerate(self._cell.arms))

    @property
    def time(self) -> float:
        """World time [s]."""
        return self._cell.time

    @property
    def camera_names(self) -> tuple[str, ...]:
        """All cameras."""
        return self._cell.camera_names

    def observe(self, cameras: Sequence[str] | None = None) -> Observation:
        """RGB-D of the named cameras and the arms' states."""
        with self.inside():
            return self._cell.observe(cameras)

    def camera_pose(self, name: str) -> Se3Pose:
        """T_world_camera (optical)."""
        with self.inside():
            return self._cell.camera_pose(name)

    def wait(self, seconds: float) -> None:
        """Let world time pass; only for a node that moves things."""
        with self.inside(CLOCK):
            self._cell.wait(seconds)

    def execute(self, motions: Mapping[int, Trajectory], *, tolerance: float = 0.01) -> None:
        """Move several arms at once; needs the lease of each. Raises `MotionError` (`unsupported`)."""
        if not isinstance(self._cell, LockstepCell):
            raise MotionError("unsupported", "This world cannot move several arms at once.", hint="Move one by one.")
        with self.inside(*(f"arm:{arm_id}" for arm_id in sorted(motions))):
            self._cell.execute(motions, tolerance=tolerance)

    def subscribe(
        self, listener: Callable[[CellFrame], None], hz: float, cameras: Sequence[str] = ()
    ) -> Callable[[], None]:
        """Not for nodes: they read `in.observation_stream`."""
        raise self._privileged("the world's own frames")

    def snapshot(self) -> WorldSnapshot:
        """Ground truth is not for nodes."""
        raise self._privileged("the world's state")

    def sample(self, seed: int) -> Instance:
        """Instances are not for nodes."""
        raise self._privileged("the belief space")

    def reset(self, instance: Instance) -> None:
        """Resetting is not for nodes."""
        raise self._privileged("a fresh episode")

    def close(self) -> None:
        """Closing is not for nodes."""
        raise self._privileged("the end of the world")

    @contextmanager
    def inside(self, *resources: str) -> Iterator[None]:
        """Around a call into the world: check before, measure, and check again after."""
        attempt = self._attempt
        attempt.check()
        for resource in resources:
            if not self._leases.holds(attempt, resource):
                raise ToolError(
                    "lease",
                    f"{attempt.node.path} commands {resource} without holding it.",
                    hint="The tool must declare effect 'actuate' and this resource.",
                )
        start = monotonic()
        try:
            yield
        finally:
            attempt.world_wall_s += monotonic() - start
        attempt.check()
        if self._cell.time > attempt.world_deadline:
            raise deadline_error(attempt)

    def _privileged(self, what: str) -> PrivilegedReadError:
        return PrivilegedReadError(
            f"Node {self._attempt.node.path!r} asked for {what}, which only the simulator's keeper may have.",
            hint="A policy sees cameras, joint states, gripper width and forces; use those.",
        )

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._cell, name)  # a provider made for one world may use what it adds


class GuardedArm:
    """An `Arm` that obeys one attempt, while it holds the arm."""

    def __init__(self, arm: Arm, arm_id: int, cell: GuardedCell) -> None:
        self._arm, self._id, self._cell = arm, arm_id, cell

    @property
    def spec(self) -> RobotSpec:
        """The robot's names, limits and shape."""
        return self._arm.spec

    @property
    def base_pose(self) -> Se3Pose:
        """T_world_base."""
        return self._arm.base_pose

    def state(self) -> ArmState:
        """Joints, gripper and forward kinematics."""
        with self._cell.inside():
            return self._arm.state()

    def execute(self, trajectory: Trajectory, *, tolerance: float = 0.01) -> None:
        """Track a joint trajectory; needs the lease of this arm."""
        with self._cell.inside(f"arm:{self._id}"):
            self._arm.execute(trajectory, tolerance=tolerance)

    def start(self, trajectory: Trajectory, *, tolerance: float = 0.01, replace: bool = False) -> None:
        """Begin to track a joint trajectory; needs the lease of this arm now, not for as long as it moves."""
        with self._cell.inside(f"arm:{self._id}"):
            self._arm.start(trajectory, tolerance=tolerance, replace=replace)

    def finish(self) -> None:
        """Let what was started come to its end; needs the lease of this arm."""
        with self._cell.inside(f"arm:{self._id}"):
            self._arm.finish()

    def setpoint(self) -> Setpoint:
        """Where the controller wants the joints."""
        with self._cell.inside():
            return self._arm.setpoint()

    def set_gripper(
        self, width: float, *, force: float | None = None, settle: float = 0.5, wait: bool = True
    ) -> GripperState:
        """Drive the jaws; needs the lease of this gripper."""
        with self._cell.inside(f"gripper:{self._id}"):
            return self._arm.set_gripper(width, force=force, settle=settle, wait=wait)

    def stop(self) -> None:
        """Stop and hold. Always allowed."""
        self._arm.stop()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._arm, name)
