"""Every skill that grasps and every way to carry, on every kind of arm: in physics, from what the cameras see."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from gap_cli.author import generate, plan
from gap_cli.contracts.task import load_task
from gap_cli.graph.checkpoints import parse_checkpoints
from gap_cli.graph.compile import compile_workflow
from gap_cli.graph.execute import RunSetup, run_graph
from gap_cli.plugins import load_registry
from gap_cli.rehearse.judge import judge, make_conditions
from gap_cli.rehearse.watch import Watch
from gap_cli.skills import SkillLibrary, load_library

pytestmark = pytest.mark.sim
REGISTRY = load_registry()
LIBRARY = load_library(REGISTRY.skill_paths)
SPECS = {name: tool.spec for name, tool in REGISTRY.tools.items()}
GROCERY = Path(__file__).parents[3] / "tasks" / "fulfill-grocery"
SAY = "Pick the milk and place it in the basket"
SEED = 1

VARIANTS = {"panda": "object", "ur5e": "ur5e"}
GRASPS = [name for name, b in LIBRARY.items() if b.contract.stage == "grasp" and set(b.contract.tools) <= set(SPECS)]
CARRIES = LIBRARY["transport-to-drop"].contract.parameters["mode"].choices
JOBS = [*((grasp, CARRIES[0]) for grasp in GRASPS), *((GRASPS[0], mode) for mode in CARRIES[1:])]


@cache
def task_of(arm):
    """The grocery task with the milk, a neighbour and the basket, before one arm."""
    task = load_task(GROCERY, VARIANTS[arm])
    return task.model_copy(update={"scenes": {"milk": {"milk": "slot_b", "butter": "slot_e", "basket": "bin"}}})


@pytest.fixture(scope="module", params=VARIANTS)
def world(request):
    task = task_of(request.param)
    made = REGISTRY.worlds["mujoco"].value(task, "milk", {request.param: REGISTRY.robot(request.param)})
    made.arm = request.param
    yield made
    made.close()


def graph_of(task, grasp, mode, folder):
    """The graph an author with this one grasp makes, carrying in this mode, and its checkpoints."""
    kept = SkillLibrary([b for name, b in LIBRARY.items() if name == grasp or name not in GRASPS])
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


@pytest.mark.parametrize(("grasp", "mode"), JOBS)
def test_the_milk_is_grasped_and_ends_in_the_basket(world, grasp, mode, tmp_path):
    task = task_of(world.arm)
    graph, checkpoints = graph_of(task, grasp, mode, tmp_path)
    conditions = make_conditions(task, [{"target": "milk", "container": "basket"}])
    world.reset(world.sample(SEED))
    watch = Watch(world, graph, checkpoints, conditions.objects)
    setup = RunSetup(world=world, task=task, seed=SEED, world_budget_s=task.max_time, lockstep=True)
    run_graph(graph, setup, [watch]).raise_for_status()
    assert [visit["node"] for visit in watch.subgraphs if not visit["passed"]] == []
    assert judge(world, conditions).success


def test_there_is_something_to_try():
    assert {"grasp-curobo-obb", "grasp-short-axis", "grasp-direct-ik"} <= set(GRASPS)
    assert set(CARRIES) == {"free_space", "collision_aware"}
    assert [task_of(arm).robots[0].model for arm in VARIANTS] == list(VARIANTS) == ["panda", "ur5e"]
