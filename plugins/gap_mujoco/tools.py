"""The simulator's own tools (`sim_bridge.*`): set up, reset, step, score, film. Policies may use SetGripper alone."""

from __future__ import annotations

from typing import Any, NamedTuple

from gap_runtime.contracts.failures import BadRequestError, MotionError, UnknownNameError
from gap_runtime.contracts.simulator import simulator_of
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import (
    ArmState,
    CameraObservation,
    JointState,
    ObjectPose,
    Observation,
)

STEP = 0.05  # [s] of world time: one control step at 20 Hz, as in the suites these tools come from
ARM = ("arm:0", "gripper:0", "clock")
FILM = "sim_bridge.film"  # key of the camera's film in the episode's state


class Started(NamedTuple):
    """What the simulator can do, or why it cannot start."""

    success: bool
    capabilities: dict[str, Any]
    error_message: str


class Fresh(NamedTuple):
    """The first observation of an episode."""

    observation: Observation


class Stepped(NamedTuple):
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


class Score(NamedTuple):
    """How far the task is done."""

    reward: float
    task_completed: bool
    completion_rate: float


class Film(NamedTuple):
    """A video on disk."""

    success: bool
    file_path: str
    num_frames: int


@tool("sim_bridge.Init", effect="sense", privileged=True)
def init(
    ctx: ToolContext,
    env_name: str,
    config_path: str | None = None,
    camera_names: list[str] | None = None,
    task_id: str | None = None,
    suite_name: str | None = None,
) -> Started:
    """Check that the world that runs is the one that is wanted, and say what it offers.

    The world is made by whoever runs the graph; this loads nothing. `env_name` is the world's or the task's name,
    `suite_name` the variant, `task_id` the scene; a `config_path` cannot be honoured.
    """
    wanted = [
        ("env_name", env_name, {ctx.task.environment.simulator, ctx.task.name}),
        ("suite_name", suite_name, {ctx.task.variant, ctx.task.name}),
        ("task_id", task_id, {_scene(ctx)}),
        ("config_path", config_path, set()),
        *(("camera_names", name, set(ctx.cell.camera_names)) for name in camera_names or []),
    ]
    for key, value, known in wanted:
        if value is not None and value not in known:
            return Started(False, {}, str(UnknownNameError(key, value, known)))
    capabilities = {
        "simulator": ctx.task.environment.simulator, "task": ctx.task.name, "scene": _scene(ctx),
        "cameras": list(ctx.cell.camera_names), "arms": [arm.spec.name for arm in ctx.cell.arms], "step_s": STEP,
    }  # fmt: skip
    return Started(True, capabilities, "")


@tool("sim_bridge.Reset", effect="actuate", resources=ARM, deadline_s=60, privileged=True)
def reset(ctx: ToolContext, seed: int) -> Fresh:
    """Begin a new episode with the instance of this seed. Raises `TaskInfeasibleError`."""
    simulator = simulator_of(ctx.cell)
    simulator.reset(simulator.sample(seed))
    for key in [k for k in ctx.state if k != FILM]:
        del ctx.state[key]
    return Fresh(ctx.cell.observe())


@tool("sim_bridge.StepOnce", effect="actuate", resources=ARM, deadline_s=30, privileged=True)
def step_once(ctx: ToolContext, gripper_fraction: float = -1) -> Stepped:
    """Let one control step pass, after driving the jaws to a fraction of their opening (-1: leave them)."""
    if gripper_fraction != -1:
        _drive_jaws(ctx, gripper_fraction, 0)
    ctx.cell.wait(STEP)
    return _stepped(ctx, truncated=False)


@tool("sim_bridge.MoveToJointsBlocking", effect="actuate", resources=ARM, deadline_s=60, privileged=True)
def move_to_joints(
    ctx: ToolContext, target_joints: JointState, tolerance: float = 0.01, max_steps: int = 120
) -> Stepped:
    """Move the first arm to a joint configuration along a straight line in joint space, at half its limits.

    `truncated` says that it did not get there, to within `tolerance` [rad]. Raises `BadRequestError` when the motion
    needs more than `max_steps` control steps, `MotionError` when something is in the way.
    """
    from gap_mujoco.control.point_to_point import joint_move

    arm = ctx.cell.arms[0]
    arm.finish()
    trajectory = joint_move(arm.spec, arm.state().joints.positions, target_joints.positions)
    if trajectory.duration > max_steps * STEP:
        need = int(trajectory.duration / STEP) + 1
        raise BadRequestError("max_steps", f"The motion takes {need} control steps, more than max_steps {max_steps}.")
    try:
        arm.execute(trajectory, tolerance=tolerance)
    except MotionError as error:
        if error.code != "stalled":
            raise
        return _stepped(ctx, truncated=True)
    return _stepped(ctx, truncated=False)


