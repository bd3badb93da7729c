"""A cell in physics with groceries, a pan, mugs and look-alikes, in which a skill's canonical subgraph runs alone."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from gap_cli.analysis.catalog import contract_names
from gap_cli.author.build import build
from gap_cli.author.plans import Plan, PlanData, Segment
from gap_cli.skills import load_library
from gap_runtime.contracts.simulator import Instance
from gap_runtime.contracts.task import ObjectModel, Task, load_task
from gap_runtime.contracts.tool import Tool
from gap_runtime.contracts.types import Quaternion, Se3Pose, Vec3
from gap_runtime.graph.compile import compile_workflow
from gap_runtime.plugins import load_registry
from gap_runtime.run.execute import RunResult, RunSetup, run_graph

REGISTRY = load_registry(entry_points=False)
LIBRARY = load_library(REGISTRY.skill_paths)
PAN = {
    "label": "frying pan", "words": ["pan", "frypan"], "category": "cookware", "mass": 0.203,
    "shape": {"kind": "pan", "size": (0.356, 0.204, 0.058), "wall": 0.005, "floor": 0.006, "handle": (0.025, 0.012)},
    "looks": {"base": "#3b3d42", "accent": "#1b1b1d"},
}  # fmt: skip
MUG = {
    "label": "mug", "category": "cookware", "mass": 0.30,
    "shape": {"kind": "mug", "size": (0.120, 0.085, 0.095), "wall": 0.004, "floor": 0.006, "handle": (0.014, 0.008)},
    "looks": {"base": "#d8dde3", "accent": "#c0392b"},
}  # fmt: skip
GROCERIES = ("alphabet_soup", "milk", "butter", "bbq_sauce", "basket")
TWINS = ("twin_a", "twin_b")  # two cans of the same soup
SCENES = {"groceries": GROCERIES, "kitchen": ("frypan", "mug", "milk"), "twins": (*TWINS, "milk")}


def kitchen_task() -> Task:
    """The grocery task's cell, with other objects and scenes of their own."""
    task = load_task(Path(__file__).parents[3] / "tasks" / "fulfill-grocery")
    objects = {name: task.objects[name] for name in GROCERIES}
    objects |= {"frypan": ObjectModel.load(PAN, "frypan"), "mug": ObjectModel.load(MUG, "mug")}
    objects |= {name: task.objects["tomato_sauce"].model_copy(update={"label": "tin"}) for name in TWINS}
    region = next(iter(task.belief.regions))
    scenes = {scene: dict.fromkeys(names, region) for scene, names in SCENES.items()}
    return task.model_copy(update={"objects": objects, "scenes": scenes})


def segment(name: str, skill: str, layer: int = 0, **given: Any) -> Segment:
    """One use of a skill; `roles`, `names`, `literals` and `parameters` as in a plan."""
    contract = LIBRARY[skill].contract
    inputs, outputs = contract_names(contract, given.get("names", {}))
    return Segment(
        name=name, skill=skill, stage=contract.stage, layer=layer, exits=list(contract.exits.success),
        on_error=contract.exits.failure, outputs={n: str(t) for n, t in outputs.items()},
        inputs={n: str(t) for n, t in inputs.items() if not t.optional}, **given,
    )  # fmt: skip


def perceive(skill: str, target: str, text: str, *, slot: str = "target") -> Segment:
    """A segment that looks for the object `target`, called `text`, and binds what it finds as `<slot>_obb`, ..."""
    return segment(f"see_{slot}", skill, roles={"name": target}, names={"name": slot}, literals={"object_name": text})


def see_part(target: str, parent: str, part: str) -> Segment:
    """A segment that looks for a part of the object `target` and binds it as `target_obb`, ..."""
    literals = {"parent_prompt": parent, "subpart_prompt": part}
    return segment(
        "see_target", "perception-subpart", roles={"name": target}, names={"name": "target"}, literals=literals
    )


def standing(task: Task, name: str, x: float, y: float, yaw: float = 0.0) -> Se3Pose:
    """The object upright on the floor; yaw in degrees."""
    turn = Quaternion.of(Rotation.from_euler("z", yaw, degrees=True))
    return Se3Pose(Vec3(x, y, task.objects[name].shape.size[2] / 2), turn)


@dataclass
class Ran:
    """How a graph ended, and what its subgraphs produced by output name."""

    result: RunResult
    outputs: dict[str, Any] = field(default_factory=dict)

    @property
    def exits(self) -> dict[str, str]:
        """Exit by subgraph."""
        return dict(self.result.exits)


class Kitchen:
    """Worlds by scene, made when first asked for, and a way to run segments in them."""

    def __init__(self, folder: Path) -> None:
        self.task, self.folder = kitchen_task(), folder
        self.robots = {p.model: REGISTRY.robot(p.model) for p in self.task.robots}
        self.worlds: dict[str, Any] = {}

    def cell(self, scene: str, **poses: tuple[float, ...]) -> Any:
        """The world of a scene, reset with its objects at x, y [m] and yaw [deg]; what is not named stands far away."""
        if scene not in self.worlds:
            self.worlds[scene] = REGISTRY.cells["mujoco"].value(self.task, scene, self.robots)
        away = {name: (-1.15, 0.9 - 0.3 * i, 0.0) for i, name in enumerate(self.task.scenes[scene])}
        placed = {name: standing(self.task, name, *pose) for name, pose in (away | poses).items()}
        self.worlds[scene].reset(Instance(1, scene, placed))
        return self.worlds[scene]

    def run(self, world: Any, *segments: Segment, more: dict[str, Tool] | None = None) -> Ran:
        """Build, validate, compile and run the graph of the segments."""
        content = PlanData(task=self.task.name, instruction="try", author="test", scene="none", segments=list(segments))
        tools = REGISTRY.tools | (more or {})
        made = build(Plan.of(content), self.task, LIBRARY, {name: tool.spec for name, tool in tools.items()})
        for path, text in made.scripts.items():
            (self.folder / path).parent.mkdir(parents=True, exist_ok=True)
            (self.folder / path).write_text(text, encoding="utf-8")
        canonical = LIBRARY.canonical_scripts(made.workflow, self.folder)
        graph = compile_workflow(made.workflow, self.folder, tools, LIBRARY.contracts, canonical)
        ran = Ran(RunResult("error", "", [], "", "", {}, [], [], 0.0))

        def listen(event: Any) -> None:
            if event.kind == "subgraph_exited":
                ran.outputs |= event.data["outputs"]

        ran.result = run_graph(
            graph, RunSetup(cell=world, task=self.task, seed=1, lockstep=True, renderer=REGISTRY.renderer), [listen]
        )
        return ran

    def close(self) -> None:
        """Free the worlds."""
        for world in self.worlds.values():
            world.close()


def miss(box: Any, truth: Any) -> float:
    """Distance [m] between the centres of a perceived box and a body's true one."""
    return float(np.linalg.norm(box.center.array - truth.box.center.array))


def inside(points: np.ndarray, truth: Any, margin: float = 0.005) -> float:
    """Share of world points (N, 3) within a body's true box, widened by `margin` [m]."""
    local = (points - truth.box.center.array) @ truth.box.orientation.rotation.as_matrix()
    return float((np.abs(local) <= truth.box.extent.array + margin).all(axis=1).mean())
