"""The simulator's own tools: `sim_bridge.*`."""

from __future__ import annotations

from typing import Any, NamedTuple

from gap_runtime.contracts.tool import ToolRequest
from gap_runtime.contracts.types import (
    ArmState,
    CameraObservation,
    JointState,
    ObjectPose,
    Observation,
)

ARM = ("arm:0", "gripper:0", "clock")


class SimulatorStart(NamedTuple):
    """What the simulator can do, or why it cannot start."""

    success: bool
    capabilities: dict[str, Any]
    error_message: str


class FirstObservation(NamedTuple):
    """The first observation of an episode."""

    observation: Observation


class StepResult(NamedTuple):
    """What one step led to. `truncated`: it took longer than it was granted."""

    observation: Observation
    reward: float
    terminated: bool
    truncated: bool


class TrueState(NamedTuple):
    """Sensors and ground truth at one instant."""

    arm_states: list[ArmState]
    cameras: list[CameraObservation]
    objects: list[ObjectPose]


class TaskScore(NamedTuple):
    """How far the task is done."""

    reward: float
    task_completed: bool
    completion_rate: float


class SavedVideo(NamedTuple):
    """A video on disk."""

    success: bool
    file_path: str
    num_frames: int


class InitSimulator(ToolRequest[SimulatorStart], tool="sim_bridge.Init", effect="sense", privileged=True):
    """Check that the world that runs is the one that is wanted, and say what it offers.

    The world is made by whoever runs the graph; this loads nothing. `env_name` is the world's or the task's name,
    `suite_name` the variant, `task_id` the scene; a `config_path` cannot be honoured.
    """

    env_name: str
    config_path: str | None = None
    camera_names: list[str] | None = None
    task_id: str | None = None
    suite_name: str | None = None


class ResetSimulator(
    ToolRequest[FirstObservation],
    tool="sim_bridge.Reset",
    effect="actuate",
    resources=ARM,
    deadline_s=60,
    privileged=True,
):
    """Begin a new episode with the instance of this seed. Raises `TaskInfeasibleError`."""

    seed: int


class StepOnce(
    ToolRequest[StepResult], tool="sim_bridge.StepOnce", effect="actuate", resources=ARM, deadline_s=30, privileged=True
):
    """Let one control step pass, after driving the jaws to a fraction of their opening (-1: leave them)."""

    gripper_fraction: float = -1


class MoveToJointsBlocking(
    ToolRequest[StepResult],
    tool="sim_bridge.MoveToJointsBlocking",
    effect="actuate",
    resources=ARM,
    deadline_s=60,
    privileged=True,
):
    """Move the first arm to a joint configuration along a straight line in joint space, at half its limits.

    `truncated` says that it did not get there, to within `tolerance` [rad]. Raises `BadRequestError` when the motion
    needs more than `max_steps` control steps, `MotionError` when something is in the way.
    """

    target_joints: JointState
    tolerance: float = 0.01
    max_steps: int = 120


class SetGripper(
    ToolRequest[None], tool="sim_bridge.SetGripper", effect="actuate", resources=("gripper:{arm_id}", "clock")
):
    """Drive the jaws to a fraction of their opening: 0 closed, 1 open."""

    fraction: float
    arm_id: int = 0


class GetTrueState(ToolRequest[TrueState], tool="sim_bridge.GetState", effect="sense", privileged=True):
    """Every camera, every arm, and the true pose of every object."""


class CheckTaskCompletion(
    ToolRequest[TaskScore], tool="sim_bridge.CheckTaskCompletion", effect="sense", privileged=True
):
    """Judge the task's success conditions now; the goal is the scene's own unless `target` or `container` name another.

    The reward is the task's success weight once all conditions hold, else 0.
    """

    target: str = ""
    container: str = ""


class EnableVideoCapture(ToolRequest[None], tool="sim_bridge.EnableVideoCapture", effect="sense", privileged=True):
    """Start or stop filming the first camera at 20 frames per second of world time; `clear` forgets what was filmed."""

    enabled: bool
    clear: bool


class SaveVideo(ToolRequest[SavedVideo], tool="sim_bridge.SaveVideo", effect="sense", deadline_s=60, privileged=True):
    """Write what was filmed to an .mp4 file; `clear` forgets it afterwards. Raises `BadRequestError`."""

    output_path: str
    clear: bool
    fps: int = 20
