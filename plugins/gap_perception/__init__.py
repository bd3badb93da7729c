"""Perception tools served from pixels and object models: `observation.*`, detection, segmentation, questions."""

from __future__ import annotations

from typing import Any

from gap_runtime.contracts.bench import BenchContext, BenchReport
from gap_runtime.hookspecs import Register, hookimpl


@hookimpl
def gap_register_tools(register: Register) -> None:
    from gap_perception import detect, observation, segment
    from gap_perception.language import tools as language
    from gap_perception.models import tools as mesh
    from gap_perception.tracking import tools as tracker

    for module in (observation, detect, segment, language, tracker, mesh):
        for tool in module.TOOLS:
            register(tool)


@hookimpl
def gap_register_preparations(register: Register) -> None:
    register("object models", _learn_models)


def _learn_models(ctx: Any) -> None:
    """Render and describe the task's object models once, before an episode asks for them."""
    from gap_perception.scene.analyse import vocabulary_of

    vocabulary_of(ctx)


@hookimpl
def gap_register_benchmarks(register: Register) -> None:
    register("perception", _perception)


def _perception(bench: BenchContext) -> BenchReport:
    """Detection, masks and boxes on random cluttered scenes, by sensor, clutter and object."""
    from gap_perception.bench.run import run

    return run(bench)
