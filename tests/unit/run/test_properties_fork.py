"""Subgraphs side by side: well-formed forks validate and run the same under every schedule; mistakes are caught."""

from __future__ import annotations

import copy
import random
from pathlib import Path

from hypothesis import event, given, settings
from hypothesis import strategies as st

from gap_cli.analysis.catalog import Catalog
from gap_cli.validate.rules.table import rules
from gap_cli.validate.validator import validate
from gap_runtime.contracts.failures import ToolError
from gap_runtime.contracts.skill import Exits
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.errors import GapError
from gap_runtime.graph.compile import compile_workflow
from gap_runtime.graph.dump import dump_workflow
from gap_runtime.graph.load import parse_workflow
from gap_runtime.run.execute import RunSetup, run_graph
from gap_runtime.run.pool import Pool
from gap_runtime.testing import FakeCell, fake_skill, fake_tools
from tests.unit.run.test_properties import choose

CODES = {rule.code for rule in rules()}


@tool("test.Risk", deadline_s=5.0)
def risk(ctx: ToolContext, salt: int) -> float:
    """Fails in every other episode."""
    if random.Random(f"{ctx.seed} {salt}").random() < 0.5:
        raise ToolError("unlucky", f"salt {salt}")
    return float(salt)


TOOLS = fake_tools(choose, risk)
SPECS = {name: t.spec for name, t in TOOLS.items()}


class Maker:
    """Draws a topology of nested blocks: in a row, side by side, either-or, round again, and a rescue after a failure.

    A block is (first subgraphs, last subgraphs, names surely produced); what is last leads to whatever comes next.
    """

    def __init__(self, draw):
        self.draw, self.parts, self.routes, self.edges = draw, {}, {}, []
        self.loops = 0

    def leaf(self, names, kind, writes=None):
        name = f"s{len(self.parts)}"
        reads = self.draw(st.lists(st.sampled_from(sorted(names)), max_size=2, unique=True)) if names else []
        writes = writes or f"v{len(self.parts)}"
        self.parts[name] = part(len(self.parts), reads, writes, kind, self.draw(st.integers(1, 3)))
        self.routes[name] = {"failed": "abort"}
        return name, names | {writes}

    def lead(self, lasts, firsts, value="up"):
        """From every one of these to every one of those: by the exit where it is one, else by plain edges."""
        for last in lasts:
            if len(firsts) == 1 and self.draw(st.booleans()):
                self.routes[last][value] = firsts[0]
            elif value == "up" and "down" not in self.parts[last]["exit"]["success_values"]:
                self.edges += [(last, first) for first in firsts]
            else:
                self.routes[last][value] = firsts[0]
                assert len(firsts) == 1

    def one(self, firsts, names):
        """One subgraph before a block that begins with several, where only one can be led to."""
        if len(firsts) == 1:
            return firsts
        name, _ = self.leaf(set(), "plain")
        self.lead([name], firsts)
        return [name]

    def block(self, depth, names, moves):
        shapes = ["leaf", "leaf", "row", "both", "both", "either", "again", "rescue"] if depth else ["leaf"]
        shape = self.draw(st.sampled_from(shapes))
        event(shape)
        return getattr(self, f"{shape}_block" if shape == "leaf" else shape)(depth - 1, names, moves)

    def leaf_block(self, depth, names, moves):
        kind = self.draw(st.sampled_from(["plain", "plain", "risky", "moving" if moves else "plain"]))
        name, names = self.leaf(names, kind)
        return [name], [name], names

    def row(self, depth, names, moves):
        firsts, lasts, names = self.block(depth, names, moves)
        seconds, ends, names = self.block(depth, names, moves)
        self.lead(lasts, seconds)
        return firsts, ends, names

    def both(self, depth, names, moves):
        a, a_ends, a_names = self.block(depth, names, moves)
        b, b_ends, b_names = self.block(depth, names, False)
        return a + b, a_ends + b_ends, a_names | b_names

    def either(self, depth, names, moves):
        fork, names = self.leaf(names, "coin")
        a, a_ends, a_names = self.block(depth, names, moves)
        b, b_ends, b_names = self.block(depth, names, moves)
        self.lead([fork], self.one(a, names), "up")
        self.lead([fork], self.one(b, names), "down")
        join, more = self.leaf(a_names & b_names, "plain")
        self.lead(a_ends + b_ends, [join])
        return [fork], [join], more

    def again(self, depth, names, moves):
        head, names = self.leaf(names, "plain")
        self.loops += 1
        firsts, lasts, names = self.block(depth, names, moves)
        self.loops -= 1
        self.lead([head], firsts)
        coin, names = self.leaf(names, "coin")
        out, names = self.leaf(names, "plain")
        self.lead(lasts, [coin])
        self.routes[coin] |= {"up": out, "down": head}
        return [head], [out], names

    def rescue(self, depth, names, moves):
        first, after = self.leaf(names, "risky")
        shared = None if self.loops else (after - names).pop()  # the next pass must not find it made by the other
        second, _ = self.leaf(names, "plain", shared)
        join, after = self.leaf(after if shared else names, "plain")
        self.routes[first]["failed"] = second
        self.lead([first, second], [join])
        return [first], [join], after

    def workflow(self):
        firsts, lasts, _ = self.block(3, set(), True)
        self.lead(lasts, ["done"])
        top = {n: {"type": "subgraph", "ref": n, "max_visits": 20} for n in self.parts}
        ends = {"done": {"type": "end", "status": "success"}, "abort": {"type": "end", "status": "failure"}}
        edges = self.draw(st.permutations([*(("START", n) for n in firsts), *self.edges]))
        routing = {n: {"router_field": "exit", "mapping": m} for n, m in self.routes.items()}
        data = {"version": 3, "nodes": top | ends, "edges": edges, "conditional_edges": routing}
        return parse_workflow({**data, "subgraphs": self.parts}, "fork")


