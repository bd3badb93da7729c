"""The same graph gives the same result, whatever order and on whatever threads its branches run (C10)."""

from __future__ import annotations

import random
import time

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gap_cli.testing import make_catalog
from gap_cli.validate.validator import validate
from gap_runtime.contracts.failures import ToolError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import Observation
from gap_runtime.graph.scripts import read_signature
from gap_runtime.run.execute import RunSetup, run_graph
from gap_runtime.run.pool import Pool
from gap_runtime.testing import FakeCell, Sum, compile_fake, fake_workflow

GRAPHS, SCHEDULES = 40, 25  # 1000 runs
JITTER = random.Random()  # on purpose not seeded: real timing differs, the result must not


def jitter():
    time.sleep(JITTER.choice((0, 0, 0.0001, 0.0003)))


@tool("test.Mix")
def mix(values: list[float], salt: int, fail: bool) -> Sum:
    """A number that depends on everything read so far."""
    jitter()
    total = (sum(values) * 1.7 + salt) % 101
    if fail:
        raise ToolError("unlucky", f"salt {salt}")
    return Sum(total, int(total) % 2 == 0)


@tool("test.Tick")
def tick(ctx: ToolContext, key: str, limit: int) -> Sum:
    """Counts calls by key; positive from the `limit`-th on."""
    ctx.state[key] = ctx.state.get(key, 0) + 1
    return Sum(ctx.state[key], ctx.state[key] >= limit)


@tool("test.See", effect="sense")
def see(ctx: ToolContext) -> Observation:
    """Looks, and takes a moment."""
    jitter()
    return ctx.cell.observe()


SCRIPTS = {
    "send": "def run(ctx, n: int) -> list[dict]:\n"
    "    return [{'to': '{each}', 'inputs': {'salt': i}} for i in range(n)]\n",
    "collect": "def run(ctx, sums: list[dict]) -> float:\n"
    "    return sum(s.total * (i + 1) for i, s in enumerate(sums))\n",
}


class Graph:
    """Composes a random graph from chains, parallel blocks, choices, loops and fan-outs."""

    def __init__(self, seed):
        self.rng = random.Random(seed)
        self.nodes, self.edges, self.routing, self.scripts = {}, [], {}, {}
        exits, _ = self.block(["START"], [], depth=3, alone=True)
        self.edges += [(e, "done") for e in exits]

    def add(self, after, kind, inputs=None):
        name = f"n{self.rng.randrange(1000):03d}_{len(self.nodes)}"  # sorts unlike it was made
        self.nodes[name] = (
            {"type": "noop"} if kind == "noop" else {"type": "tool", "tool": kind, "inputs": inputs or {}}
        )
        self.edges += [(a, name) for a in after]
        return name

    def leaf(self, after, seen, alone):
        roll = self.rng.random()
        if alone and roll < 0.2:
            return self.add(after, "fake.Move", {"to": self.rng.random(), "duration": 0.1})
        if roll < 0.3:
            return self.add(after, "test.See")
        values = [{"$ref": f"{n}.total"} for n in self.rng.sample(seen, min(len(seen), 3))]
        return self.add(
            after, "test.Mix", {"values": values, "salt": self.rng.randrange(100), "fail": self.rng.random() < 0.02}
        )

    def block(self, after, seen, depth, alone):
        """Adds a block behind `after`; returns its last nodes, and those with a total that have certainly run."""
        kinds = ["chain", "parallel", "choice", "fan"] + ["loop"] * alone
        kind = self.rng.choice(kinds) if depth else "leaf"
        if kind == "leaf":
            name = self.leaf(after, seen, alone)
            return [name], seen + ([name] if self.nodes[name]["tool"] == "test.Mix" else [])
        return getattr(self, kind)(after, seen, depth - 1, alone)

    def chain(self, after, seen, depth, alone):
        for _ in range(self.rng.randint(2, 3)):
            after, seen = self.block(after, seen, depth, alone)
        return after, seen

    def parallel(self, after, seen, depth, alone):
        blocks = [self.block(after, seen, depth, False) for _ in range(self.rng.randint(2, 4))]
        return [e for exits, _ in blocks for e in exits], sorted({n for _, s in blocks for n in s})

    def choice(self, after, seen, depth, alone):
        branch = self.add(
            after, "test.Mix", {"values": [{"$ref": f"{n}.total"} for n in seen], "salt": 3, "fail": False}
        )
        doors = [self.add([], "noop") for _ in range(2)]
        self.routing[branch] = {"router_field": "positive", "mapping": dict(zip(("true", "false"), doors, strict=True))}
        exits = [e for door in doors for e in self.block([door], [*seen, branch], depth, alone)[0]]
        return exits, [*seen, branch]

    def loop(self, after, seen, depth, alone):
        first = self.add(after, "noop")
        exits, seen = self.block([first], seen, depth, alone)
        ticks = self.add(exits, "test.Tick", {"key": first, "limit": self.rng.randint(1, 3)})
        out = self.add([], "noop")
        self.routing[ticks] = {"router_field": "positive", "mapping": {"true": out, "false": first}}
        return [out], seen

    def fan(self, after, seen, depth, alone):
        each = self.add([], "test.Mix", {"values": [], "fail": False})
        router, collect = f"r_{each}", f"c_{each}"
        self.scripts |= {
            f"scripts/{router}.py": SCRIPTS["send"].replace("{each}", each),
            f"scripts/{collect}.py": SCRIPTS["collect"],
        }
        self.nodes[router] = {
            "type": "router",
            "script": f"scripts/{router}.py",
            "inputs": {"n": self.rng.randint(0, 4)},
        }
        self.nodes[collect] = {
            "type": "script",
            "script": f"scripts/{collect}.py",
            "inputs": {"sums": {"$ref": router}},
        }
        self.edges += [*((a, router) for a in after), (each, collect)]
        self.routing[router] = {"mapping": {each: each}}
        return [collect], seen

    def workflow(self):
        return fake_workflow(self.nodes, self.edges, conditional_edges=self.routing)


