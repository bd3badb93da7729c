"""Random topologies: what the validator lets pass never lacks an input, and never runs without end."""

from __future__ import annotations

from pathlib import Path

from hypothesis import event, given, settings
from hypothesis import strategies as st

from gap_cli.analysis.catalog import Catalog
from gap_cli.validate.validator import validate
from gap_runtime.contracts.skill import Exits
from gap_runtime.graph.compile import compile_workflow
from gap_runtime.graph.load import parse_workflow
from gap_runtime.run.execute import RunSetup, run_graph
from gap_runtime.testing import FakeCell, fake_skill, fake_tools
from tests.unit.run.test_properties import choose

TOOLS = fake_tools(choose)


def subgraph(i, reads, writes, only_up):
    """A segment that reads some names, flips a coin, and gives a name: always, or at its exit `up` alone."""
    reads = {f"r{j}": {"type": "tool", "tool": "fake.Add", "inputs": {"a": {"$ref": f"in.{n}"}}}
             for j, n in enumerate(reads)}  # fmt: skip
    chain = [*reads, "coin"]
    nodes = {
        **reads, "coin": {"type": "tool", "tool": "test.Choose", "inputs": {"salt": i, "value": 1.0}},
        "late": {"type": "tool", "tool": "fake.Add", "inputs": {"a": 1.0}}, "up": {"type": "noop"},
        "down": {"type": "noop"},
    }  # fmt: skip
    edges = [*zip(["START", *chain], chain, strict=False), ("late", "up"), ("up", "END"), ("down", "END")]
    return {
        "skill": f"s{i}", "inputs": {n["inputs"]["a"]["$ref"][3:]: "float" for n in reads.values()}, "nodes": nodes,
        "outputs": {n: {"$ref": "late.total" if only_up else "coin.value"} for n in writes},
        "edges": [list(e) for e in edges], "exit": {"success_values": ["up", "down"]}, "on_error": "failed",
        "conditional_edges": {"coin": {"router_field": "up", "mapping": {"true": "late", "false": "down"}}},
    }  # fmt: skip


@st.composite
def topologies(draw):
    """Up to four segments that lead anywhere, some side by side, with the contracts they keep to."""
    count = draw(st.integers(1, 4))
    names, nodes = [f"s{i}" for i in range(count)], [*(f"s{i}" for i in range(count)), "done", "abort"]
    values = [f"v{i}" for i in range(count)]
    parts, routing = {}, {}
    for i, name in enumerate(names):
        reads = draw(st.lists(st.sampled_from(values[:i] or values), max_size=2, unique=True)) if count > 1 else []
        writes = draw(st.sampled_from([[values[i]], [values[i]], [values[0]], []]))
        parts[name] = subgraph(i, reads, writes, draw(st.booleans()))
        onwards = st.sampled_from([nodes[i + 1], nodes[i + 1], *nodes])
        routes = {"up": draw(onwards), "down": draw(onwards), "failed": "abort"}
        routing[name] = {"router_field": "exit", "mapping": routes}
    top = {n: {"type": "subgraph", "ref": n, "max_visits": draw(st.sampled_from([5, 5, 5, None]))} for n in names}
    ends = {"done": {"type": "end", "status": "success"}, "abort": {"type": "end", "status": "failure"}}
    forks = draw(st.lists(st.tuples(st.sampled_from(["START", *names]), st.sampled_from(nodes)), max_size=2))
    edges = [["START", "s0"], *map(list, forks)]
    data = {"version": 3, "nodes": top | ends, "edges": edges, "conditional_edges": routing}
    return parse_workflow({**data, "subgraphs": parts}, "topology")


def contracts(workflow):
    exits = Exits(success={"up": "heads", "down": "tails"}, failure="failed")
    return {
        name: fake_skill(["test.Choose"], exits=exits, inputs=d.inputs, outputs=dict.fromkeys(d.outputs, "float"))
        for name, d in workflow.subgraphs.items()
    }


@settings(max_examples=300, deadline=None)
@given(topologies())
def test_what_validates_always_has_its_inputs_and_ends(workflow):
    skills = contracts(workflow)
    found = validate(workflow, Catalog({n: t.spec for n, t in TOOLS.items()}, skills))
    event(", ".join(sorted({f.code for f in found})) or "sound")
    if found:
        return
    graph = compile_workflow(workflow, Path(), TOOLS, skills, {})
    for seed in range(4):
        result = run_graph(graph, RunSetup(cell=FakeCell(), seed=seed), [])
        out_of_visits = "more than 5 times" in result.error
        assert result.status != "error" or out_of_visits, result.error
        assert "failed" not in dict(result.exits).values() or out_of_visits, result.error
