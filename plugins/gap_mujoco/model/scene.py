"""Composes a cell: the room, the robots where they stand, the objects of one scene, and the cameras."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from dm_control import mjcf
from scipy.spatial.transform import Rotation

from gap_mujoco.model.compiled import compile_model, new_root
from gap_mujoco.model.props import build_object
from gap_mujoco.rendering.camera import OPTICAL
from gap_runtime.contracts.failures import UnknownNameError
from gap_runtime.contracts.robot import CameraSpec, RobotSpec
from gap_runtime.contracts.task import Environment, RobotPlacement, Task, mounted_cameras
from gap_runtime.contracts.types import Array

_TILE = 0.4  # [m]
_ROOM = (1.7, 2.0, 1.3)  # half sizes of the three walls behind and beside the robot [m]
_SLAB = 0.03  # half thickness of a table top [m]
ROBOT_VISUAL, HIDDEN = 1, 3  # geom groups; cameras draw groups 0 to 2


@dataclass(frozen=True)
class SceneCamera:
    """A camera of the cell: the name skills use, its name in the model, and its optics."""

    name: str
    element: str
    fovy: float
    resolution: tuple[int, int]


@dataclass(frozen=True)
class Scene:
    """A compiled cell and what its names mean. Arm i's elements are called `arm<i>/<name in the RobotSpec>`."""

    model: Any
    robots: tuple[tuple[RobotSpec, RobotPlacement], ...]
    objects: tuple[str, ...]
    cameras: Mapping[str, SceneCamera]


def compose(task: Task, scene: str, robots: Mapping[str, RobotSpec]) -> Scene:
    """Build the cell of `task` with the objects of `scene`. Raises `UnknownNameError`, `DocumentError`."""
    placed = tuple((robots[p.model], p) for p in task.robots)
    cameras = _scene_cameras(task, placed)
    resolution = (max(c.resolution[0] for c in cameras), max(c.resolution[1] for c in cameras)) if cameras else (64, 64)
    root = new_root("cell", resolution, task.environment.lights)
    _add_environment(root, task.environment)
    for name, camera in task.cameras.items():
        root.worldbody.add("camera", name=name, pos=camera.position, quat=camera.quaternion, fovy=camera.fovy)
    for i, (spec, placement) in enumerate(placed):
        _attach_robot(root, spec, placement, f"arm{i}")
    objects = task.scene_objects(scene)
    for name, model in objects.items():
        made = build_object(name, model)
        frame = root.attach(made)
        if not model.fixed:
            frame.add("freejoint")
            continue
        for link in made.worldbody.body:  # MuJoCo lets a link collide with a fixed parent
            root.contact.add("exclude", body1=frame, body2=link)
    return Scene(compile_model(root), placed, tuple(objects), {c.name: c for c in cameras})


def _scene_cameras(task: Task, placed: tuple[tuple[RobotSpec, RobotPlacement], ...]) -> list[SceneCamera]:
    mounted = mounted_cameras([spec for spec, _ in placed])
    return [
        *(SceneCamera(name, name, c.fovy, c.resolution) for name, c in task.cameras.items()),
        *(SceneCamera(name, f"arm{arm}/{c.name}", c.fovy, c.resolution) for name, arm, c in mounted),
    ]


def _attach_robot(root: mjcf.RootElement, spec: RobotSpec, placement: RobotPlacement, name: str) -> None:
    """Attach one robot with its cameras; physics options are the world's, not the robot file's."""
    robot = mjcf.from_path(str(spec.model_file))
    robot.model = name
    for section in (robot.option, robot.option.flag, robot.statistic, robot.visual, robot.size):
        for attribute in section.get_attributes():
            delattr(section, attribute)
    for camera in spec.cameras:
        _attach_camera(robot, spec, camera)
    _attach_visuals(robot, spec)
    frame = root.attach(robot)
    frame.pos = placement.position
    half = np.radians(placement.yaw_deg) / 2
    frame.quat = (np.cos(half), 0, 0, np.sin(half))


