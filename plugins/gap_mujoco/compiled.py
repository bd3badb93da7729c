"""Turns composed MJCF into a compiled MuJoCo model, quietly: warnings go to the log, never to a file in the cwd."""

from __future__ import annotations

import logging
from typing import Any

import mujoco
from dm_control import mjcf

log = logging.getLogger(__name__)

NEAR, FAR = 0.01, 8.0  # clipping planes [m]


def new_root(name: str, resolution: tuple[int, int]) -> mjcf.RootElement:
    """An empty scene with this world's units, look and clipping planes."""
    root = mjcf.RootElement(model=name)
    root.compiler.angle = "radian"
    root.compiler.autolimits = True
    root.statistic.extent = 1.0
    root.statistic.center = (0, 0, 0.3)
    root.visual.map.znear, root.visual.map.zfar = NEAR, FAR
    root.visual.quality.offsamples = 0
    root.visual.quality.shadowsize = 0
    getattr(root.visual, "global").offwidth = resolution[0]
    getattr(root.visual, "global").offheight = resolution[1]
    root.visual.headlight.ambient = (0.42, 0.42, 0.42)
    root.visual.headlight.diffuse = (0.25, 0.25, 0.25)
    root.visual.headlight.specular = (0, 0, 0)
    return root


def compile_model(root: mjcf.RootElement) -> Any:
    """The compiled `mujoco.MjModel`."""
    mujoco.set_mju_user_warning(log.warning)
    return mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
