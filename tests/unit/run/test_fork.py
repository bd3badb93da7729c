"""Subgraphs side by side: what the rules admit, what they refuse, and how such a graph runs."""

from __future__ import annotations

import itertools

import pytest
from rich.console import Console

from gap_cli.analysis.exit_flow import side_by_side, top_links
from gap_cli.render.drawing import drawing
from gap_cli.render.mermaid import mermaid
from gap_cli.render.tree import tree
from gap_cli.testing import make_catalog
from gap_cli.validate.validator import validate
from gap_runtime.graph.dump import dump_workflow
from gap_runtime.graph.load import parse_workflow
from gap_runtime.testing import FakeCell, run_fake

MOVE = {"type": "tool", "tool": "fake.Move", "inputs": {"to": 0.1, "duration": 0.1}}
GRIP = {"type": "tool", "tool": "fake.Grip", "inputs": {"width": 0.0}}
LOOK, NOTHING, FAIL = "fake.Look", "fake.Nothing", "fake.Fail"


def graph(parts, edges, routes):
    """Subgraphs of one node or a few in a row; an exit goes where `routes` say, a failure to `abort` by default."""
    top = {n: {"type": "subgraph", "ref": n, "max_visits": 3} for n in parts}
    ends = {"end": {"type": "end", "status": "success"}, "other": {"type": "end", "status": "success"},
            "abort": {"type": "end", "status": "failure"}}  # fmt: skip
    used = {b for _, b in edges} | {t for m in routes.values() for t in m.values()} | {"abort"}
    routing = {n: {"router_field": "exit", "mapping": {"failed": "abort"} | routes.get(n, {})} for n in parts}
    data = {"version": 3, "nodes": top | {n: e for n, e in ends.items() if n in used}, "edges": edges,
            "conditional_edges": routing, "subgraphs": {n: part(n, nodes) for n, nodes in parts.items()}}  # fmt: skip
    return parse_workflow(data, "fork")


def part(name, nodes):
    steps = {f"{name}{i}": {"type": "tool", "tool": n} if isinstance(n, str) else n for i, n in enumerate(nodes)}
    chain = ["START", *steps, "done", "END"]
    return {"skill": "fake", "nodes": {**steps, "done": {"type": "noop"}}, "on_error": "failed",
            "edges": [list(e) for e in itertools.pairwise(chain)], "exit": {"success_values": ["done"]}}  # fmt: skip


def fork(a, b, join=(NOTHING,), routes=None):
    """START leads to `a` and `b`, and both to `z`."""
    edges = [["START", "a"], ["START", "b"], ["a", "z"], ["b", "z"], ["z", "end"]]
    return graph({"a": a, "b": b, "z": join}, edges, routes or {})


def codes(workflow):
    return [f.code for f in validate(workflow, make_catalog())]


def order(seen, kind="node_started"):
    return [e.path for e in seen if e.kind == kind]


def test_two_that_look_may_look_at_once_and_are_joined():
    w, seen = fork([LOOK, NOTHING], [LOOK], [MOVE]), []
    assert codes(w) == []
    assert run_fake(w, cell=FakeCell(), observers=[seen.append]).status == "success"
    assert order(seen)[:2] == ["a/a0", "b/b0"] and order(seen)[-2:] == ["z/z0", "z/done"]


@pytest.mark.parametrize(
    ("a", "b", "code"),
    [
        ([MOVE], [MOVE], "R1"), ([GRIP], [GRIP], "R1"), ([MOVE], [LOOK], "R2"),
        ([NOTHING, NOTHING, MOVE], [LOOK], "R2"),
    ],
)  # fmt: skip
def test_nothing_moves_beside_what_senses_or_holds_the_same(a, b, code):
    assert codes(fork(a, b)) == [code]


@pytest.mark.parametrize("beside", [NOTHING, GRIP])
def test_one_may_move_beside_one_that_computes_or_moves_something_else(beside):
    assert codes(fork([MOVE], [beside])) == []


def test_what_follows_one_branch_does_not_wait_for_the_others():
    parts = {"a": [NOTHING], "after": [NOTHING], "b": [NOTHING] * 6, "z": [NOTHING]}
    edges = [["START", "a"], ["START", "b"], ["a", "after"], ["after", "z"], ["b", "z"], ["z", "end"]]
    w, seen = graph(parts, edges, {}), []
    assert codes(w) == []
    run_fake(w, observers=[seen.append])
    started = order(seen)
    assert started.index("after/after0") < started.index("b/b5") < started.index("z/z0")


def test_a_plain_edge_is_for_success_and_forks_where_there_are_several():
    parts = {"a": [NOTHING], "b": [LOOK], "c": [LOOK], "z": [MOVE]}
    edges = [["START", "a"], ["a", "b"], ["a", "c"], ["b", "z"], ["c", "z"], ["z", "end"]]
    w, seen = graph(parts, edges, {}), []
    assert codes(w) == []
    assert run_fake(w, cell=FakeCell(), observers=[seen.append]).status == "success"
    assert order(seen)[2:4] == ["b/b0", "c/c0"]
    failing = graph({**parts, "a": [FAIL]}, edges, {})
    result = run_fake(failing, cell=FakeCell())
    assert (result.status, result.end, result.exits) == ("failure", "abort", [("a", "failed")])


def test_a_failure_in_one_branch_ends_the_run_at_once():
    result = run_fake(fork([FAIL], [NOTHING] * 5), cell=FakeCell())
    assert (result.status, result.end, result.failed_node) == ("failure", "abort", "a/a0")
    assert "z" not in result.visits


