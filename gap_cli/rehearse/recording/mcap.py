"""Records an episode as MCAP for Foxglove: camera images, joint states, transforms, the scene, node events, a log.

An observer of the same frames and events as everyone else; it never changes the run. Times are world time.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import foxglove
from foxglove import channels as fgc
from foxglove import messages as fg

from gap_cli.rehearse.recording.foxglove_scene import entity
from gap_runtime.contracts.cell import CellFrame
from gap_runtime.contracts.encoding.codec import to_plain
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.task import ObjectModel
from gap_runtime.contracts.types import ArmState, CameraObservation, Se3Pose
from gap_runtime.errors import StorageError
from gap_runtime.run.events import Event

JPEG_QUALITY = 80
PART = ".part"  # while it is being written
EVENT_SCHEMA = {
    "type": "object",
    "properties": {"seq": {"type": "integer"}, "kind": {"type": "string"}, "path": {"type": "string"},
                   "data": {"type": "object"}},
}  # fmt: skip
_LEVELS = {
    "node_failed": fg.LogLevel.Error,
    "node_cancelled": fg.LogLevel.Warning,
    "recovery_started": fg.LogLevel.Warning,
}
_LOGGED = {"run_started", "subgraph_entered", "subgraph_exited", "node_finished", "run_finished", *_LEVELS}


class McapRecorder:
    """Writes `path` when closed; until then its bytes are in `path` + `.part`."""

    def __init__(self, path: Path, objects: Mapping[str, ObjectModel], robots: tuple[RobotSpec, ...]) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path, self.objects, self.robots = path, objects, robots
        self._part = path.with_name(path.name + PART)
        self._context = foxglove.Context()
        self._writer = foxglove.open_mcap(self._part, allow_overwrite=True, context=self._context)
        self._joints = fgc.JointStatesChannel("/joint_states", context=self._context)
        self._transforms = fgc.FrameTransformsChannel("/tf", context=self._context)
        self._scene = fgc.SceneUpdateChannel("/scene", context=self._context)
        self._log = fgc.LogChannel("/log", context=self._context)
        self._events = foxglove.Channel("/node_events", schema=EVENT_SCHEMA, context=self._context)
        self._images: dict[str, tuple[fgc.CompressedImageChannel, fgc.CameraCalibrationChannel]] = {}
        self._time = 0.0
        self._drawn = False

    def on_frame(self, frame: CellFrame) -> None:
        """Record one instant."""
        self._time = frame.time
        when, stamp = _ns(frame.time), _stamp(frame.time)
        if not self._drawn:
            scene = fg.SceneUpdate(entities=[entity(n, m, stamp) for n, m in sorted(self.objects.items())])
            self._scene.log(scene, log_time=when)
            self._drawn = True
        for camera in frame.observation.cameras:
            self._camera(camera, stamp, when)
        for arm in frame.observation.arm_states:
            self._arm(arm, stamp, when)
        self._transforms.log(fg.FrameTransforms(transforms=self._poses(frame, stamp)), log_time=when)

    def on_event(self, event: Event) -> None:
        """Record a transition of the graph."""
        self._time = event.cell_time if event.cell_time is not None else self._time
        when = _ns(self._time)
        data = _plain(event.data)
        message = {"seq": event.seq, "kind": event.kind, "path": event.path, "data": data}
        self._events.log(message, log_time=when)
        if event.kind in _LOGGED:
            level = _LEVELS.get(event.kind, fg.LogLevel.Info)
            text = f"{event.kind} {event.path} {json.dumps(data, ensure_ascii=False)[:500]}"
            self._log.log(
                fg.Log(timestamp=_stamp(self._time), level=level, message=text, name=event.path), log_time=when
            )

    def close(self) -> None:
        """Finish the file and give it its name. Raises `StorageError`, and leaves nothing, where it was not written."""
        try:
            self._writer.close()
            self._part.replace(self.path)
        except (OSError, RuntimeError) as error:  # the writer's own error says no more than that writing failed
            self._part.unlink(missing_ok=True)
            hint = "Free some space, or type --record none."
            raise StorageError(f"Cannot write {self.path}: {error}.", hint=hint) from None

    def _camera(self, camera: CameraObservation, stamp: fg.Timestamp, when: int) -> None:
        import cv2

        name = camera.name
        if name not in self._images:
            self._images[name] = (
                fgc.CompressedImageChannel(f"/camera/{name}/image", context=self._context),
                fgc.CameraCalibrationChannel(f"/camera/{name}/calibration", context=self._context),
            )
        image, calibration = self._images[name]
        options = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
        _, data = cv2.imencode(".jpg", cv2.cvtColor(camera.rgb.data, cv2.COLOR_RGB2BGR), options)
        frame_id = f"camera:{name}"
        image.log(
            fg.CompressedImage(timestamp=stamp, frame_id=frame_id, data=data.tobytes(), format="jpeg"), log_time=when
        )
        height, width = camera.rgb.data.shape[:2]
        K = [float(v) for v in camera.intrinsics.data.ravel()]
        P = [*K[0:3], 0.0, *K[3:6], 0.0, *K[6:9], 0.0]
        calibration.log(
            fg.CameraCalibration(timestamp=stamp, frame_id=frame_id, width=width, height=height, K=K, P=P),
            log_time=when,
        )

    def _arm(self, arm: ArmState, stamp: fg.Timestamp, when: int) -> None:
        names = self.robots[arm.arm_id].joints
        velocities = arm.joints.velocities
        joints = [
            fg.JointState(
                name=names[i],
                position=float(position),
                velocity=None if velocities is None else float(velocities[i]),
            )
            for i, position in enumerate(arm.joints.positions)
        ]
        joints.append(fg.JointState(name=f"gripper:{arm.arm_id}", position=float(arm.gripper.width)))
        self._joints.log(fg.JointStates(timestamp=stamp, joints=joints), log_time=when)

    def _poses(self, frame: CellFrame, stamp: fg.Timestamp) -> list[fg.FrameTransform]:
        found = [(f"tcp:{a.arm_id}", a.ee_pose) for a in frame.observation.arm_states]
        found += [(f"camera:{c.name}", c.pose) for c in frame.observation.cameras]
        if frame.snapshot is not None:
            found += [(name, body.pose) for name, body in sorted(frame.snapshot.bodies.items())]
        return [_transform(name, pose, stamp) for name, pose in found]


def _transform(child: str, pose: Se3Pose, stamp: fg.Timestamp) -> fg.FrameTransform:
    p, q = pose.position, pose.rotation
    return fg.FrameTransform(
        timestamp=stamp, parent_frame_id="world", child_frame_id=child,
        translation=fg.Vector3(x=p.x, y=p.y, z=p.z), rotation=fg.Quaternion(x=q.x, y=q.y, z=q.z, w=q.w),
    )  # fmt: skip


def _plain(data: Mapping[str, object]) -> dict[str, object]:
    """Event data for reading: what no file can hold is named by its type."""
    found: dict[str, object] = {}
    for key, value in data.items():
        try:
            found[key] = str(value) if isinstance(value, BaseException) else to_plain(value, digits=6)
        except BadRequestError:
            found[key] = type(value).__name__
    return found


def _stamp(seconds: float) -> fg.Timestamp:
    sec, nsec = divmod(_ns(seconds), 1_000_000_000)
    return fg.Timestamp(sec=sec, nsec=nsec)


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)
