"""One episode: a world reset to an instance, the graph run to its end, the outcome judged, everything in one row."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from gap_cli.rehearse.episode_monitor import Watch
from gap_cli.rehearse.judge import SequenceMonitor, Verdict, judge
from gap_cli.rehearse.prepare import Prepared
from gap_cli.rehearse.rows import SCHEMA, void_episode
from gap_runtime.contracts.encoding.codec import to_plain
from gap_runtime.contracts.engine import EpisodeResult
from gap_runtime.contracts.failures import GapError, SimulationDivergedError, TaskInfeasibleError
from gap_runtime.contracts.simulator import Instance, Simulator
from gap_runtime.run.events import Observer
from gap_runtime.run.execute import RunResult, RunSetup, run_graph


def run_episode(
    prepared: Prepared,
    simulator: Simulator,
    setup: RunSetup,
    observers: Sequence[Observer] = (),
    on_reset: Callable[[], None] = lambda: None,
) -> tuple[EpisodeResult, bool]:
    """Roll out the seed of `setup`; the world is left at the episode's last instant.

    `on_reset` is called once the instance stands. The second value is whether the world can be trusted with another
    episode. A bug in the engine raises.
    """
    start = time.perf_counter()
    seed = setup.seed
    try:
        instance = simulator.sample(seed)
        simulator.reset(instance)
    except TaskInfeasibleError as error:
        return _lost(seed, "infeasible", error), True
    except SimulationDivergedError as error:
        return _lost(seed, "diverged", error), False
    began, reset_s = simulator.time, time.perf_counter() - start
    on_reset()
    watch = Watch(simulator, prepared.graph, prepared.bundle.checkpoints, prepared.conditions.objects)
    sequence = SequenceMonitor(simulator, prepared.inventory.task.sequence)
    try:
        result = run_graph(prepared.graph, setup, [watch, *observers])
        motion = simulator.time - began
        verdict = judge(simulator, prepared.conditions, sequence)
        diverged = _divergence(result)
    except SimulationDivergedError as error:
        diverged = error
    finally:
        sequence.stop()
    if diverged is not None:
        return _lost(seed, "diverged", diverged), False
    row = episode_row(instance, result, watch, verdict, motion)
    timing = {
        "seed": seed, "wall_s": time.perf_counter() - start, "reset_s": reset_s, "motion_s": motion,
        "compute_s": result.compute_s, "cycle_s": motion + result.compute_s, "nodes": watch.computed,
    }  # fmt: skip
    return EpisodeResult(seed, row, timing), True


def episode_row(
    instance: Instance, result: RunResult, watch: Watch, verdict: Verdict, motion_s: float
) -> dict[str, Any]:
    """The canonical row: what happened, in world time, and nothing about the machine."""
    claimed = result.status == "success"
    success = claimed and verdict.success
    row = {
        "schema": SCHEMA, "seed": instance.seed, "status": _status(result, success), "success": success, "void": False,
        **({"stage": "", "cause": "", "reason": ""} if success else blame(result, watch, verdict)),
        "claimed": claimed, "end": result.end, "judged_success": verdict.success, "at_rest": verdict.at_rest,
        "judged": dict(verdict.conditions), "motion_s": motion_s, "scene": instance.scene,
        "instance": instance_summary(instance), "exits": [list(e) for e in result.exits],
        "subgraphs": watch.subgraphs, "nodes": watch.nodes,
    }  # fmt: skip
    return dict(to_plain(row, digits=6))


def blame(result: RunResult, watch: Watch, verdict: Verdict) -> dict[str, str]:
    """Where a failed episode went wrong first, of each subgraph's last visit: `stage`, a short `cause`, a `reason`."""
    last = {visit["node"]: visit for visit in watch.subgraphs}
    for name, visit in last.items():
        if not visit["passed"]:
            return {"stage": name, **_visit_blame(visit, watch)}
    if result.status in ("error", "cancelled"):
        node = result.failed_node
        return {"stage": node.partition("/")[0], "cause": watch.failed.get(node, result.status), "reason": result.error}
    missed = [name for name, holds in verdict.conditions.items() if not holds]
    stage = next(reversed(last), "")
    if missed:
        return {"stage": stage, "cause": missed[0], "reason": f"the task's condition {missed[0]!r} does not hold"}
    if not verdict.at_rest:
        return {"stage": stage, "cause": "not_at_rest", "reason": "the objects were not let go and at rest"}
    return {"stage": stage, "cause": "not_claimed", "reason": f"the graph ended at {result.end!r}, the job was done"}


def instance_summary(instance: Instance) -> dict[str, Any]:
    """Where each object stood: x, y, z [m] and yaw [deg]; then the joints."""
    found: dict[str, Any] = {}
    for name, pose in sorted(instance.poses.items()):
        yaw = float(np.degrees(pose.rotation.rotation.as_euler("ZYX")[0]))
        found[name] = [pose.position.x, pose.position.y, pose.position.z, yaw]
    return {**found, **dict(sorted(instance.joints.items()))}


def _visit_blame(visit: Mapping[str, Any], watch: Watch) -> dict[str, str]:
    """Why a subgraph is to blame: the node that failed in it, else the promise it broke, else its exit."""
    nodes = [n for n in watch.nodes if not n["ok"] and n["node"].partition("/")[0] == visit["node"]]
    if nodes and not visit["ok"]:
        node = nodes[-1]
        return {"cause": watch.failed.get(node["node"], "node_failed"), "reason": f"{node['node']}: {node['error']}"}
    broken = [name for name, p in visit["checkpoints"].items() if p["validate"] and not p["passed"]]
    if visit["ok"] and broken:
        return {"cause": broken[0], "reason": f"checkpoint {broken[0]!r} does not hold at exit {visit['exit']!r}"}
    return {"cause": visit["exit"], "reason": f"{visit['node']} ended with {visit['exit']!r}"}


def _status(result: RunResult, success: bool) -> str:
    if result.status == "success":
        return "success" if success else "failure"
    return result.status


def _divergence(result: RunResult) -> SimulationDivergedError | None:
    return next((e for _, e in result.failures if isinstance(e, SimulationDivergedError)), None)


def _lost(seed: int, status: str, error: GapError) -> EpisodeResult:
    return EpisodeResult(seed, void_episode(seed, status, str(error)), {"seed": seed})
