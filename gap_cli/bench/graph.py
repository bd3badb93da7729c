"""What a node costs: a chain and a fan-out of nodes that do nothing, beside LangGraph and py_trees.

Both are development dependencies, measured where they are installed. A LangGraph node returns an empty update; a
py_trees behaviour returns SUCCESS; ours call a tool that returns nothing, with every check a real tool would pass.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from importlib.util import find_spec
from typing import Annotated, Any, TypedDict

from gap_cli.bench.timing import time_in_turns
from gap_runtime.contracts.bench import BenchContext, BenchReport
from gap_runtime.graph.model import Workflow
from gap_runtime.run.execute import RunSetup, run_graph
from gap_runtime.testing import compile_fake, fake_workflow

NODES = 50
GOAL_US = 10.0  # per node, one after the other
Subject = Callable[[], object]


def run(bench: BenchContext) -> BenchReport:
    """Microseconds per node, whole runs from start to end."""
    subjects: dict[tuple[str, str], Subject] = {}
    for shape, names in (("chain", _chain()), ("fan-out", _fan_out())):
        subjects["GaP", shape] = _gap(names)
    subjects["GaP, observed", "chain"] = _gap(_chain(), observed=True)
    for name, available, make in (("LangGraph", "langgraph", _langgraph), ("py_trees", "py_trees", _py_trees)):
        if find_spec(available) is not None:
            subjects |= {(name, shape): make(shape) for shape in ("chain", "fan-out")}
    timings = time_in_turns({f"{engine}, {shape}": call for (engine, shape), call in subjects.items()}, bench)
    rows = []
    for engine, shape in subjects:
        t = timings[f"{engine}, {shape}"]
        rows.append((engine, shape, *(round(1e6 * s / NODES, 2) for s in (t.median, t.best, t.p90, t.cpu))))
    return BenchReport(
        f"Cost per node that does nothing [us], {NODES} nodes",
        ("engine", "shape", "median", "best", "p90", "processor"),
        tuple(rows),
        (
            "A run goes from start to end, what it takes to start and stop included, divided by the number of nodes.",
            "Engines take turns within every round, in one process.",
            "median, best and p90 are wall time; processor is the median of processor time over all threads, which "
            "does not grow with what else the machine does.",
            f"The goal is {GOAL_US:g} us per node in a chain.",
            "py_trees ticks its tree on the caller's thread, the fan-out too; GaP and LangGraph use threads.",
        ),
        ("langgraph", "py_trees"),
    )


def _chain() -> Workflow:
    names = [f"n{i:02d}" for i in range(NODES)]
    return fake_workflow(
        dict.fromkeys(names, "fake.Nothing"), list(zip(["START", *names], [*names, "done"], strict=True))
    )


def _fan_out() -> Workflow:
    names = [f"n{i:02d}" for i in range(NODES)]
    return fake_workflow(
        dict.fromkeys(names, "fake.Nothing"), [("START", n) for n in names] + [(n, "done") for n in names]
    )


def _gap(workflow: Workflow, *, observed: bool = False) -> Subject:
    graph, setup = compile_fake(workflow), RunSetup()
    observers = [lambda event: None] if observed else []

    def go() -> None:
        if run_graph(graph, setup, observers).status != "success":
            raise AssertionError("the graph did not succeed")

    return go


def _langgraph(shape: str) -> Subject:
    from langgraph.graph import END, START, StateGraph

    state: Any = TypedDict("state", {"seen": Annotated[list, operator.add]})  # type: ignore[type-arg]
    graph: Any = StateGraph(state)
    names = [f"n{i:02d}" for i in range(NODES)]
    for name in names:
        graph.add_node(name, lambda state: {"seen": []})
    if shape == "chain":
        links = list(zip([START, *names], [*names, END], strict=True))
    else:
        links = [(START, n) for n in names] + [(n, END) for n in names]
    for a, b in links:
        graph.add_edge(a, b)
    compiled, settings = graph.compile(), {"recursion_limit": 2 * NODES}
    return lambda: compiled.invoke({"seen": []}, settings)


def _py_trees(shape: str) -> Subject:
    import py_trees

    children = [py_trees.behaviours.Success(name=f"n{i:02d}") for i in range(NODES)]
    root: Any
    if shape == "chain":
        root = py_trees.composites.Sequence(name="chain", memory=True, children=children)
    else:
        policy = py_trees.common.ParallelPolicy.SuccessOnAll(synchronise=False)
        root = py_trees.composites.Parallel(name="fan", policy=policy, children=children)

    def tick() -> None:
        root.tick_once()
        if root.status != py_trees.common.Status.SUCCESS:
            raise AssertionError("the tree did not succeed")

    return tick
