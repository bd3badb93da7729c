"""Makes the cell's cameras as imperfect as the task declares: where they stand, the light, and every frame's pixels.

Everything that looks through a camera sees the same: policies, recordings, films. A camera delivers one frame per
instant of world time, however often and by whoever it is read, so who else looks changes nothing. Ground truth
(`World.snapshot`) is exact.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from gap_mujoco.model.compiled import TIMESTEP
from gap_mujoco.model.scene import SceneCamera
from gap_mujoco.rendering.camera import OPTICAL
from gap_mujoco.rendering.stereo import measured_depth, noisy_colour
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.task.sensors import CameraNoise
from gap_runtime.contracts.types import Array, CameraObservation, DepthImage, Image, Se3Pose


class SensorNoise:
    """The imperfections of one world's cameras. Without any declared, nothing is touched."""

    def __init__(self, task: Task, cameras: Mapping[str, SceneCamera], model: Any) -> None:
        """Raises `DocumentError` when the task gives a model to a camera that the cell does not have."""
        self._noise: Mapping[str, CameraNoise] = task.sensors.by_camera(cameras, str(task.path / "task.yaml"))
        self._model, self._cameras, self._seed = model, cameras, 0
        self._light = max((n.light for n in self._noise.values()), default=0.0)
        self._declared = {name: _mount(model, cameras[name]) for name in self._noise}
        self._error: dict[str, Array] = {}
        head = model.vis.headlight
        self._lamps = [(lamp, lamp.copy()) for lamp in (head.ambient, head.diffuse, *model.light_diffuse)]

    def draw(self, seed: int) -> None:
        """Begin an episode: put every camera a little off where it is said to be, and dim or raise every light."""
        self._seed = seed
        for name, noise in self._noise.items():
            error = self._error[name] = calibration_error(noise, self._rng("calibration", name))
            _displace(self._model, self._cameras[name], self._declared[name] @ error)
        gains = 1 + self._light * self._rng("light", "").uniform(-1, 1, len(self._lamps) + 1)
        for (lamp, declared), gain in zip(self._lamps, gains[1:], strict=True):
            lamp[:] = declared * gains[0] * gain

    def calibrated(self, name: str, true: Se3Pose) -> Se3Pose:
        """T_world_camera (optical) as the robot has it from its calibration, of a camera truly at `true`."""
        if name not in self._error:
            return true
        return Se3Pose.of(true.matrix @ np.linalg.inv(self._error[name]))

    def seen(self, frame: CameraObservation) -> CameraObservation:
        """A perfect frame as the camera delivers it at that instant."""
        noise = self._noise.get(frame.name)
        if noise is None:
            return frame
        rng = self._rng("frame", frame.name, round(frame.stamp / TIMESTEP))
        depth, rgb = frame.depth, frame.rgb
        if noise.depth is not None:
            depth = DepthImage(measured_depth(depth.data, float(frame.intrinsics.data[0, 0]), noise.depth, rng))
        if noise.colour:
            rgb = Image(noisy_colour(rgb.data, noise.colour, rng))
        return replace(frame, depth=depth, rgb=rgb, pose=self.calibrated(frame.name, frame.pose))

    def _rng(self, what: str, camera: str, tick: int = 0) -> np.random.Generator:
        """One stream per episode, purpose, camera and instant: nothing that is drawn depends on what else is."""
        return np.random.default_rng([self._seed, zlib.crc32(f"{what}/{camera}".encode()), tick])


def calibration_error(noise: CameraNoise, rng: np.random.Generator) -> Array:
    """T_calibrated_true (4, 4) of the optical frame; root mean square length `shift` [m] and angle `turn` [deg]."""
    error = np.eye(4)
    error[:3, 3] = rng.normal(0, noise.shift / np.sqrt(3), 3)
    turn = rng.normal(0, np.radians(noise.turn) / np.sqrt(3), 3)
    error[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    return error


def _mount(model: Any, camera: SceneCamera) -> Array:
    """T_body_camera (4, 4), optical, of a camera of the model."""
    element, rotation = model.camera(camera.element), np.zeros(9)
    mujoco.mju_quat2Mat(rotation, element.quat)
    mount = np.eye(4)
    mount[:3, :3], mount[:3, 3] = rotation.reshape(3, 3) @ OPTICAL, element.pos
    return mount


def _displace(model: Any, camera: SceneCamera, mount: Array) -> None:
    """Put a camera of the model at T_body_camera (4, 4), optical."""
    element = model.camera(camera.element)
    element.pos[:] = mount[:3, 3]
    mujoco.mju_mat2Quat(element.quat, (mount[:3, :3] @ OPTICAL).ravel())
