"""Skill libraries made of contracts alone, for planning without files."""

from __future__ import annotations

from pathlib import Path

from gap_cli.skills import SkillBundle, SkillLibrary
from gap_runtime.contracts.skill import SkillContract
from gap_runtime.contracts.tool import ToolSpec

OBB, POSE = "OrientedBoundingBox[world]", "Se3Pose[world]"
SPINE = {
    "look": {
        "stage": "perceive",
        "roles": ["name"],
        "outputs": {"<name>_obb": OBB, "<name>_mask": "Mask"},
        "literals": {"object_name": "string"},
        "effects": ["located(name)"],
        "tools": ["camera.See"],
    },
    "seize": {
        "stage": "grasp",
        "roles": ["target"],
        "inputs": {"target_obb": OBB},
        "outputs": {"ee_pose_at_grasp": POSE},
        "needs": ["hand_empty", "located(target)"],
        "effects": ["holding(target)", "-hand_empty", "-located(target)"],
        "tools": ["hand.Close"],
    },
    "drop-in": {
        "stage": "place",
        "roles": ["target", "container"],
        "inputs": {"container_obb": OBB, "container_mask": "Mask", "target_obb": OBB, "ee_pose_at_grasp": POSE},
        "needs": ["holding(target)", "located(container)"],
        "effects": ["in(target, container)", "hand_empty", "-holding(target)", "-located(container)"],
        "tools": ["hand.Open"],
    },
}
EFFECTS = {"camera.See": "sense", "camera.Wide": "sense", "hand.Close": "actuate", "hand.Open": "actuate"}


def contract(**given):
    base = {"kind": "composite", "exits": {"success": {"done": "done"}, "failure": "failed"}, "template": "t.py.j2"}
    return SkillContract.load({**base, **given}, "contract.yaml")


def library(**extra):
    """The spine's three skills, with others added, replaced, or (None) left out; underscores become hyphens."""
    given = {**SPINE, **{name.replace("_", "-"): value for name, value in extra.items()}}
    return SkillLibrary(
        SkillBundle(name, name, "", Path(name), "test", contract(**value), {}, {}, {}, None, None, Path(name))
        for name, value in given.items()
        if value is not None
    )


def tools(**extra):
    """Tool specs by name with nothing but an effect."""
    return {name: ToolSpec(name, (), None, {}, effect, (), 1.0) for name, effect in {**EFFECTS, **extra}.items()}
