"""The MuJoCo simulator: a simulated cell behind the contract of every cell."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress

import numpy as np

from gap_control import motion_executor
from gap_mujoco.arm import MujocoArm
from gap_mujoco.belief import EXAMINED, Belief
from gap_mujoco.ground_truth import GroundTruthReader, pose_qpos
from gap_mujoco.model.scene import compose
from gap_mujoco.physics import Physics
from gap_mujoco.rendering.camera import Renderer, camera_pose, observe
from gap_mujoco.rendering.noise import SensorNoise
from gap_mujoco.subscriptions import Subscription
from gap_mujoco.thread import SimulatorThread
from gap_runtime.contracts.access import access, assert_privileged, current_node
from gap_runtime.contracts.cell import CellFrame
from gap_runtime.contracts.failures import BadRequestError, GapError, TaskInfeasibleError, UnknownNameError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.simulator import Instance, SteppedClock
from gap_runtime.contracts.snapshot import WorldSnapshot
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.types import CameraObservation, Mask, Observation, Se3Pose, Trajectory

SETTLE_MIN, SETTLE_MAX = 0.1, 1.5  # [s] physics may take to bring placed objects to rest
SETTLE_TOLERANCE = 0.005  # [m] an object may move while it comes to rest


class MujocoSimulator:
    """One scene of one task. Every method may be called from any thread; all of it happens on one."""

    real_time = False

    def __init__(self, task: Task, scene: str, robots: Mapping[str, RobotSpec]) -> None:
        self._thread = SimulatorThread("mujoco")
        self._scene_name, self._belief = scene, Belief(task, scene, robots)
        self._supports = frozenset(task.environment.supports)
        self._renderer: Renderer | None = None
        self._start: WorldSnapshot | None = None
        self._closed = False
        self._thread.call(self._build, task, scene, robots)

    def _build(self, task: Task, scene: str, robots: Mapping[str, RobotSpec]) -> None:
        self._scene = compose(task, scene, robots)
        self._physics = Physics(self._scene)
        self._clock = SteppedClock(self._thread.call, self._physics.step)
        self._noise = SensorNoise(task, self._scene.cameras, self._scene.model)
        self._arms = tuple(
            MujocoArm(i, spec, placement, self._physics, self._thread, self._clock)
            for i, (spec, placement) in enumerate(self._scene.robots)
        )
        controllers = tuple(arm.controller for arm in self._arms)
        self._physics.writers = [c.write_controls for c in controllers]
        self._physics.updaters = [arm.executor.update for arm in self._arms]
        self._truth = GroundTruthReader(task, self._scene, self._physics, controllers)

    @property
    def arms(self) -> Sequence[MujocoArm]:
        """By arm_id."""
        return self._arms

    @property
    @access("pure")
    def scene(self) -> str:
        """Which scene of the task this is."""
        return self._scene_name

    @property
    def clock(self) -> SteppedClock:
        """By which all commands wait."""
        return self._clock

    @property
    def time(self) -> float:
        """Simulated time since reset [s]."""
        return self._physics.time

    @property
    def camera_names(self) -> tuple[str, ...]:
        """The task's cameras, then the robots' own."""
        return tuple(self._scene.cameras)

    def sample(self, seed: int) -> Instance:
        """Draw an instance. Privileged, as poses are. Raises `TaskInfeasibleError`."""
        assert_privileged("where the objects are going to be")
        return self._belief.sample(seed)

    def reset(self, instance: Instance) -> None:
        """Place everything, let it come to rest, and start the clock. Raises `TaskInfeasibleError`."""
        assert_privileged("the simulator's state, to reset it")
        self._thread.call(self._reset, instance)

    def _reset(self, instance: Instance) -> None:
        if set(instance.poses) != set(self._scene.objects):
            missing = sorted(set(instance.poses) ^ set(self._scene.objects))
            raise BadRequestError("instance", f"The instance and the scene disagree about {', '.join(missing)}.")
        self._start = None
        self._noise.draw(instance.seed)
        self._arrange(instance)
        self._physics.placed = True
        with self._physics.unobserved():
            try:
                self._come_to_rest(instance)
            except TaskInfeasibleError:
                self._physics.placed = False
                raise
        self._physics.start_clock()
        self._start = self._truth.snapshot(None)

    def _arrange(self, instance: Instance) -> None:
        self._physics.clear()
        for name, pose in instance.poses.items():
            self._place(name, pose)
        for name, value in instance.joints.items():
            self._physics.data.qpos[self._truth.joint_address(name)] = value
        for arm in self._arms:
            arm.place_home()
        self._physics.forward()

    def _place(self, name: str, pose: Se3Pose) -> None:
        model, numbers = self._physics.model, pose_qpos(pose)
        body = model.body(f"{name}/")
        if body.dofnum[0]:
            self._physics.data.joint(f"{name}/").qpos[:] = numbers
        else:  # bolted down: where, is part of the model
            model.body_pos[body.id], model.body_quat[body.id] = numbers[:3], numbers[3:]

    def _come_to_rest(self, instance: Instance) -> None:
        touched = {name: body.contacts - self._supports for name, body in self._truth.snapshot(None).bodies.items()}
        self._physics.run(SETTLE_MIN)
        now = self._truth.snapshot(None)
        while now.time < SETTLE_MAX and not all(now.body(name).is_settled() for name in now.bodies):
            self._physics.run(SETTLE_MIN)
            now = self._truth.snapshot(None)
        for name, pose in instance.poses.items():
            moved = float(np.linalg.norm(now.bodies[name].pose.position.array - pose.position.array))
            if moved > SETTLE_TOLERANCE or not now.body(name).is_settled():
                raise TaskInfeasibleError(
                    f"Scene {self._scene_name!r}: {name!r} in region {self._belief.region(name)} does not stay where "
                    f"the instance puts it: it moved {1000 * moved:.1f} mm in {now.time:.1f} s"
                    + (self._in_the_way(name, touched[name]) if touched[name] else "."),
                    hint="Place it free of others, standing on its support.",
                )

    def _in_the_way(self, name: str, touched: frozenset[str]) -> str:
        """What the object starts inside of, and in how many instances it would be free of everything."""
        free = 0
        for seed in range(EXAMINED):
            with suppress(TaskInfeasibleError):
                self._arrange(self._belief.sample(seed))
                free += not self._truth.snapshot(None).bodies[name].contacts - self._supports
        what = ", ".join(sorted(touched))
        return f", for {what} is in its way. In {free} of {EXAMINED} draws nothing is."

    def observe(self, cameras: Sequence[str] | None = None) -> Observation:
        """RGB-D of the named cameras (default all) and the arms' states, all at this instant."""
        return self._thread.call(self._observe, cameras)

    def _observe(self, cameras: Sequence[str] | None) -> Observation:
        self._physics.require_placed()
        names = self.camera_names if cameras is None else cameras
        frames = tuple(self._noise.seen(self._frame(name)) for name in names)
        return Observation(frames, tuple(arm.controller.state() for arm in self._arms), self.time)

    def true_frames(self) -> tuple[CameraObservation, ...]:
        """What perfect cameras would see from where these truly are. Privileged."""
        assert_privileged("frames without noise")
        self._physics.require_placed()
        return self._thread.call(lambda: tuple(self._frame(name) for name in self.camera_names))

    def true_masks(self) -> dict[str, dict[str, Mask]]:
        """By camera and object, the pixels that show it. Privileged."""
        assert_privileged("which pixels show what")
        self._physics.require_placed()
        return self._thread.call(lambda: {name: self._masks(name) for name in self.camera_names})

    def _masks(self, name: str) -> dict[str, Mask]:
        camera, body_of = self._scene.cameras[name], self._scene.model.geom_bodyid
        geoms = self._camera_renderer().geoms(self._physics.data, camera.element, camera.resolution)
        shown = np.where(geoms >= 0, self._scene.model.body_rootid[body_of[geoms]], -1)
        return {thing: Mask(shown == self._scene.model.body(f"{thing}/").id) for thing in self._scene.objects}

    def _frame(self, name: str) -> CameraObservation:
        if name not in self._scene.cameras:
            raise UnknownNameError("camera", name, self._scene.cameras)
        if self._closed:
            raise GapError("The world is closed.")
        camera, data = self._scene.cameras[name], self._physics.data
        return observe(self._camera_renderer(), data, camera.element, camera.resolution, camera.fovy, name)

    def _camera_renderer(self) -> Renderer:
        if self._renderer is None:
            sizes = [c.resolution for c in self._scene.cameras.values()]
            self._renderer = Renderer(self._scene.model, (max(w for w, _ in sizes), max(h for _, h in sizes)))
        return self._renderer

    def camera_pose(self, name: str) -> Se3Pose:
        """T_world_camera (optical), as calibrated. Raises `UnknownNameError`."""
        if name not in self._scene.cameras:
            raise UnknownNameError("camera", name, self._scene.cameras)
        true = self._thread.call(camera_pose, self._physics.data, self._scene.cameras[name].element)
        return self._noise.calibrated(name, true)

    def execute(self, motions: Mapping[int, Trajectory], *, tolerance: float = 0.01) -> None:
        """Move several arms at once; see `gap_runtime.contracts.cell.LockstepCell.execute`."""
        unknown = sorted(set(motions) - set(range(len(self._arms))))
        if unknown:
            raise UnknownNameError("arm", str(unknown[0]), [str(i) for i in range(len(self._arms))])
        given = [self._arms[i].command(motions[i], tolerance) for i in sorted(motions)]
        self._clock.run(motion_executor.execute(given))

    def wait(self, seconds: float) -> None:
        """Let world time pass."""
        if not 0 <= seconds <= 600:
            raise BadRequestError("range", f"Cannot wait {seconds} s; 0 to 600 s is possible.")
        self._clock.run(self._physics.wait(seconds))

    def snapshot(self) -> WorldSnapshot:
        """Ground truth. Raises `PrivilegedReadError` inside a policy node."""
        assert_privileged("the world's ground truth")
        self._physics.require_placed()
        return self._thread.call(self._truth.snapshot, self._start)

    def subscribe(
        self, listener: Callable[[CellFrame], None], hz: float, cameras: Sequence[str] = ()
    ) -> Callable[[], None]:
        """Call `listener` on the simulator's thread at `hz` of its time. Within a policy node, frames hold no truth."""
        if not 0 < hz <= 500:
            raise BadRequestError("range", f"Cannot listen at {hz} Hz; more than 0, up to 500 Hz is possible.")
        truth = current_node() is None

        def take() -> CellFrame:
            snapshot = self._truth.snapshot(self._start) if truth else None
            return CellFrame(self.time, self._observe(cameras), snapshot)

        subscription = Subscription(listener, hz, lambda: self.time, take)
        self._thread.call(self._physics.observers.append, subscription)

        def unsubscribe() -> None:
            if subscription in self._physics.observers:
                self._thread.call(self._physics.observers.remove, subscription)

        return unsubscribe

    def close(self) -> None:
        """Free the renderer and the thread. Idempotent."""
        if not self._closed:
            self._closed = True
            self._thread.call(self._free)
            self._thread.close()

    def _free(self) -> None:
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