def part(i, reads, writes, kind, length):
    """A segment that reads some names, takes a few steps, and gives a name."""
    chain = {f"r{j}": call("fake.Add", a={"$ref": f"in.{n}"}, b=1.0) for j, n in enumerate(reads)}
    chain |= {f"c{j}": call("fake.Add", a=1.0, b=float(i)) for j in range(length)}
    gives = f"c{length - 1}.total"
    if kind in ("coin", "risky", "moving"):
        given = {"coin": call("test.Choose", salt=i), "risky": call("test.Risk", salt=i)}
        chain["act"] = given.get(kind) or call("fake.Move", to=0.1 * i, duration=0.1)
    names = [*chain]
    edges = [*zip(["START", *names], names, strict=False), ("up", "END")]
    routing = {}
    if kind == "coin":
        edges.append(("down", "END"))
        routing = {"act": {"router_field": "up", "mapping": {"true": "up", "false": "down"}}}
    else:
        edges.append((names[-1], "up"))
    exits = ["up", "down"] if kind == "coin" else ["up"]
    nodes = chain | {n: {"type": "noop"} for n in exits}
    return {
        "skill": f"s{i}", "inputs": dict.fromkeys(reads, "float"), "outputs": {writes: {"$ref": gives}},
        "nodes": nodes, "edges": [list(e) for e in edges], "conditional_edges": routing,
        "exit": {"success_values": exits}, "on_error": "failed",
    }  # fmt: skip


def call(name, **inputs):
    return {"type": "tool", "tool": name, "inputs": inputs}


@st.composite
def workflows(draw):
    return Maker(draw).workflow()


def contracts(workflow):
    exits = Exits(success={"up": "heads", "down": "tails"}, failure="failed")
    return {
        d.skill: fake_skill(["test.Choose", "test.Risk"], exits=exits, inputs=d.inputs,
                            outputs=dict.fromkeys(d.outputs, "float"))
        for d in workflow.subgraphs.values()
    }  # fmt: skip


