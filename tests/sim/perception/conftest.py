"""One cell with every grocery, its objects arranged by seed, shared by all perception tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from gap_perception.bench.scenes import LEVELS, SCENE, bench_task, sample_scene
from gap_runtime.contracts.access import node_scope
from gap_runtime.contracts.standalone import StandaloneContext
from gap_runtime.contracts.task import load_task
from gap_runtime.plugins import load_registry

TASK = Path(__file__).parents[3] / "tasks" / "fulfill-grocery"
SEED = 1  # seven objects in view, a development seed


@pytest.fixture(scope="session")
def registry():
    return load_registry(only=["gap_mujoco", "gap_robots", "gap_perception", "gap_geometry"], entry_points=False)


@pytest.fixture(scope="session")
def cell(registry):
    task = bench_task(load_task(TASK))
    robots = {p.model: registry.robot(p.model) for p in task.robots}
    world = registry.cells["mujoco"].value(task, SCENE, robots)
    yield StandaloneContext(world, task, robots, registry.tools, object_renderer=registry.renderer)
    world.close()


@pytest.fixture(scope="session")
def present(cell):
    """Names of the objects in view."""
    instance, names = sample_scene(cell.task, LEVELS[1], SEED)
    cell.cell.reset(instance)
    return names


@pytest.fixture(scope="session")
def truth(cell, present):
    """Ground truth, for judging only."""
    return cell.cell.snapshot()


@pytest.fixture
def cameras(cell, present):
    """What a policy sees, remembered as its first observation; the test runs as a policy node."""
    cell.state.clear()
    with node_scope("test"):
        yield cell.tool("observation.GetObservation").cameras
