"""The grocery job with one object, as an author with a given grasp writes it, run in physics and judged."""

from __future__ import annotations

from pathlib import Path

from gap_cli.author import generate, plan
from gap_cli.rehearse.episode_monitor import EpisodeMonitor
from gap_cli.rehearse.judge import judge, make_conditions
from gap_cli.skills import SkillLibrary, load_library
from gap_runtime.contracts.task import load_task
from gap_runtime.graph.checkpoints import parse_checkpoints
from gap_runtime.graph.compile import compile_workflow
from gap_runtime.plugins import load_registry
from gap_runtime.run.execute import RunSetup, run_graph

REGISTRY = load_registry()
LIBRARY = load_library(REGISTRY.skill_paths)
SPECS = {name: tool.spec for name, tool in REGISTRY.tools.items()}
GRASPS = [name for name, b in LIBRARY.items() if b.contract.stage == "grasp" and set(b.contract.tools) <= set(SPECS)]
CARRIES = LIBRARY["transport-to-drop"].contract.parameters["mode"].choices
TASK = Path(__file__).parents[3] / "tasks" / "fulfill-grocery"
SAY = "Pick the milk and place it in the basket"
SEED = 1


class Cell:
    """The milk, a neighbour and the basket before the arms of a variant."""

    def __init__(self, variant: str) -> None:
        task = load_task(TASK, variant)
        scenes = {"milk": {"milk": "slot_b", "butter": "slot_e", "basket": "bin"}}
        self.task = task.model_copy(update={"scenes": scenes})
        robots = {p.model: REGISTRY.robot(p.model) for p in task.robots}
        self.cell = REGISTRY.cells["mujoco"].value(self.task, "milk", robots)

    def run(self, grasp: str, mode: str, folder: Path) -> tuple[list[str], bool]:
        """Grasp and carry once: the subgraphs that broke a promise, and whether the milk is in the basket at rest.

        Raises `ExecutionError` when the graph does not end with success.
        """
        task, world = self.task, self.cell
        graph, checkpoints = graph_of(task, grasp, mode, folder)
        conditions = make_conditions(task, [{"target": "milk", "container": "basket"}])
        world.reset(world.sample(SEED))
        watch = EpisodeMonitor(world, graph, checkpoints, conditions.objects)
        setup = RunSetup(
            cell=world, task=task, seed=SEED, cell_budget_s=task.max_time, lockstep=True, renderer=REGISTRY.renderer
        )
        run_graph(graph, setup, [watch]).raise_for_status()
        return [visit["node"] for visit in watch.subgraphs if not visit["passed"]], judge(world, conditions).success


def graph_of(task, grasp, mode, folder):
    """The graph an author with this one grasp makes, carrying in this mode, and its checkpoints."""
    kept = SkillLibrary([b for name, b in LIBRARY.items() if name == grasp or b.contract.stage != "grasp"])
    data = plan(task, SAY, kept, SPECS).data
    for segment in data["segments"]:
        segment["parameters"] |= {"mode": mode} if segment["skill"] == "transport-to-drop" else {}
    assert grasp in [segment["skill"] for segment in data["segments"]]
    made = generate(data, task, kept, SPECS)
    for path, text in made.scripts.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    canonical = kept.canonical_scripts(made.workflow, folder)
    graph = compile_workflow(made.workflow, folder, REGISTRY.tools, kept.contracts, canonical)
    return graph, {name: parse_checkpoints(text, name) for name, text in made.checkpoints.items()}
