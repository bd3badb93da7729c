"""The simulator's own tools (`sim_bridge.*`): set up, reset, step, score, film. Policies may use SetGripper alone."""

from __future__ import annotations

from gap_catalogue.sim_bridge import (
    CheckTaskCompletion,
    EnableVideoCapture,
    FirstObservation,
    GetTrueState,
    InitSimulator,
    MoveToJointsBlocking,
    ResetSimulator,
    SavedVideo,
    SaveVideo,
    SetGripper,
    SimulatorStart,
    StepOnce,
    StepResult,
    TaskScore,
    TrueState,
)
from gap_runtime.contracts.failures import BadRequestError, MotionError, UnknownNameError
from gap_runtime.contracts.simulator import simulator_of
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import (
    ObjectPose,
)

STEP = 0.05  # [s] of world time: one control step at 20 Hz, as in the suites these tools come from
ARM = ("arm:0", "gripper:0", "clock")
FILM = "sim_bridge.film"  # key of the camera's film in the episode's state


@serves(InitSimulator)
def init(ctx: ToolContext, request: InitSimulator) -> SimulatorStart:
    wanted = [
        ("env_name", request.env_name, {ctx.task.environment.simulator, ctx.task.name}),
        ("suite_name", request.suite_name, {ctx.task.variant, ctx.task.name}),
        ("task_id", request.task_id, {_scene(ctx)}),
        ("config_path", request.config_path, set()),
        *(("camera_names", name, set(ctx.cell.camera_names)) for name in request.camera_names or []),
    ]
    for key, value, known in wanted:
        if value is not None and value not in known:
            return SimulatorStart(False, {}, str(UnknownNameError(key, value, known)))
    capabilities = {
        "simulator": ctx.task.environment.simulator, "task": ctx.task.name, "scene": _scene(ctx),
        "cameras": list(ctx.cell.camera_names), "arms": [arm.spec.name for arm in ctx.cell.arms], "step_s": STEP,
    }  # fmt: skip
    return SimulatorStart(True, capabilities, "")


@serves(ResetSimulator)
def reset(ctx: ToolContext, request: ResetSimulator) -> FirstObservation:
    simulator = simulator_of(ctx.cell)
    simulator.reset(simulator.sample(request.seed))
    for key in [k for k in ctx.state if k != FILM]:
        del ctx.state[key]
    return FirstObservation(ctx.cell.observe())


@serves(StepOnce)
def step_once(ctx: ToolContext, request: StepOnce) -> StepResult:
    if request.gripper_fraction != -1:
        _drive_jaws(ctx, request.gripper_fraction, 0)
    ctx.cell.wait(STEP)
    return _stepped(ctx, truncated=False)


@serves(MoveToJointsBlocking)
def move_to_joints(ctx: ToolContext, request: MoveToJointsBlocking) -> StepResult:
    from gap_control.point_to_point import point_to_point

    arm = ctx.cell.arms[0]
    arm.finish()
    trajectory = point_to_point(arm.spec, arm.state().joints.positions, request.target_joints.positions)
    step = STEP * arm.spec.time_scale
    if trajectory.duration > request.max_steps * step:
        need = int(trajectory.duration / step) + 1
        raise BadRequestError(
            "max_steps", f"The motion takes {need} control steps, more than max_steps {request.max_steps}."
        )
    try:
        arm.execute(trajectory, tolerance=request.tolerance)
    except MotionError as error:
        if error.code != "stalled":
            raise
        return _stepped(ctx, truncated=True)
    return _stepped(ctx, truncated=False)


@serves(SetGripper)
def set_gripper(ctx: ToolContext, request: SetGripper) -> None:
    _drive_jaws(ctx, request.fraction, request.arm_id)


@serves(GetTrueState)
def get_state(ctx: ToolContext, request: GetTrueState) -> TrueState:
    seen, true = ctx.cell.observe(), simulator_of(ctx.cell).snapshot()
    objects = [ObjectPose(name, body.pose) for name, body in sorted(true.bodies.items())]
    return TrueState(list(seen.arm_states), list(seen.cameras), objects)


@serves(CheckTaskCompletion)
def check_task_completion(ctx: ToolContext, request: CheckTaskCompletion) -> TaskScore:
    from gap_mujoco.scoring import conditions

    found = conditions(ctx.task, _scene(ctx), simulator_of(ctx.cell).snapshot(), request.target, request.container)
    done = all(found.values())
    return TaskScore(ctx.task.reward.success_weight * done, done, sum(found.values()) / len(found))


@serves(EnableVideoCapture)
def enable_video_capture(ctx: ToolContext, request: EnableVideoCapture) -> None:
    from gap_mujoco.rendering.video import Reel

    reel = ctx.state.setdefault(FILM, Reel(ctx.cell.camera_names[0]))
    if request.clear:
        reel.clear()
    if request.enabled:
        reel.start(ctx.cell)
    else:
        reel.stop()


@serves(SaveVideo)
def save_video(ctx: ToolContext, request: SaveVideo) -> SavedVideo:
    from gap_mujoco.rendering.video import Reel

    reel = ctx.state.get(FILM)
    if not isinstance(reel, Reel) or not len(reel):
        return SavedVideo(False, "", 0)
    count = reel.save(request.output_path, request.fps)
    if request.clear:
        reel.clear()
    return SavedVideo(True, request.output_path, count)


def _scene(ctx: ToolContext) -> str:
    return str(getattr(ctx.cell, "scene", ""))


def _drive_jaws(ctx: ToolContext, fraction: float, arm_id: int) -> None:
    arms = ctx.cell.arms
    if not 0 <= arm_id < len(arms):
        raise UnknownNameError("arm", str(arm_id), map(str, range(len(arms))))
    if not 0 <= fraction <= 1:
        raise BadRequestError("range", f"A jaw opening of {fraction} is outside 0 (closed) to 1 (open).")
    arms[arm_id].gripper.set_width(fraction * arms[arm_id].spec.gripper.max_width)


def _stepped(ctx: ToolContext, *, truncated: bool) -> StepResult:
    from gap_mujoco.scoring import conditions

    done = all(conditions(ctx.task, _scene(ctx), simulator_of(ctx.cell).snapshot()).values())
    late = ctx.cell.time > ctx.task.max_time
    return StepResult(ctx.cell.observe(), ctx.task.reward.success_weight * done, done, truncated or late)


TOOLS = (
    init, reset, step_once, move_to_joints, set_gripper, get_state, check_task_completion, enable_video_capture,
    save_video,
)  # fmt: skip