@tool("sim_bridge.SetGripper", effect="actuate", resources=("gripper:{arm_id}", "clock"))
def set_gripper(ctx: ToolContext, fraction: float, arm_id: int = 0) -> None:
    """Drive the jaws to a fraction of their opening: 0 closed, 1 open."""
    _drive_jaws(ctx, fraction, arm_id)


@tool("sim_bridge.GetState", effect="sense", privileged=True)
def get_state(ctx: ToolContext) -> TrueState:
    """Every camera, every arm, and the true pose of every object."""
    seen, true = ctx.cell.observe(), simulator_of(ctx.cell).snapshot()
    objects = [ObjectPose(name, body.pose) for name, body in sorted(true.bodies.items())]
    return TrueState(list(seen.arm_states), list(seen.cameras), objects)


@tool("sim_bridge.CheckTaskCompletion", effect="sense", privileged=True)
def check_task_completion(ctx: ToolContext, target: str = "", container: str = "") -> Score:
    """Judge the task's success conditions now; the goal is the scene's own unless `target` or `container` name another.

    The reward is the task's success weight once all conditions hold, else 0.
    """
    from gap_mujoco.scoring import conditions

    found = conditions(ctx.task, _scene(ctx), simulator_of(ctx.cell).snapshot(), target, container)
    done = all(found.values())
    return Score(ctx.task.reward.success_weight * done, done, sum(found.values()) / len(found))


@tool("sim_bridge.EnableVideoCapture", effect="sense", privileged=True)
def enable_video_capture(ctx: ToolContext, enabled: bool, clear: bool) -> None:
    """Start or stop filming the first camera at 20 frames per second of world time; `clear` forgets what was filmed."""
    from gap_mujoco.rendering.video import Reel

    reel = ctx.state.setdefault(FILM, Reel(ctx.cell.camera_names[0]))
    if clear:
        reel.clear()
    if enabled:
        reel.start(ctx.cell)
    else:
        reel.stop()


@tool("sim_bridge.SaveVideo", effect="sense", deadline_s=60, privileged=True)
def save_video(ctx: ToolContext, output_path: str, clear: bool, fps: int = 20) -> Film:
    """Write what was filmed to an .mp4 file; `clear` forgets it afterwards. Raises `BadRequestError`."""
    from gap_mujoco.rendering.video import Reel

    reel = ctx.state.get(FILM)
    if not isinstance(reel, Reel) or not len(reel):
        return Film(False, "", 0)
    count = reel.save(output_path, fps)
    if clear:
        reel.clear()
    return Film(True, output_path, count)


def _scene(ctx: ToolContext) -> str:
    return str(getattr(ctx.cell, "scene", ""))


def _drive_jaws(ctx: ToolContext, fraction: float, arm_id: int) -> None:
    arms = ctx.cell.arms
    if not 0 <= arm_id < len(arms):
        raise UnknownNameError("arm", str(arm_id), map(str, range(len(arms))))
    if not 0 <= fraction <= 1:
        raise BadRequestError("range", f"A jaw opening of {fraction} is outside 0 (closed) to 1 (open).")
    arms[arm_id].gripper.set_width(fraction * arms[arm_id].spec.gripper.max_width)


def _stepped(ctx: ToolContext, *, truncated: bool) -> Stepped:
    from gap_mujoco.scoring import conditions

    done = all(conditions(ctx.task, _scene(ctx), simulator_of(ctx.cell).snapshot()).values())
    late = ctx.cell.time > ctx.task.max_time
    return Stepped(ctx.cell.observe(), ctx.task.reward.success_weight * done, done, truncated or late)


TOOLS = (
    init, reset, step_once, move_to_joints, set_gripper, get_state, check_task_completion, enable_video_capture,
    save_video,
)  # fmt: skip
