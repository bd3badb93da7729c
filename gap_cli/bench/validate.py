"""What it costs to judge, compile and draw a graph of 200 nodes."""

from __future__ import annotations

from gap_cli.bench.timing import time_in_turns
from gap_cli.render.drawing import drawing
from gap_cli.testing import make_catalog
from gap_cli.validate.validator import validate
from gap_runtime.contracts.bench import BenchContext, BenchReport
from gap_runtime.graph.dump import dump_workflow
from gap_runtime.graph.load import parse_workflow
from gap_runtime.graph.model import Workflow
from gap_runtime.testing import compile_fake, fake_workflow

NODES = 200
WIDTH = 4  # branches side by side between two joins
GOAL_MS = 20.0


def run(bench: BenchContext) -> BenchReport:
    """Milliseconds per graph."""
    workflow, catalog = _workflow(), make_catalog()
    data = dump_workflow(workflow)
    timings = time_in_turns(
        {
            "parse": lambda: parse_workflow(data, "bench"),
            "validate": lambda: validate(workflow, catalog),
            "compile": lambda: compile_fake(workflow),
            "draw": lambda: drawing(workflow),
        },
        bench,
    )
    findings = [f for f in validate(workflow, catalog) if f.severity == "error"]
    rows = tuple((name, *(round(1e3 * s, 2) for s in (t.median, t.best, t.p90))) for name, t in timings.items())
    return BenchReport(
        f"A graph of {NODES} nodes, {WIDTH} branches wide [ms]",
        ("step", "median", "best", "p90"),
        rows,
        (f"The goal for validate is {GOAL_MS:g} ms.", f"The graph has {len(findings)} errors."),
        ("pydantic",),
    )


def _workflow() -> Workflow:
    """Layers of additions, each reading one of the layer before, with a join between layers."""
    nodes: dict[str, object] = {}
    edges: list[tuple[str, str]] = []
    before, layer = "START", 0
    while len(nodes) < NODES:
        join = f"j{layer:03d}"
        for i in range(min(WIDTH, NODES - len(nodes))):
            name = f"n{layer:03d}_{i}"
            reads = {"$ref": f"n{layer - 1:03d}_0.total"} if layer else 1.0
            nodes[name] = {"type": "tool", "tool": "fake.Add", "inputs": {"a": reads}}
            edges += [(before, name), (name, join)]
        nodes[join] = {"type": "noop"}
        before, layer = join, layer + 1
    return fake_workflow(nodes, [*edges, (before, "done")])
