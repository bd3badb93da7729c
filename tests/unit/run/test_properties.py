"""Well-formed graphs validate and run; of random mutations each is caught by a rule or runs just the same."""

from __future__ import annotations

import copy
import random
from typing import NamedTuple

from hypothesis import assume, event, given, settings
from hypothesis import strategies as st

from gap_cli.analysis.catalog import Catalog
from gap_cli.builder.assemble import assemble
from gap_cli.builder.source import spec_source, subgraph_source
from gap_cli.builder.workflow import WorkflowSpec
from gap_cli.validate.rules.table import rules
from gap_cli.validate.validator import validate
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.errors import GapError
from gap_runtime.graph.dump import dump_workflow
from gap_runtime.graph.load import parse_workflow
from gap_runtime.testing import FakeCell, fake_skill, fake_tools, fake_workflow, run_fake
from tests.unit.validate.kit import run as run_code

CODES = {rule.code for rule in rules()}


class Side(NamedTuple):
    """What `test.Choose` decides."""

    up: bool
    value: float


@tool("test.Choose", deadline_s=5.0)
def choose(ctx: ToolContext, salt: int, value: float = 0.0) -> Side:
    """A fair coin of the episode's seed, this node and how often it has been thrown, but heads in the end."""
    throws = ctx.state[salt] = ctx.state.get(salt, 0) + 1
    return Side(throws > 3 or random.Random(f"{ctx.seed} {salt} {throws}").random() < 0.5, value)


CATALOG = Catalog({n: t.spec for n, t in fake_tools(choose).items()}, {"fake": fake_skill(["test.Choose"])})


class Maker:
    """Draws a graph of nested blocks: in a row, side by side, either-or, and round again."""

    def __init__(self, draw):
        self.draw, self.nodes, self.edges, self.routing = draw, {}, [], {}

    def leaf(self, kind, before, choose=False):
        name = f"n{len(self.nodes)}"
        readable = [f"{n}.total" if self.nodes[n]["tool"] == "fake.Add" else f"{n}.value" for n in before]
        given = self.draw(st.sampled_from(readable)) if readable and self.draw(st.booleans()) else None
        value = {"$ref": given} if given else float(len(self.nodes))
        node = {"type": "tool", "tool": "fake.Add", "inputs": {"a": value, "b": 1.0}}
        if choose:
            node = {"type": "tool", "tool": "test.Choose", "inputs": {"salt": len(self.nodes), "value": value}}
        elif kind == "move":
            node = {"type": "tool", "tool": "fake.Move", "inputs": {"to": 0.1, "duration": 0.1}}
        self.nodes[name] = node
        return name

    def block(self, depth, before, moves):
        """A block; returns its first and last node, and what has surely run once it has. Only one branch may move."""
        shapes = ["leaf", "leaf", "row", "both", "either", "again"] if depth else ["leaf"]
        shape = self.draw(st.sampled_from(shapes))
        if shape == "leaf":
            kind = self.draw(st.sampled_from(["add", "add", "move"] if moves else ["add"]))
            name = self.leaf(kind, before)
            return name, name, before | ({name} if kind == "add" else set())
        if shape == "row":
            first, last, ran = self.block(depth - 1, before, moves)
            second, end, ran = self.block(depth - 1, ran, moves)
            self.edges.append((last, second))
            return first, end, ran
        if shape == "again":
            first, last, ran = self.block(depth - 1, before, moves)
            again, out = self.leaf("add", ran, choose=True), self.leaf("add", ran)
            self.edges.append((last, again))
            self.routing[again] = {"router_field": "up", "mapping": {"true": out, "false": first}}
            return first, out, ran | {again, out}
        fork = self.leaf("add", before, choose=shape == "either")
        a, a_end, ran_a = self.block(depth - 1, before | {fork}, moves)
        b, b_end, ran_b = self.block(depth - 1, before | {fork}, moves and shape == "either")
        join = self.leaf("add", ran_a | ran_b if shape == "both" else ran_a & ran_b)
        if shape == "both":
            self.edges += [(fork, a), (fork, b)]
        else:
            self.routing[fork] = {"router_field": "up", "mapping": {"true": a, "false": b}}
        self.edges += [(a_end, join), (b_end, join)]
        ran = ran_a | ran_b if shape == "both" else ran_a & ran_b
        return fork, join, ran | {join}


@st.composite
def workflows(draw):
    maker = Maker(draw)
    first, last, _ = maker.block(3, set(), True)
    edges = [("START", first), *maker.edges, (last, "done")]
    return fake_workflow(maker.nodes, draw(st.permutations(edges)), conditional_edges=maker.routing)


def run(workflow, seed):
    """How a run went, with everything every node gave, in order."""
    seen = []
    result = run_fake(workflow, choose, observers=[seen.append], cell=FakeCell(), seed=seed)
    story = [(e.path, str(e.data.get("output"))) for e in seen if e.kind == "node_finished"]
    return result, story