def outcome(graph, schedule):
    """Everything that may not depend on timing."""
    world, seen = FakeCell(), []
    rng = random.Random(schedule)
    setup = RunSetup(cell=world, lockstep=True, shuffle=rng, pool=Pool(rng.randint(1, 6)))
    result = run_graph(graph, setup, [seen.append])
    head = (
        result.status,
        result.end,
        result.exits,
        result.failed_node,
        result.error,
        world.time,
        world.arms[0].commands,
    )
    if result.failed_node:  # siblings behind the failed one may or may not have finished
        return head
    return head, [(e.kind, e.path, e.cell_time, repr(e.data.get("output")), e.data.get("attempt")) for e in seen]


@given(st.integers(0, 2**32))
@settings(max_examples=GRAPHS, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
def test_random_graphs_validate_and_give_one_result_under_a_thousand_schedules(tmp_path_factory, seed):
    made = Graph(seed)
    workflow = made.workflow()
    scripts = {path: read_signature(text, path) for path, text in made.scripts.items()}
    catalog = make_catalog(mix, tick, see, scripts=scripts)
    findings = [f for f in validate(workflow, catalog) if f.severity == "error"]
    assert findings == [], findings[:3]
    folder = tmp_path_factory.mktemp("graph")
    canonical = {}
    for path, text in made.scripts.items():
        canonical[path] = folder / path.rpartition("/")[2]
        canonical[path].write_text(text)
    graph = compile_fake(workflow, mix, tick, see, canonical=canonical)
    first = outcome(graph, 0)
    for schedule in range(1, SCHEDULES):
        assert outcome(graph, schedule) == first


def test_the_schedules_are_different(monkeypatch):
    """Else the test above would prove nothing."""
    order = []

    @tool("test.Note")
    def note(n: int) -> None:
        """Notes when it began."""
        order.append(n)

    nodes = {f"n{i}": {"type": "tool", "tool": "test.Note", "inputs": {"n": i}} for i in range(6)}
    edges = [("START", n) for n in nodes] + [(n, "done") for n in nodes]
    graph = compile_fake(fake_workflow(nodes, edges), note)
    seen = set()
    for schedule in range(10):
        order.clear()
        run_graph(graph, RunSetup(shuffle=random.Random(schedule), pool=Pool(1)))
        seen.add(tuple(order))
    assert len(seen) > 5


@pytest.mark.parametrize("lockstep", [True, False])
def test_in_lockstep_the_first_failure_by_name_is_reported_however_late(lockstep):
    @tool("test.LateFail")
    def late(ctx: ToolContext, wait: float) -> None:
        """Fails after a while, unless told to stop."""
        end = time.monotonic() + wait
        while time.monotonic() < end:
            ctx.raise_if_cancelled()
            time.sleep(0.001)
        raise ToolError("late", f"after {wait}")

    nodes = {n: {"type": "tool", "tool": "test.LateFail", "inputs": {"wait": w}} for n, w in (("a", 0.1), ("b", 0.0))}
    graph = compile_fake(fake_workflow(nodes, [("START", "a"), ("START", "b"), ("a", "done"), ("b", "done")]), late)
    result = run_graph(graph, RunSetup(lockstep=lockstep))
    assert result.failed_node == ("main/a" if lockstep else "main/b")