def judge(workflow):
    return validate(workflow, Catalog(SPECS, contracts(workflow)))


def outcome(graph, seed, schedule):
    """Everything that may not depend on timing."""
    seen, world = [], FakeCell()
    rng = random.Random(schedule)
    setup = RunSetup(cell=world, seed=seed, lockstep=True, shuffle=rng, pool=Pool(rng.randint(1, 4)))
    result = run_graph(graph, setup, [seen.append])
    head = (result.status, result.end, result.exits, result.failed_node, result.error, world.time, result.visits)
    story = [(e.kind, e.path, e.cell_time, repr(e.data.get("output"))) for e in seen]
    return head, story


@settings(max_examples=80, deadline=None)
@given(workflows(), st.integers(0, 3))
def test_forks_and_joins_validate_and_run_the_same_under_every_schedule(workflow, seed):
    assert judge(workflow) == []
    graph = compile_workflow(workflow, Path(), TOOLS, contracts(workflow), {})
    (status, _, _, failed, error, *_), _ = first = outcome(graph, seed, 0)
    event(status)
    assert status == "success" or (status == "failure" and failed.endswith("/act")), error
    assert all(outcome(graph, seed, schedule) == first for schedule in range(1, 6))


def mutate(data, draw):
    """One random mistake of the topology."""
    pick = lambda values: draw(st.sampled_from(sorted(values, key=str)))  # noqa: E731
    kind, nodes = (
        pick(["drop edge", "add edge", "bend edge", "bend exit", "drop exit", "writes", "reads"]),
        data["nodes"],
    )
    name = pick(data["subgraphs"])
    if kind in ("drop edge", "bend edge"):
        i = draw(st.integers(0, len(data["edges"]) - 1))
        if kind == "drop edge":
            del data["edges"][i]
        else:
            data["edges"][i][1] = pick(nodes)
    elif kind == "add edge":
        data["edges"].append([pick(["START", *nodes]), pick(nodes)])
    elif kind in ("bend exit", "drop exit"):
        mapping = data["conditional_edges"][name]["mapping"]
        value = pick(mapping)
        if kind == "drop exit":
            del mapping[value]
        else:
            mapping[value] = pick(nodes)
    elif kind == "writes":
        outputs = data["subgraphs"][name]["outputs"]
        other = pick({w for d in data["subgraphs"].values() for w in d["outputs"]})
        data["subgraphs"][name]["outputs"] = {other: next(iter(outputs.values()))}
    else:
        other = pick({w for d in data["subgraphs"].values() for w in d["outputs"]})
        data["subgraphs"][name].setdefault("inputs", {})[other] = "float"
        data["subgraphs"][name]["nodes"]["c0"]["inputs"]["a"] = {"$ref": f"in.{other}"}
    return kind


@settings(max_examples=250, deadline=None)
@given(workflows(), st.data())
def test_a_mistake_in_a_topology_is_caught_or_does_no_harm(workflow, data):
    mutant = copy.deepcopy(dump_workflow(workflow))
    kind = mutate(mutant, data.draw)
    try:
        changed = parse_workflow(mutant, "mutant")
        found = judge(changed)
    except GapError as error:
        found = list(error.findings)
    assert {f.code for f in found} <= CODES
    caught = any(f.severity == "error" for f in found)
    event(f"{kind}: {'caught' if caught else 'harmless'}")
    if not caught:
        graph = compile_workflow(changed, Path(), TOOLS, contracts(changed), {})
        for seed in range(3):
            first = outcome(graph, seed, 0)
            status, _, _, failed, error, *_ = first[0]
            assert status in ("success", "failure") or "more than 20 times" in error, (kind, error)
            assert not failed or failed.endswith("/act") or "more than 20 times" in error, (kind, error)
            assert outcome(graph, seed, 1) == first
