"""Degrades clean frames the way real sensors do, for measuring what perception stands.

Depth noise grows with the square of the distance and drops out at edges and at grazing angles, as measured on
structured-light and active-stereo cameras (Nguyen, Izadi and Lovell, 2012; Intel, RealSense D400 tuning guide).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from gap_cli.contracts.types import Array, CameraObservation, DepthImage, Image, Observation, Se3Pose


@dataclass(frozen=True)
class Sensor:
    """How bad a camera is. `depth` [m] at 1 m, `dropout` share of pixels, `edge` [px] lost around depth edges, `colour`
    standard deviation [levels], `light` relative change of brightness, `shift` [m] and `turn` [deg] of calibration."""

    name: str
    depth: float = 0.0
    dropout: float = 0.0
    edge: int = 0
    colour: float = 0.0
    light: float = 0.0
    shift: float = 0.0
    turn: float = 0.0


SENSORS = (
    Sensor("clean"),
    Sensor("good", 0.0007, 0.002, 1, 2.0, 0.05, 0.001, 0.05),
    Sensor("real", 0.0015, 0.01, 2, 5.0, 0.15, 0.002, 0.15),
    Sensor("bad", 0.003, 0.03, 3, 10.0, 0.30, 0.004, 0.30),
)
EDGE = 0.01  # m: depth step between neighbours that counts as an edge


def degrade(observation: Observation, sensor: Sensor, seed: int) -> Observation:
    """The observation as this sensor would have made it; the same seed gives the same noise."""
    rng = np.random.default_rng(seed)
    return replace(observation, cameras=tuple(_camera(c, sensor, rng) for c in observation.cameras))


def _camera(camera: CameraObservation, sensor: Sensor, rng: np.random.Generator) -> CameraObservation:
    T = camera.pose.matrix
    T[:3, 3] += rng.normal(0, 1, 3) * sensor.shift / np.sqrt(3)
    turn = Rotation.from_rotvec(np.radians(sensor.turn) * rng.normal(0, 1, 3) / np.sqrt(3)).as_matrix()
    T[:3, :3] = T[:3, :3] @ turn
    gain = 1 + sensor.light * rng.uniform(-1, 1)
    pixels = camera.rgb.data * gain + rng.normal(0, 1, camera.rgb.data.shape) * sensor.colour
    return replace(
        camera, pose=Se3Pose.of(T), depth=DepthImage(_depth(camera.depth.data, sensor, rng)),
        rgb=Image(np.clip(np.rint(pixels), 0, 255).astype(np.uint8)),
    )  # fmt: skip


def _depth(depth: Array, sensor: Sensor, rng: np.random.Generator) -> Array:
    import cv2

    noisy = depth + rng.normal(0, 1, depth.shape) * sensor.depth * depth**2
    lost = rng.random(depth.shape) < sensor.dropout
    if sensor.edge:
        kernel = np.ones((3, 3), np.uint8)
        step = (cv2.dilate(depth, kernel) - cv2.erode(depth, kernel)) > EDGE * np.maximum(depth, 0.1)
        lost |= (rng.random(depth.shape) < 0.5) & cv2.dilate(
            step.astype(np.uint8), kernel, iterations=sensor.edge - 1
        ).astype(bool)
    return np.where(lost | (depth <= 0), 0.0, noisy).astype(np.float32)
