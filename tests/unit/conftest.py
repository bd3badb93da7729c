"""A little cell as an installed plugin: a world without physics, a task, a skill and a tool that can misbehave."""

from __future__ import annotations

import json
import os
import sys

import pytest

from gap_cli.sandbox import level
from gap_cli.workspace.canonical import write_json, write_text
from gap_cli.workspace.inventory import Inventory
from gap_cli.workspace.run import Run, RunConfig
from gap_cli.workspace.validation import validation_data
from gap_runtime.bundle.bundle import GraphBundle
from gap_runtime.graph.dump import dump_workflow
from gap_runtime.testing import fake_workflow

PLUGIN = '''
import ctypes, json, os, signal, time
from dataclasses import replace
from pathlib import Path
from gap_runtime.contracts.failures import GraspError, SimulationDivergedError, TaskInfeasibleError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import Vec3
from gap_runtime.hookspecs import hookimpl
from gap_runtime.testing import FAKE_ROBOT, FAKE_TOOLS, FakeCell

HERE = Path(__file__).parent

def meet(folder, count):
    """Wait for `count` processes to come here."""
    if folder:
        Path(folder, str(os.getpid())).touch()
        while len(os.listdir(folder)) < count: time.sleep(0.01)

def fault_of(seed):
    return json.loads(os.environ.get("CELL_FAULTS", "{}")).get(str(seed), "")

class Cell(FakeCell):
    def __init__(self, task, scene, robots):
        meet(os.environ.get("CELL_MEET"), 2)
        super().__init__(objects={name: Vec3(0.0, 0.1 * i, 0.05) for i, name in enumerate(task.scene_objects(scene))})
    def sample(self, seed):
        if fault_of(seed) == "crowded": raise TaskInfeasibleError("can in region here is in reach in 0 of 100 draws.")
        return super().sample(seed)

@tool("cell.Act", effect="actuate", resources=("arm:0",), deadline_s=30.0)
def act(ctx: ToolContext, seconds: float = 0.2) -> float:
    """Lets time pass, and does to its worker what CELL_FAULTS says for this seed."""
    ctx.cell.wait(seconds)
    if "CELL_MEET" in os.environ:
        Path(os.environ["CELL_MEET"]).with_name("worked").joinpath(str(os.getpid())).touch()
        time.sleep(0.05)
    fault = fault_of(ctx.seed)
    if fault == "segv": ctypes.string_at(0)
    if fault == "kill": os.kill(os.getpid(), signal.SIGKILL)
    if fault == "sleep":
        if "CELL_ASLEEP" in os.environ: Path(os.environ["CELL_ASLEEP"], str(ctx.seed)).touch()
        time.sleep(60)
    if fault == "diverge": raise SimulationDivergedError("qacc is not finite")
    if fault == "slip": raise GraspError("slipped", "The jaws closed on nothing.")
    if fault == "count" and "x" not in ctx.state: ctx.state["x"] = 1
    return ctx.cell.time

@hookimpl
def gap_register_tools(register):
    for t in (*FAKE_TOOLS, act): register(t)

@hookimpl
def gap_register_cells(register):
    register("cell", Cell)

@hookimpl
def gap_register_robots(register):
    register(replace(FAKE_ROBOT, model_file=HERE / "fake.xml"))

class Elsewhere:
    """Rolls out nothing, and says how it was asked."""
    def __init__(self, workers): self.workers = workers
    def run(self, job, seeds, report, stop):
        from gap_runtime.contracts.engine import EpisodeResult
        for seed in seeds:
            reason = f"{self.workers} workers, recording {job.record}"
            row = {"seed": seed, "status": "crashed", "success": False, "void": True, "reason": reason}
            report(EpisodeResult(seed, row, {"seed": seed}))

@hookimpl
def gap_register_engines(register):
    register("elsewhere", Elsewhere)

@hookimpl
def gap_register_tasks(register):
    register(HERE / "tasks")

@hookimpl
def gap_register_skills(register):
    register(HERE / "skills")
'''
TASK = """
schema: gap/task/v1
name: little
description: Two boxes.
instructions: [Do it]
environment: {simulator: cell, supports: {floor: {z: 0.0, half_size: [1.0, 1.0]}}, workspace: [[-1, -1, 0], [1, 1, 1]]}
robots: [{model: fake}]
objects:
  can: {label: can, shape: {kind: cylinder, size: [0.06, 0.06, 0.1]}, mass: 0.1, looks: {base: "#c02020"}}
  bin:
    shape: {kind: open_box, size: [0.2, 0.2, 0.1], wall: 0.01, floor: 0.01}
    label: bin
    mass: 0.2
    accepts: [object]
belief: {regions: {here: {center: [0, 0], support: floor}, there: {center: [0, 0.1], support: floor}}}
scenes: {two: {can: here, bin: there}}
success: {right: 'w.body("{target}").x > -0.03'}
"""
SKILL = "---\nname: fake\ndescription: Use when testing.\nmetadata:\n  gap-contract: contract.yaml\n---\nDo it.\n"
CONTRACT = """
kind: composite
template: t.py.j2
tools: [cell.Act, fake.Look, fake.Nothing, fake.Move, fake.Grip]
exits: {success: {done: it is done}, failure: failed}
swaps: [other-skill]
parameters: {pace: {type: float, default: 1.0, range: [0.5, 2.0], unit: s}}
"""
GOAL = {"predicate": "in", "roles": {"target": "can", "container": "bin"}}
CHECKPOINTS = """
CHECKPOINTS = [
    Checkpoint(
        "near", 'w.body("can").y < 0.04', rationale="The can ends up near.", diagnostics={"can_y": 'w.body("can").y'}
    ),
]
"""