@settings(max_examples=60, deadline=None)
@given(workflows(), st.integers(0, 3))
def test_what_is_well_formed_validates_and_runs_the_same_every_time(workflow, seed):
    assert validate(workflow, CATALOG) == []
    result, story = run(workflow, seed)
    assert (result.status, result.error) == ("success", "")
    assert run(workflow, seed)[1] == story


@settings(max_examples=40, deadline=None)
@given(workflows())
def test_what_is_well_formed_can_be_written_back_as_builder_code(workflow):
    codes = {n: subgraph_source(n, d) for n, d in workflow.subgraphs.items()}
    built = {n: build(code)["sg"].to_dict() for n, code in codes.items()}
    spec = build(spec_source(workflow, CATALOG.skills))["spec"].to_dict()
    assert dump_workflow(assemble(spec, built)) == dump_workflow(workflow)


def build(code):
    """Run builder code here, where what `vos` offers is given by name."""
    return run_code(
        "\n".join(line for line in code.splitlines() if not line.startswith("from ")), WorkflowSpec=WorkflowSpec
    )


def mutate(data, draw):
    """One random mistake."""
    sg = data["subgraphs"]["main_sg"]
    names = [*sg["nodes"], "START", "END", "nowhere", "failed"]
    name = draw(st.sampled_from(sorted(sg["nodes"])))
    node, pick = sg["nodes"][name], lambda values: draw(st.sampled_from(sorted(values, key=str)))
    kind = pick(MUTATIONS)
    if kind == "drop edge":
        del sg["edges"][draw(st.integers(0, len(sg["edges"]) - 1))]
    elif kind == "add edge":
        sg["edges"].append([pick(names), pick(names)])
    elif kind == "bend edge":
        sg["edges"][draw(st.integers(0, len(sg["edges"]) - 1))][draw(st.integers(0, 1))] = pick(names)
    elif kind == "drop node":
        del sg["nodes"][name]
    elif kind == "rename node":
        sg["nodes"]["renamed"] = sg["nodes"].pop(name)
    elif kind == "type":
        node["type"] = pick(["tool", "script", "noop", "router", "end", "subgraph", "skill", "tol"])
    elif kind == "tool":
        assume("tool" in node)
        node["tool"] = pick([*CATALOG.tools, "fake.Ad", "Add"])
    elif kind == "input":
        assume(node.get("inputs"))
        node["inputs"][pick(node["inputs"])] = pick([1.0, "x", True, None, [1], {"$ref": pick(names)}, {"$ref": ""}])
    elif kind == "input name":
        assume(node.get("inputs"))
        node["inputs"]["other"] = node["inputs"].pop(pick(node["inputs"]))
    elif kind == "streaming":
        node["streaming"] = True
    elif kind == "exit":
        sg["exit"] = pick([{"success_values": []}, {"success_values": ["done", "more"]},
                           {"router_field": "total", "success_values": ["done"]}])  # fmt: skip
    elif kind == "on_error":
        sg["on_error"] = pick(["done", name, "lost"])
    elif kind == "routing":
        assume(sg.get("conditional_edges"))
        source = pick(sg["conditional_edges"])
        routes = sg["conditional_edges"][source]
        routes["mapping"] = dict(pick([
            {"true": pick(names), "false": pick(names)}, {"true": pick(names)}, {**routes["mapping"], "maybe": "done"},
        ]))  # fmt: skip
        routes["router_field"] = pick(["up", "up", "value", "down", None])
    else:
        top = data["conditional_edges"]["main"]["mapping"]
        top[pick(["done", "failed", "lost"])] = pick(["success", "abort", "main", "END", "x"])
    return kind


MUTATIONS = ["drop edge", "add edge", "bend edge", "drop node", "rename node", "type", "tool", "input", "input name",
             "streaming", "exit", "on_error", "routing", "top"]  # fmt: skip


@settings(max_examples=250, deadline=None)
@given(workflows(), st.data())
def test_a_mutation_is_caught_by_a_rule_or_does_no_harm(workflow, data):
    mutant = copy.deepcopy(dump_workflow(workflow))
    kind = mutate(mutant, data.draw)
    try:
        changed = parse_workflow(mutant, "mutant")
        found = validate(changed, CATALOG)
    except GapError as error:
        found = list(error.findings)
    assert {f.code for f in found} <= CODES
    caught = any(f.severity == "error" for f in found)
    event(f"{kind}: {'caught' if caught else 'harmless'}")
    if not caught:
        for seed in range(3):
            result, _ = run(changed, seed)
            harmless = result.status == "success" or (result.status == "failure" and result.exits[-1][1] != "failed")
            assert harmless, (kind, result.error)