def _attach_camera(robot: mjcf.RootElement, spec: RobotSpec, camera: CameraSpec) -> None:
    bodies = {b.name: b for b in robot.find_all("body")}
    if camera.mount not in bodies:
        raise UnknownNameError(f"link of {spec.name} to mount camera {camera.name!r} on", camera.mount, bodies)
    w, x, y, z = camera.quaternion
    x, y, z, w = Rotation.from_matrix(Rotation.from_quat([x, y, z, w]).as_matrix() @ OPTICAL).as_quat()
    bodies[camera.mount].add(
        "camera", name=camera.name, pos=camera.position, quat=(w, x, y, z), fovy=camera.fovy, mode="fixed"
    )


def _attach_visuals(robot: mjcf.RootElement, spec: RobotSpec) -> None:
    """Add the spec's meshes, which have no mass and touch nothing, and hide the collision shapes of those links."""
    visuals = {visual.link: visual for visual in spec.visuals}
    for body in robot.find_all("body"):
        if body.name not in visuals:
            continue
        file, rgba = visuals[body.name].file, visuals[body.name].rgba
        for geom in body.geom:
            geom.group = HIDDEN
        mesh = robot.find("mesh", file.stem) or robot.asset.add(
            "mesh", name=file.stem, file=mjcf.Asset(file.read_bytes(), file.suffix)
        )
        body.add(
            "geom", name=f"{body.name}_look", type="mesh", mesh=mesh, rgba=rgba,
            contype=0, conaffinity=0, group=ROBOT_VISUAL, mass=0,
        )  # fmt: skip


def _add_environment(root: mjcf.RootElement, environment: Environment) -> None:
    """Floor, table tops and three walls. Supports collide; walls are visual only."""
    floor = _material(root, "floor", _tiles((196, 199, 202)), repeat=1 / _TILE)
    top = _material(root, "top", _grain((170, 128, 84)), repeat=1.0)
    ground = root.worldbody.add("geom", type="plane", size=(3, 3, 0.1), material=floor, condim=3, friction=_FRICTION)
    for name, support in environment.supports.items():
        if support.z == 0:
            ground.name = name
            continue
        root.worldbody.add(
            "geom", name=name, type="box", size=(*support.half_size, _SLAB), pos=(*support.center, support.z - _SLAB),
            material=top, condim=3, friction=_FRICTION,
        )  # fmt: skip
    x, y, z = _ROOM
    wall: dict[str, Any] = {"type": "box", "contype": 0, "conaffinity": 0, "rgba": (0.94, 0.95, 0.94, 1)}
    root.worldbody.add("geom", pos=(-x, 0, z), size=(0.02, y, z), **wall)
    for side in (-1, 1):
        root.worldbody.add("geom", pos=(0, side * y, z), size=(x, 0.02, z), **wall)
    root.asset.add(
        "texture", name="sky", type="skybox", builtin="gradient", width=64, height=384,
        rgb1=(0.86, 0.88, 0.90), rgb2=(0.66, 0.70, 0.74),
    )  # fmt: skip


def _material(root: mjcf.RootElement, name: str, image: Array, repeat: float) -> Any:
    _, png = cv2.imencode(".png", image[:, :, ::-1])
    texture = root.asset.add("texture", name=name, type="2d", file=mjcf.Asset(png.tobytes(), ".png"))
    return root.asset.add(
        "material", name=name, texture=texture, texrepeat=(repeat, repeat), texuniform=True, specular=0.05
    )


def _tiles(colour: tuple[int, int, int], size: int = 256) -> Array:
    image = _mottled(colour, size, 3.0)
    cv2.rectangle(image, (0, 0), (size - 1, size - 1), tuple(c - 22 for c in colour), 2)
    return image


def _grain(colour: tuple[int, int, int], size: int = 256) -> Array:
    return np.asarray(cv2.blur(_mottled(colour, size, 26.0), (61, 1)))


def _mottled(colour: tuple[int, int, int], size: int, spread: float) -> Array:
    noise = np.random.default_rng(0).normal(0, spread, (size, size, 1))
    return np.ascontiguousarray(np.clip(np.array(colour) + noise, 0, 255).astype(np.uint8))


_FRICTION = (0.8, 0.005, 0.0001)
