"""Grasp generation on point clouds (`graspgen.*`, `graspnet.*`, `m2t2.*`): antipodal sampling, embedded, no weights."""

from __future__ import annotations

from gap_runtime.contracts.bench import BenchReport, Progress
from gap_runtime.hookspecs import Register, hookimpl


@hookimpl
def gap_register_tools(register: Register) -> None:
    from gap_grasps import tools

    for tool in tools.TOOLS:
        register(tool)


@hookimpl
def gap_register_benchmarks(register: Register) -> None:
    register("grasps", _grasps)


def _grasps(progress: Progress) -> BenchReport:
    """Grasps executed in physics, by generator, object and score."""
    from gap_grasps.bench.run import run

    return run(progress)
