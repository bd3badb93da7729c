"""Draws one RGB-D frame in one pass, and says what the camera's intrinsics and pose are."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from gap_mujoco.rendering.gl import make_context
from gap_runtime.contracts.types import (
    Array,
    CameraObservation,
    DepthImage,
    Image,
    Matrix3x3,
    Quaternion,
    Se3Pose,
    Vec3,
)

OPTICAL = np.diag([1.0, -1.0, -1.0])  # R_mujocoCamera_opticalCamera
_FAR_SHARE = 0.999  # beyond this share of the far plane there is nothing to see
_MAX_GEOMS = 2000


def intrinsics(fovy: float, resolution: tuple[int, int]) -> Matrix3x3:
    """Pinhole matrix [px] of a camera with vertical field of view `fovy` [deg]; pixel centres are at whole numbers."""
    width, height = resolution
    f = height / 2 / np.tan(np.radians(fovy) / 2)
    return Matrix3x3(np.array([[f, 0, (width - 1) / 2], [0, f, (height - 1) / 2], [0, 0, 1]]))


class Renderer:
    """Offscreen drawing of one model. Belongs to the thread that made it; `close` it there."""

    def __init__(self, model: Any, resolution: tuple[int, int]) -> None:
        self._model = model
        self._context = make_context(*resolution)
        self._scene = mujoco.MjvScene(model, maxgeom=_MAX_GEOMS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._option = mujoco.MjvOption()
        self._option.geomgroup[:] = (1, 1, 1, 0, 0, 0)
        self._mjr = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._mjr)
        self._mjr.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED

    def draw(self, data: Any, camera: str, resolution: tuple[int, int]) -> tuple[Array, Array]:
        """RGB uint8 (H, W, 3) and depth along the optical axis float32 (H, W) [m], 0 where nothing is seen."""
        rgb, depth = self._render(data, camera, resolution)
        return rgb, self._metres(depth)

    def geoms(self, data: Any, camera: str, resolution: tuple[int, int]) -> Array:
        """Which geom of the model each pixel shows, int32 (H, W), -1 for none."""
        flags = [int(mujoco.mjtRndFlag.mjRND_SEGMENT), int(mujoco.mjtRndFlag.mjRND_IDCOLOR)]
        self._scene.flags[flags] = True
        rgb, _ = self._render(data, camera, resolution)
        self._scene.flags[flags] = False
        drawn = self._scene.geoms[: self._scene.ngeom]
        geom_of = np.full(len(drawn) + 1, -1, np.int32)  # by colour, of which 0 is the background's
        for geom in drawn:
            if geom.segid >= 0 and geom.objtype == mujoco.mjtObj.mjOBJ_GEOM:
                geom_of[geom.segid + 1] = geom.objid
        colour = rgb.astype(np.int32) @ np.array([1, 1 << 8, 1 << 16])
        return np.asarray(geom_of[colour])

    def _render(self, data: Any, camera: str, resolution: tuple[int, int]) -> tuple[Array, Array]:
        """Colours (H, W, 3) and the depth buffer (H, W)."""
        width, height = resolution
        self._context.make_current()
        self._camera.fixedcamid = self._model.camera(camera).id
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self._model, data, self._option, None, self._camera, everything, self._scene)
        viewport = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(viewport, self._scene, self._mjr)
        rgb, depth = np.empty((height, width, 3), np.uint8), np.empty((height, width), np.float32)
        mujoco.mjr_readPixels(rgb, depth, viewport, self._mjr)
        return np.flipud(rgb), np.flipud(depth)

    def close(self) -> None:
        """Free the GL objects."""
        self._context.make_current()
        self._mjr.free()
        self._context.free()

    def _metres(self, buffer: Array) -> Array:
        """Undo the perspective of the depth buffer, which is 1 at the near plane and 0 at the far one."""
        extent = self._model.stat.extent
        near, far = self._model.vis.map.znear * extent, self._model.vis.map.zfar * extent
        depth = np.float32(near * far) / (buffer * np.float32(far - near) + np.float32(near))
        depth[depth > _FAR_SHARE * far] = 0
        return depth


def camera_pose(data: Any, camera: str) -> Se3Pose:
    """T_world_camera (optical) of a camera of the model, from forward kinematics."""
    seen = data.camera(camera)
    rotation = Rotation.from_matrix(seen.xmat.reshape(3, 3) @ OPTICAL)
    return Se3Pose(Vec3.of(seen.xpos), Quaternion.of(rotation))


def observe(
    renderer: Renderer, data: Any, camera: str, resolution: tuple[int, int], fovy: float, name: str
) -> CameraObservation:
    """One calibrated frame of `camera`, called `name`."""
    rgb, depth = renderer.draw(data, camera, resolution)
    matrix, pose = intrinsics(fovy, resolution), camera_pose(data, camera)
    return CameraObservation(name, Image(rgb), DepthImage(depth), matrix, pose, float(data.time))
