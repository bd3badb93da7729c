"""Turns composed MJCF into a compiled MuJoCo model, quietly: warnings go to the log, never to a file in the cwd."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np
from dm_control import mjcf

log = logging.getLogger(__name__)

TIMESTEP = 0.002  # [s]
NEAR, FAR = 0.01, 8.0  # clipping planes [m]
_LIGHT = 0.32


def new_root(name: str, resolution: tuple[int, int], lights: Iterable[tuple[float, float, float]]) -> mjcf.RootElement:
    """An empty scene with this world's units, physics and light, which shines from `lights` [m] to the origin."""
    root = mjcf.RootElement(model=name)
    root.compiler.angle = "radian"
    root.compiler.autolimits = True
    root.option.timestep = TIMESTEP
    root.option.integrator = "implicitfast"
    root.option.cone = "elliptic"
    root.option.impratio = 10
    root.option.flag.autoreset = "disable"  # a diverged episode is void, not quietly begun again
    root.statistic.extent = 1.0
    root.statistic.center = (0, 0, 0.3)
    root.visual.map.znear, root.visual.map.zfar = NEAR, FAR
    root.visual.quality.offsamples = 0
    root.visual.quality.shadowsize = 0
    getattr(root.visual, "global").offwidth = resolution[0]
    getattr(root.visual, "global").offheight = resolution[1]
    root.visual.headlight.ambient = (0.40, 0.40, 0.40)
    root.visual.headlight.diffuse = (0.25, 0.25, 0.25)
    root.visual.headlight.specular = (0, 0, 0)
    for position in lights:
        towards = -np.asarray(position) / np.linalg.norm(position)
        root.worldbody.add("light", directional=True, castshadow=False, dir=towards, diffuse=[_LIGHT] * 3)
    return root


def compile_model(root: mjcf.RootElement) -> Any:
    """The compiled `mujoco.MjModel`."""
    mujoco.set_mju_user_warning(log.warning)
    return mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
