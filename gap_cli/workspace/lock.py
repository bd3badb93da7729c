"""lock.json: what a run's results depend on besides its own files: tools, plugins, models, libraries, sandbox."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import metadata
from typing import Any

from gap_cli import __version__
from gap_cli.workspace.stages import digest, folder_digest
from gap_runtime.bundle.digest import BundleDigest, differences
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.tool import Tool
from gap_runtime.plugins import Registry

SCHEMA = "gap/lock/v1"
LIBRARIES = ("dm-control", "mujoco", "numpy", "ompl", "opencv-python-headless", "pytorch-kinematics", "ruckig",
             "scikit-learn", "scipy", "torch")  # fmt: skip


def build_lock(registry: Registry, task: Task | None, skills: Mapping[str, str], sandbox: str) -> dict[str, Any]:
    """The lock as plain data, every mapping sorted by key. `skills` maps a skill to the digest of its files; `task` is
    None for a graph that was not said to be for one."""
    robots = {p.model: registry.robot(p.model) for p in task.robots} if task else {}
    of = {"name": task.name, "variant": task.variant, "sha256": folder_digest(task.path)} if task else {}
    return {
        "schema": SCHEMA,
        "engine": __version__,
        "sandbox": sandbox,
        "task": of,
        "robots": {name: _robot(robots[name]) for name in sorted(robots)},
        "skills": dict(sorted(skills.items())),
        "plugins": {name: registry.plugins[name].version for name in sorted(registry.plugins)},
        "libraries": _versions(LIBRARIES),
        "tools": lock_tools(registry.tools),
    }


def lock_changes(before: Mapping[str, Any], now: Mapping[str, Any], used: BundleDigest) -> list[str]:
    """What differs between two locks and can change what a bundle that relies on `used` does, each part by name. The
    contracts of tools and the digests of skills are the bundle's own business (`BundleDigest.changes`)."""
    found = [f"{key} changed from {before.get(key)} to {now[key]}" for key in ("engine", "sandbox")
             if before.get(key) != now[key]]  # fmt: skip
    was, now_is = ((lock.get("task") or {}).get("name", "none") for lock in (before, now))
    if was != now_is:
        found.append(f"task changed from {was} to {now_is}")
    elif before.get("task") != now["task"]:
        found.append(f"task {was} changed")
    found += differences(before.get("robots", {}), now["robots"], "robot ")
    found += differences(before.get("libraries", {}), now["libraries"], "library ")

    def serving(lock: Mapping[str, Any]) -> dict[str, str]:
        """Who serves each tool that is used, and in which version."""
        tools = {name: tool for name, tool in lock.get("tools", {}).items() if name in used.tools}
        versions = lock.get("plugins", {})
        return {n: f"{t['provider']} ({t['plugin']} {versions.get(t['plugin'], '')})" for n, t in tools.items()}

    return found + differences(serving(before), serving(now), "the provider of tool ")


def lock_tools(tools: Mapping[str, Tool]) -> dict[str, dict[str, str]]:
    """Who serves each tool and under which contract."""
    return {
        name: {"provider": t.provider, "plugin": t.plugin, "contract": t.spec.schema_hash}
        for name, t in sorted(tools.items())
    }


def _robot(spec: RobotSpec) -> dict[str, str]:
    return {"model": spec.model_file.name, "sha256": digest(spec.model_file)}


def _versions(names: tuple[str, ...]) -> dict[str, str]:
    found: dict[str, str] = {}
    for name in names:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found