@pytest.fixture(scope="session")
def plugin_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    files = {
        "little_cell/__init__.py": PLUGIN,
        "little_cell/fake.xml": "<mujoco/>",
        "little_cell/tasks/little/task.yaml": TASK,
        "little_cell/skills/fake/SKILL.md": SKILL,
        "little_cell/skills/fake/contract.yaml": CONTRACT,
        "little_cell/skills/fake/t.py.j2": "# nothing",
        "little_cell-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: little-cell\nVersion: 1.0\n",
        "little_cell-1.0.dist-info/entry_points.txt": "[gap]\nlittle = little_cell\n",
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


@pytest.fixture
def little_cell(plugin_folder, monkeypatch):
    """The plugin installed, here and in every process started from here."""
    monkeypatch.syspath_prepend(str(plugin_folder))
    inherited = [p for p in os.environ.get("PYTHONPATH", "").split(os.pathsep) if p]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(plugin_folder), *inherited]))
    yield
    for name in [m for m in sys.modules if m.startswith("little_cell")]:
        del sys.modules[name]


@pytest.fixture
def faults(monkeypatch):
    """Which fault befalls which seed."""
    return lambda **by: monkeypatch.setenv(
        "CELL_FAULTS", json.dumps({k.removeprefix("seed"): v for k, v in by.items()})
    )


@pytest.fixture
def accept():
    """Write down that a run is valid as it is, with what is installed now."""
    return accept_run


def accept_run(run):
    inventory = Inventory.of(Run(run.path).config)
    checked = inventory.digest(GraphBundle.load(run.graph_folder))
    write_json(run.path / "lock.json", inventory.lock(level()))
    write_json(run.path / "validate/findings.json", validation_data(run, checked, []))


@pytest.fixture
def make_run(tmp_path, little_cell):
    """A run at the stage `gap rehearse` wants it."""

    def make(root=tmp_path / "runs"):
        run = Run.create(root, RunConfig(task="little", instruction="Do it", seed=3))
        write_json(run.path / "plan/plan.json", {"schema": "gap/plan/v1"})
        goals = {"schema": "gap/goals/v1", "scene": "two", "goals": [GOAL]}
        write_json(run.path / "generate/goals.json", goals)
        workflow = fake_workflow(
            {"look": "fake.Look", "act": "cell.Act"}, [("START", "look"), ("look", "act"), ("act", "done")]
        )
        write_json(run.path / "generate/workflow.json", dump_workflow(workflow))
        write_text(run.path / "generate/checkpoints/main_sg.py", CHECKPOINTS)
        accept_run(run)
        return run

    return make


@pytest.fixture(scope="session")
def once():
    """`once(key, make)`: what `make` made when a test of this process first asked; only to be looked at."""
    made = {}

    def get(key, make):
        if key not in made:
            made[key] = make()
        return made[key]

    return get
