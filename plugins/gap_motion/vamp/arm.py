"""VAMP's model of an arm (Thomason, Kingston and Kavraki 2024), taken only where it moves as the RobotSpec says."""

from __future__ import annotations

import importlib
import importlib.util
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from gap_catalogue.shared.robot_chain import Chain, joint_range
from gap_motion.kinematics.damped_least_squares import halton_seeds
from gap_runtime.contracts.failures import ToolError
from gap_runtime.contracts.types import Array

DISTRIBUTION = "vamp-planner"
LOOKED_AT = 8  # configurations at which the two kinematics are compared
SAME = 1e-3  # m, and of a rotation matrix's entries: as far apart as they may be
HAND = 0.01  # m between the two TCPs, and of their axes' entries: farther apart, it is another hand
EMBEDDED = "Use the embedded planner: --provider 'curobo.*=embedded'."


@dataclass(frozen=True, eq=False)
class VampArm:
    """One of VAMP's robots: its module, T_last_tip (4, 4) of its tip behind the last joint, and which of its spheres
    stand still with the base."""

    name: str
    module: Any
    tip: Array
    fixed: Array

    def spheres(self, q: Array) -> Array:
        """Its spheres at a configuration (n,): rows of centre and radius (S, 4) in the arm's base frame [m]."""
        return np.array([(s.x, s.y, s.z, s.r) for s in self.module.fk(floats(q))])


def installed() -> bool:
    """True where VAMP can be imported; nothing is loaded. Another package is called `vamp` too: it has no `_core`."""
    found = importlib.util.find_spec("vamp")
    places = found.submodule_search_locations if found is not None else None
    return any((Path(place) / "_core").is_dir() for place in places or ())


def library() -> Any:
    """The package. Raises `ToolError` (`extra`) where it does not load."""
    try:
        return importlib.import_module("vamp")
    except ImportError as error:
        raise ToolError("extra", f"VAMP does not load: {error}.", hint=f"pip install {DISTRIBUTION}") from None


@lru_cache(maxsize=64)
def vamp_arm(chain: Chain) -> VampArm:
    """VAMP's model of an arm. Raises `ToolError` (`unsupported`) where none of its models moves like it."""
    vamp = library()
    for name in vamp.robots:
        module = getattr(vamp, name)
        if module.dimension() != chain.dof:
            continue
        tip = _tip(chain, module)
        if tip is not None:
            arm = VampArm(name, module, tip, np.zeros(module.n_spheres(), dtype=bool))
            here, there = arm.spheres(np.zeros(chain.dof)), arm.spheres(np.full(chain.dof, 0.7))
            return VampArm(name, module, tip, np.abs(here - there).max(axis=1) < SAME)
    raise ToolError(
        "unsupported",
        f"VAMP has no model of {chain.spec.name}: none of {', '.join(vamp.robots)} moves and ends like it.",
        hint=EMBEDDED,
        detail={"robot": chain.spec.name, "models": list(vamp.robots)},
    )


def _tip(chain: Chain, module: Any) -> Array | None:
    """T_last_tip of a model whose tip is where the chain's last joint takes it in every configuration, else None."""
    q = halton_seeds(*joint_range(chain.spec), LOOKED_AT)
    tips = np.array([np.asarray(module.eefk(floats(row)), dtype=float) for row in q])
    behind = np.linalg.inv(chain.frames(q)[-1]) @ tips
    if np.abs(behind - behind[0]).max() > SAME:
        return None
    return np.asarray(behind[0]) if np.abs(behind[0] - chain.tcp).max() <= HAND else None


def floats(q: Array) -> list[float]:
    """A configuration (n,) as VAMP takes it."""
    return [float(x) for x in q]
