"""The MuJoCo world and the simulator's own tools. Importing this loads no simulator."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.task import ObjectModel, Task
from gap_runtime.contracts.task.rendering import ObjectView
from gap_runtime.hookspecs import Register, hookimpl

# `import mujoco` acts on MUJOCO_GL: by default it loads GLFW, which warns where there is no screen, and it raises where
# the value is none it knows or the library is missing. rendering.gl tries what was asked for, and says what is wrong.
if (_asked := os.environ.get("MUJOCO_GL", "off")) != "off":
    os.environ["GAP_MUJOCO_GL"] = _asked  # worker processes are started with "off", and need to know
os.environ["MUJOCO_GL"] = "off"


@hookimpl
def gap_register_checks(register: Register) -> None:
    register("rendering", _rendering)


@hookimpl
def gap_register_tools(register: Register) -> None:
    from gap_mujoco.tools import TOOLS

    for tool in TOOLS:
        register(tool)


@hookimpl
def gap_register_renderers(register: Register) -> None:
    register("mujoco", _render_objects)


@hookimpl
def gap_register_cells(register: Register) -> None:
    register("mujoco", _world)


def _world(task: Task, scene: str, robots: Mapping[str, RobotSpec]) -> Any:
    from gap_mujoco.simulator import MujocoSimulator

    return MujocoSimulator(task, scene, robots)


def _render_objects(objects: Mapping[str, ObjectModel], **how: Any) -> list[ObjectView]:
    from gap_mujoco.model.models import render_objects

    return render_objects(objects, **how)


def _rendering() -> str:
    from gap_mujoco.rendering.gl import probe

    return f"software OpenGL by {probe()}"
