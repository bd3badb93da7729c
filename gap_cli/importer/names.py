"""What the other dialect calls things and what they are called here, and the record of every translation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from gap_runtime.contracts.tool import ToolSpec, field_types
from gap_runtime.contracts.types.typeref import TypeRef

TOOLS = {
    "robot.get_observation": "observation.GetObservation",
    "robot.get_camera_pose": "observation.GetCameraPose",
    "robot.get_ee_pose": "robot_control.GetEEPose",
    "robot.get_gripper": "gripper.GetPosition",
    "robot.get_gripper_pose": "gripper.GetPose",
    "robot.open_gripper": "gripper.Open",
    "robot.close_gripper": "gripper.Close",
    "robot.execute_trajectory": "robot_control.ExecuteJointTrajectory",
    "robot.solve_ik": "pyroki.SolveIK",
}
SERVICES = {"robot": "robot_control", "geometry": "geometry_svc"}  # the method in CamelCase, the service as it is
SKILLS = {
    "perceiving-objects": "perception-single",
    "perceiving-objects-oneshot": "perception-any",
    "perceiving-objects-multiview": "perception-multi",
    "perceiving-object-parts": "perception-subpart",
    "grasping-direct-ik": "grasp-direct-ik",
    "grasping-short-axis": "grasp-short-axis",
    "grasping-with-planner": "grasp-curobo-obb",
    "transporting-objects": "transport-to-drop",
    "tracking-objects": "track-object",
}
TYPES = {"CameraFrame": "CameraObservation", "str": "string", "dict": "any", "Any": "any", "object": "any"}
FIELDS = {"arms": "arm_states", "points": "point_cloud", "joints": "joint_config"}
STAGES = {"percei": "perceive", "percep": "perceive", "grasp": "grasp", "transp": "transport", "plac": "place"}
FAILURES = ("failed", "not_found", "blocked", "error", "failure", "lost", "unreachable", "timeout")

Verdict = Literal["mapped", "guessed", "left"]


@dataclass(frozen=True)
class Row:
    """One translation: `mapped` by a rule, `guessed` (to be checked by a person), or `left` as it was."""

    verdict: Verdict
    where: str
    was: str
    now: str = ""
    note: str = ""


@dataclass
class Record:
    """Every translation once, in the order they were made."""

    tools: Mapping[str, ToolSpec] = field(repr=False)
    skills: Mapping[str, Any] = field(repr=False)
    name: str = ""
    rows: dict[Row, None] = field(default_factory=dict)

    def note(self, verdict: Verdict, where: str, was: Any, now: Any = "", note: str = "") -> None:
        """Add a row."""
        self.rows[Row(verdict, where, str(was), str(now), note)] = None

    def tool(self, name: str, where: str, *, arm: bool = False) -> str:
        """The tool that is called `name` in either dialect; `arm` asks for the form that takes an arm_id."""
        if name in self.tools:
            return name
        service, _, method = name.replace("-", "_").partition(".")
        wanted = TOOLS.get(name, f"{SERVICES.get(service, service)}.{method}").replace("_", "").lower()
        by_letters = {known.replace("_", "").lower(): known for known in self.tools}
        found = (by_letters.get(f"{wanted}arm") if arm else None) or by_letters.get(wanted)
        self.note("mapped" if found else "left", where, name, found or "", "" if found else "no tool of this name")
        return found or name

    def skill(self, name: str, where: str) -> str:
        """The skill that is called `name`, or that does the same under another name."""
        kebab = name.replace("_", "-")
        if kebab in self.skills:
            return kebab
        now = SKILLS.get(kebab, "")
        known = now in self.skills
        note = "another implementation: compare its SKILL.md" if known else "import its folder, or give --skills PATH"
        self.note("guessed" if known else "left", where, name, now if known else "", note)
        return now if known else kebab

    def type(self, name: Any, where: str) -> str:
        """A type in a contract's spelling; `any` for one that does not exist here."""
        text = str(name).strip()
        inner = text.removeprefix("list[").removesuffix("]") if text.startswith("list[") else ""
        base = TYPES.get((inner or text).partition("[")[0], inner or text)
        now = f"{base}[]" if inner else base
        try:
            TypeRef.parse(now)
        except ValueError:
            self.note("guessed", where, text, "any", "no such type")
            return "any"
        if now != text:
            self.note("mapped", where, text, now)
        return now

    def inputs(self, given: Mapping[str, Any], spec: ToolSpec | None, where: str) -> dict[str, Any]:
        """The inputs of a call under our names: by table, or where one name is over on either side."""
        if spec is None:
            return dict(given)
        known = {p.name: p for p in spec.inputs}
        over = [name for name in given if name not in known]
        free = [p.name for p in spec.inputs if p.required and p.name not in given]
        renamed = {name: FIELDS[name] for name in over if FIELDS.get(name) in known}
        if len(over) == len(free) == 1:
            renamed |= {over[0]: free[0]}
        for name in over:
            verdict: Verdict = "guessed" if name in renamed else "left"
            note = "" if name in renamed else f"{spec.name} has no such input"
            self.note(verdict, where, name, renamed.get(name, ""), note)
        return {renamed.get(name, name): value for name, value in given.items()}

    def reference(self, text: str, specs: Mapping[str, ToolSpec | None], where: str) -> str:
        """A `$ref` into the output of a tool, whose fields may have other names here or none."""
        head, *rest = text.split(".")
        spec = specs.get(head)
        if spec is None or not rest:
            return text
        fields = spec.fields or (field_types(spec.output) if spec.output else {})
        lists = spec.output is not None and spec.output.is_list
        path = [FIELDS.get(p, p) if p not in fields else p for p in rest]
        start = next((i for i, p in enumerate(path) if p in fields or (lists and p.isdigit())), None)
        path = path[start:] if start is not None else [] if spec.output and len(path) == 1 else rest
        now = ".".join([head, *path])
        if now != text:
            self.note("guessed", where, text, now, f"what {spec.name} returns")
        return now
