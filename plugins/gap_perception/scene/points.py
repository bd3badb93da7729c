"""World points of the pixels that stand out from the known supports, camera by camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gap_perception.scene.extrinsic_correction import fit_support_plane
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.task import Environment
from gap_runtime.contracts.types import Array, CameraObservation

NEAR_PLANE = 0.02  # m: pixels this close to a support tell how noisy the depth is
MARGIN = (0.0015, 0.012)  # m: bounds of the height below which a pixel is taken for the support itself
NOISE_SIGMAS = 4.0
NEGLIGIBLE_TILT = 0.0003  # m: supports that appear off by less need no correction
OVERHANG = 0.10  # m: an object may stick out of the workspace that its origin must lie in


@dataclass(frozen=True)
class CameraPoints:
    """The pixels of one camera that lie above a support.

    `rows`, `columns` (N,); `xyz` (N, 3) in the world [m]; `support` (N,) height of the support below each [m];
    `noise` standard deviation of the depth along the vertical, and `tilt` by how much the supports appeared off their
    known heights before the camera's pose was corrected [m].
    """

    camera: CameraObservation
    rows: Array
    columns: Array
    xyz: Array
    support: Array
    noise: float
    tilt: float = 0.0

    @property
    def height(self) -> Array:
        """Height above the support, shape (N,) [m]."""
        return np.asarray(self.xyz[:, 2] - self.support)

    def select(self, keep: Array) -> CameraPoints:
        """Only the points where `keep` (N,) holds."""
        kept = {f: getattr(self, f)[keep] for f in ("rows", "columns", "xyz", "support")}
        return replace(self, **kept)


def lift(camera: CameraObservation, environment: Environment) -> CameraPoints:
    """The camera's points above the supports, within the workspace; none where there is no depth.

    The pose of a camera that sees a support tilted or off its known height is corrected first.
    Raises `BadRequestError` when colour and depth differ in size or the intrinsics are no camera's.
    """
    _check(camera)
    depth = camera.depth.data
    known = np.isfinite(depth) & (depth > 0)
    z = np.where(known, depth, np.float32(0))
    x_w, y_w, z_w = _world(z, camera)
    ground = _ground(x_w, y_w, z_w, environment)
    correction = fit_support_plane(x_w, y_w, z_w - ground, known)
    if correction.tilt > NEGLIGIBLE_TILT:
        camera = correction.applied(camera)
        x_w, y_w, z_w = _world(z, camera)
        ground = _ground(x_w, y_w, z_w, environment)
    height = z_w - ground
    noise = _noise(height[known & (np.abs(height) < NEAR_PLANE)])
    above = known & (height > float(np.clip(NOISE_SIGMAS * noise, *MARGIN)))
    for value, low, high in zip((x_w, y_w, z_w), *environment.workspace, strict=True):
        above &= (value >= low - OVERHANG) & (value <= high + OVERHANG)
    rows, columns = np.nonzero(above)
    xyz = np.column_stack([v[above] for v in (x_w, y_w, z_w)]).astype(np.float64)
    return CameraPoints(camera, rows, columns, xyz, ground[above].astype(np.float64), noise, correction.tilt)


def project(points: Array, camera: CameraObservation) -> tuple[Array, Array, Array]:
    """Pixel columns, rows (rounded) and optical depth [m] of world points (N, 3)."""
    T, K = camera.pose.matrix, camera.intrinsics.data
    local = (points - T[:3, 3]) @ T[:3, :3]
    depth = np.maximum(local[:, 2], 1e-6)
    columns = np.rint(local[:, 0] / depth * K[0, 0] + K[0, 2])
    rows = np.rint(local[:, 1] / depth * K[1, 1] + K[1, 2])
    return columns.astype(np.int64), rows.astype(np.int64), local[:, 2]


def _check(camera: CameraObservation) -> None:
    colour, depth = camera.rgb.data.shape[:2], camera.depth.data.shape
    if colour != depth:
        raise BadRequestError(
            "shape", f"Camera {camera.name!r}: the image is {colour}, its depth {depth} (rows, columns)."
        )
    K = camera.intrinsics.data
    if not np.isfinite(K).all() or K[0, 0] <= 0 or K[1, 1] <= 0:
        raise BadRequestError("intrinsics", f"Camera {camera.name!r} has no positive finite focal lengths.")


def _world(z: Array, camera: CameraObservation) -> list[Array]:
    """World x, y and z of every pixel, each (H, W) float32."""
    K, T = camera.intrinsics.data, camera.pose.matrix
    u = (np.arange(z.shape[1]) - K[0, 2]) / K[0, 0]
    v = (np.arange(z.shape[0]) - K[1, 2]) / K[1, 1]
    rays = [(T[i, 0] * u + T[i, 2])[None, :] + (T[i, 1] * v)[:, None] for i in range(3)]
    return [z * ray.astype(np.float32) + np.float32(T[i, 3]) for i, ray in enumerate(rays)]


def _ground(x: Array, y: Array, z: Array, environment: Environment) -> Array:
    """Height of the highest support under (or just above) each pixel's point; +inf where there is none."""
    ground = np.full(x.shape, np.inf, dtype=np.float32)
    for support in sorted(environment.supports.values(), key=lambda s: s.z):
        over = (np.abs(x - support.center[0]) <= support.half_size[0]) & (
            np.abs(y - support.center[1]) <= support.half_size[1]
        )
        ground[over & (z > support.z - NEAR_PLANE)] = support.z
    return ground


def _noise(heights: Array) -> float:
    """Robust standard deviation of the supports' heights (MAD)."""
    return float(1.4826 * np.median(np.abs(heights))) if len(heights) else 0.0
