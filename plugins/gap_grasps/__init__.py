"""Grasp generation on point clouds (`graspgen.*`, `graspnet.*`, `m2t2.*`): antipodal sampling, embedded, no weights."""

from __future__ import annotations

from gap_runtime.contracts.bench import BenchContext, BenchReport
from gap_runtime.hookspecs import Register, hookimpl


@hookimpl
def gap_register_tools(register: Register) -> None:
    from gap_grasps import tools

    for tool in tools.TOOLS:
        register(tool)


@hookimpl
def gap_register_benchmarks(register: Register) -> None:
    register("grasps", _grasps)
    register("grasp-calibration", _calibration)


def _grasps(bench: BenchContext) -> BenchReport:
    """Grasps executed in physics, by generator, object and score."""
    from gap_grasps.bench.run import run

    return run(bench)


def _calibration(bench: BenchContext) -> BenchReport:
    """The map from a grasp's measures to its chance of success, fitted in physics on development seeds."""
    from gap_grasps.fit import run

    return run(bench)
