"""The loop without physics: it finds what is wrong, keeps what is proven, says why it ends, and repeats itself."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from gap_cli.author.plans import PlanData, Segment
from gap_cli.refine.candidates import leaks
from gap_cli.refine.diagnose import diagnose
from gap_cli.refine.loop import HELD_OUT, Settings, refine
from gap_runtime.bundle.bundle import WORKFLOW, GraphBundle
from gap_runtime.contracts.skill import Exits, Parameter, SkillContract
from gap_runtime.contracts.task import Reward
from gap_runtime.errors import RunError


def contract(**more):
    exits = Exits(success={"done": "done"}, failure="failed")
    return SkillContract(kind="composite", stage="grasp", template="t.j2", exits=exits, **more)


SKILLS = {
    "gentle": contract(
        swaps=["firm", "broken"], parameters={"depth": Parameter(type="float", default=0.2, range=(0, 1))}
    ),
    "firm": contract(swaps=["gentle"]),
    "broken": contract(),
}
PLAN = PlanData(
    task="little", instruction="Do it", author="test", scene="one",
    segments=[
        Segment(name="grasp_can", skill="gentle", stage="grasp", layer=0, exits=["done"], on_error="failed"),
        Segment(name="place_can", skill="firm", stage="place", layer=1, exits=["done"], on_error="failed"),
    ],
)  # fmt: skip


class World:
    """Candidates whose success follows from the plan: `firm` grasps all, `gentle` those that its depth is right for."""

    def __init__(self):
        self.inventory = SimpleNamespace(
            task=SimpleNamespace(objects={}, reward=Reward()), library=SimpleNamespace(contracts=SKILLS)
        )
        self.used, self.asked = 0, []

    def bundle(self, plan):
        grasp = plan.segments[0]
        if grasp.skill == "broken":
            raise RunError("S4 at grasp_can: broken has no such exit")
        return GraphBundle({WORKFLOW: json.dumps({"skill": grasp.skill, "depth": grasp.parameters.get("depth", 0.2)})})

    def rows(self, bundle, seeds):
        self.used += len(seeds)
        self.asked += seeds
        made = json.loads(bundle.files[WORKFLOW])
        return {s: self.row(s, made) for s in seeds}

    def row(self, seed, made):
        needed = np.random.default_rng(seed).random()
        ok = made["skill"] == "firm" or made["depth"] > needed
        moved = {"can": {"moved": [0.0, 0.0, 0.001 if ok else 0.05]}}
        return {
            "seed": seed, "status": "success" if ok else "failure", "success": bool(ok), "motion_s": 5.0, "void": False,
            "stage": "" if ok else "grasp_can", "cause": "" if ok else "slipped", "reason": "" if ok else "It slipped.",
            "nodes": [
                {"node": "grasp_can/close", "ok": True, "error": "", "changes": moved},
                {"node": "grasp_can/check", "ok": bool(ok), "error": "" if ok else "slipped", "changes": {}},
            ],
        }  # fmt: skip


@pytest.fixture(autouse=True)
def no_leaks(monkeypatch):
    monkeypatch.setattr("gap_cli.refine.loop.leaks", lambda *_: [])


def run(world=None, **settings):
    world, seen = world or World(), []
    return refine(PLAN, world, Settings(seed=0, held_out=40, **settings), seen.append), seen, world


def test_the_skill_at_fault_is_swapped_and_the_gain_is_held_out():
    history, seen, world = run(proposers=("swap",))
    assert seen[0].rate.value < 0.5 and history.iterations[-1].rate.value == 1.0
    assert [i.accepted.title for i in history.iterations if i.accepted] == ["swap grasp_can: firm"]
    assert history.judged.value == 1.0 and history.longest_run == 40
    assert {s for s in world.asked if s >= HELD_OUT} == set(range(HELD_OUT, HELD_OUT + 40))


def test_a_parameter_is_tuned_within_its_bounds():
    history, _, _ = run(proposers=("tune",), iterations=6)
    depths = [s.parameters["depth"] for i in history.iterations for s in i.plan.segments if "depth" in s.parameters]
    assert depths and all(0 <= d <= 1 for d in depths)
    assert history.iterations[-1].objective > history.iterations[0].objective


def test_what_the_validator_refuses_costs_no_episode_and_says_why():
    history, _, world = run(proposers=("swap",), iterations=1, candidates=2)
    refused = [t for i in history.iterations for t in i.trials if t.verdict is None]
    assert all("no such exit" in t.refused for t in refused)
    assert world.used == 30 + 30 * (len(history.iterations[1].trials) - len(refused)) + 40


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        ({"proposers": ("look",)}, "nothing is left to propose"),
        ({"proposers": ("swap",), "iterations": 1}, "1 iterations are done"),
        ({"proposers": ("swap",), "budget_s": 0.0}, "the budget is spent"),
    ],
)
def test_it_says_why_it_ended(settings, why):
    history, _, _ = run(**settings)
    assert history.stopped == why


def test_the_same_refinement_twice_is_the_same_history():
    first, second = (run(iterations=3)[0] for _ in range(2))
    assert [[t.data for t in i.trials] for i in first.iterations] == [
        [t.data for t in i.trials] for i in second.iterations
    ]


def test_the_first_node_that_deviated_is_named_with_its_numbers():
    world = World()
    rows = [world.row(seed, {"skill": "gentle", "depth": 0.5}) for seed in range(20)]
    (mode,) = diagnose(rows)
    assert (mode.stage, mode.cause, mode.first) == ("grasp_can", "slipped", "grasp_can/close")
    assert mode.count == sum(not r["success"] for r in rows)
    assert "can moved [m] 0.050 (successes: at most 0.001)" in mode.numbers.values()


def test_a_constant_at_a_true_position_of_a_tuning_instance_is_a_leak():
    def graph(value):
        nodes = {"go": {"type": "tool", "tool": "x.Y", "inputs": {"target": value}}}
        definition = {
            "skill": "fake",
            "nodes": nodes,
            "edges": [],
            "exit": {"success_values": ["done"]},
            "on_error": "failed",
        }
        workflow = {"version": 3, "nodes": {}, "edges": [], "subgraphs": {"main": definition}}
        return GraphBundle({WORKFLOW: json.dumps(workflow)})

    rows = [{"instance": {"can": [0.10, 0.20, 0.05, 30.0], "knob": 0.0}}]
    before = graph([0.5, 0.5, 0.5])
    assert leaks(graph([0.11, 0.20, 0.05]), before, rows) == ["main.go.target"]
    assert leaks(graph({"x": 0.10, "y": 0.21, "z": 0.05}), before, rows) == ["main.go.target"]
    assert leaks(graph([0.3, 0.2, 0.05]), before, rows) == []
    assert leaks(before, before, [{"instance": {"can": [0.5, 0.5, 0.5, 0.0]}}]) == []
