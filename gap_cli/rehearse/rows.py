"""The row of an episode: what happened, in world time, and where a failed one went wrong first."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from gap_runtime.contracts.encoding.codec import to_plain

if TYPE_CHECKING:
    from gap_cli.rehearse.episode_monitor import EpisodeMonitor
    from gap_cli.rehearse.judge import Verdict
    from gap_runtime.contracts.simulator import Instance
    from gap_runtime.run.execute import RunResult

SCHEMA = "gap/episode/v1"
WORKER_LOST = ("crashed", "hung")  # chance or the machine, not physics
VOID = (*WORKER_LOST, "diverged", "infeasible")


def void_episode(seed: int, status: str, reason: str) -> dict[str, Any]:
    """An episode that says nothing about the policy: its worker died, its physics blew up, its instance does not
    exist. It counts against the rate, so that a broken simulation can never raise one."""
    return {"schema": SCHEMA, "seed": seed, "status": status, "success": False, "void": True, "reason": reason}


def episode_row(
    instance: Instance, result: RunResult, monitor: EpisodeMonitor, verdict: Verdict, motion_s: float
) -> dict[str, Any]:
    """The canonical row: what happened, in world time, and nothing about the machine."""
    claimed = result.status == "success"
    success = claimed and verdict.success
    row = {
        "schema": SCHEMA, "seed": instance.seed, "status": _status(result, success), "success": success, "void": False,
        **({"stage": "", "cause": "", "reason": ""} if success else attribute_failure(result, monitor, verdict)),
        "claimed": claimed, "end": result.end, "judged_success": verdict.success, "at_rest": verdict.at_rest,
        "judged": dict(verdict.conditions), "motion_s": motion_s, "scene": instance.scene,
        "instance": instance_summary(instance), "exits": [list(e) for e in result.exits],
        "subgraphs": monitor.subgraphs, "nodes": monitor.nodes,
    }  # fmt: skip
    return dict(to_plain(row, digits=6))


def attribute_failure(result: RunResult, monitor: EpisodeMonitor, verdict: Verdict) -> dict[str, str]:
    """Where a failed episode went wrong first, of each subgraph's last visit: `stage`, a short `cause`, a `reason`."""
    last = {visit["node"]: visit for visit in monitor.subgraphs}
    for name, visit in last.items():
        if not visit["passed"]:
            return {"stage": name, **_attribute_visit(visit, monitor, result)}
    if result.status in ("error", "cancelled"):
        node = result.failed_node
        cause = monitor.failed.get(node, result.status)
        return {"stage": node.partition("/")[0], "cause": cause, "reason": result.error}
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


def _attribute_visit(visit: Mapping[str, Any], monitor: EpisodeMonitor, result: RunResult) -> dict[str, str]:
    """Why a subgraph failed: the node that failed in it, else the checkpoint that does not hold, else what stopped the
    run in it, else its exit."""
    nodes = [n for n in monitor.nodes if not n["ok"] and n["node"].partition("/")[0] == visit["node"]]
    if nodes and not visit["ok"]:
        node = nodes[-1]
        return {"cause": monitor.failed.get(node["node"], "node_failed"), "reason": f"{node['node']}: {node['error']}"}
    broken = [name for name, p in visit["checkpoints"].items() if p["validate"] and not p["passed"]]
    if visit["ok"] and broken:
        return {"cause": broken[0], "reason": f"checkpoint {broken[0]!r} does not hold at exit {visit['exit']!r}"}
    if visit is monitor.subgraphs[-1] and result.status in ("error", "cancelled") and not result.failed_node:
        return {"cause": "stopped", "reason": result.error}
    return {"cause": visit["exit"], "reason": f"{visit['node']} ended with {visit['exit']!r}"}


def _status(result: RunResult, success: bool) -> str:
    if result.status == "success":
        return "success" if success else "failure"
    return result.status
