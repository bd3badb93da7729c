"""The engine's own benchmarks, registered like anyone's."""

from gap_runtime.contracts.bench import BenchContext, BenchReport
from gap_runtime.hookspecs import Register, hookimpl


@hookimpl
def gap_register_benchmarks(register: Register) -> None:
    """What `gap bench` can run without any other plugin."""
    register("graph", _graph)
    register("validate", _validate)
    register("jail", _jail)


def _graph(bench: BenchContext) -> BenchReport:
    """What a node costs, beside LangGraph and py_trees."""
    from gap_cli.bench.graph import run

    return run(bench)


def _validate(bench: BenchContext) -> BenchReport:
    """What it costs to judge, compile and draw a graph."""
    from gap_cli.bench.validate import run

    return run(bench)


def _jail(bench: BenchContext) -> BenchReport:
    """What the jail costs an inline script."""
    from gap_cli.bench.jail import run

    return run(bench)