def test_what_a_failure_beside_it_stopped_has_no_exit():
    for lockstep in (True, False):
        seen = []
        result = run_fake(fork([FAIL], ["fake.Spin"]), observers=[seen.append], lockstep=lockstep)
        assert result.exits == [("a", "failed")] and result.failed_node == "a/a0"
        stopped = [e.path for e in seen if e.kind == "subgraph_exited" and e.data["stopped"]]
        assert stopped == ["b"]


def test_a_rescued_branch_joins_like_any_other():
    parts = {"a": [FAIL], "again": [NOTHING], "b": [NOTHING] * 4, "z": [NOTHING]}
    edges = [["START", "a"], ["START", "b"], ["a", "z"], ["again", "z"], ["b", "z"], ["z", "end"]]
    w, seen = graph(parts, edges, {"a": {"failed": "again"}}), []
    assert codes(w) == []
    result = run_fake(w, observers=[seen.append])
    assert result.status == "success" and order(seen, "subgraph_entered") == ["a", "b", "again", "z"]


def test_a_branch_may_try_again_while_the_other_waits_at_the_join():
    parts = {"a": [FAIL], "b": [NOTHING], "z": [NOTHING]}
    edges = [["START", "a"], ["START", "b"], ["a", "z"], ["b", "z"], ["z", "end"]]
    w = graph(parts, edges, {"a": {"failed": "a"}})
    assert codes(w) == []
    result = run_fake(w)
    assert result.visits["a"] == 3 and "z" not in result.visits


def test_going_back_to_before_the_fork_from_one_branch_is_refused():
    parts = {"f": [NOTHING], "a": [NOTHING], "b": [NOTHING], "z": [NOTHING]}
    edges = [["START", "f"], ["f", "a"], ["f", "b"], ["a", "z"], ["b", "z"], ["z", "end"]]
    assert "R3" in codes(graph(parts, edges, {"a": {"failed": "f"}}))
    assert codes(graph(parts, edges, {"z": {"failed": "f"}})) == []


def test_a_loop_beside_a_branch_has_one_way_in():
    parts = {"a": [NOTHING], "b": [NOTHING], "c": [NOTHING]}
    edges = [["START", "a"], ["START", "b"], ["a", "b"], ["b", "c"], ["c", "end"]]
    assert "R3" in codes(graph(parts, edges, {"b": {"failed": "a"}}))


def test_two_branches_lead_to_one_success_end():
    parts = {"a": [NOTHING], "b": [NOTHING]}
    assert codes(graph(parts, [["START", "a"], ["START", "b"], ["a", "end"], ["b", "other"]], {})) == ["R4"]
    assert codes(graph(parts, [["START", "a"], ["START", "b"], ["a", "end"], ["b", "end"]], {})) == []


def named(writes, reads, optional):
    """Findings where branches `a` and `b` give some names, and some subgraphs take some."""
    w = dump_workflow(fork([NOTHING], [NOTHING]))
    for name, outputs in writes.items():
        w["subgraphs"][name]["nodes"][f"{name}0"] = {"type": "tool", "tool": "fake.Add", "inputs": {"a": 1.0}}
        w["subgraphs"][name]["outputs"] = {n: {"$ref": f"{name}0.total"} for n in outputs}
    for name, inputs in reads.items():
        w["subgraphs"][name]["inputs"] = dict.fromkeys(inputs, "float")
    kind = "float?" if optional else "float"
    catalog = make_catalog(inputs=dict.fromkeys("xy", kind), outputs=dict.fromkeys("xy", "float"))
    return [f.code for f in validate(parse_workflow(w, "fork"), catalog) if f.code != "W11"]


def test_at_a_join_there_is_what_every_branch_brings():
    assert named({"a": "x", "b": "y"}, {"z": "xy"}, optional=False) == []
    assert named({"a": "x"}, {"z": "xy"}, optional=False) == ["S13"]


def test_two_branches_never_produce_one_name():
    assert named({"a": "x", "b": "x"}, {}, optional=True) == ["W13"]


def test_a_branch_does_not_read_what_the_one_beside_it_produces():
    assert named({"a": "x"}, {"b": "x"}, optional=False) == ["S13"]
    assert named({"a": "x"}, {"b": "x"}, optional=True) == ["W12"]


def test_a_subgraph_loop_by_plain_edges_needs_a_budget():
    w = dump_workflow(graph({"a": [NOTHING], "b": [NOTHING]}, [["START", "a"], ["a", "b"], ["b", "a"]], {}))
    for node in w["nodes"].values():
        node.pop("max_visits", None)
    assert "W14" in codes(parse_workflow(w, "loop"))


def test_a_drawing_says_what_runs_beside_what_and_where_a_success_leads():
    parts = {"a": [NOTHING], "b": [LOOK], "c": [LOOK], "z": [MOVE]}
    w = graph(parts, [["START", "a"], ["a", "b"], ["a", "c"], ["b", "z"], ["c", "z"], ["z", "end"]], {})
    assert side_by_side(w) == {"b": ["c"], "c": ["b"]}
    assert top_links(w)["a", "b"] == top_links(w)["a", "c"] == ["done"]
    console = Console(width=200)
    with console.capture() as capture:
        console.print(tree(w))
    assert "done -> b and c" in capture.get() and "fake, beside c" in capture.get()
    assert "n_a -->|done| n_b" in mermaid(w) and "START((start)) --> n_a" in mermaid(w)
    assert drawing(w).count(">done</text>") >= 4


def test_in_lockstep_a_failing_run_is_told_the_same_way_every_time():
    stories = set()
    for _ in range(8):
        seen = []
        run_fake(fork([FAIL], [NOTHING]), observers=[seen.append], lockstep=True)
        stories.add(tuple((e.kind, e.path) for e in seen))
    assert len(stories) == 1
