"""What a graph means: order, joins, branches, loops, exits, ends."""

from __future__ import annotations

import textwrap

import pytest

from gap_runtime.contracts.tool import ToolContext
from gap_runtime.contracts.tool import tool as tool_
from gap_runtime.errors import ExecutionError, SimulationDivergedError, ToolError
from gap_runtime.graph.model import Workflow
from gap_runtime.run.execute import RunSetup, run_graph
from gap_runtime.testing import FakeCell, compile_fake, fake_workflow, run_fake


def tool(name, **inputs):
    return {"type": "tool", "tool": f"fake.{name}", "inputs": inputs}


def ref(text):
    return {"$ref": text}


def trace(workflow, *more, **setup):
    """Run; the result, and the paths of nodes in the order they finished."""
    seen = []
    result = run_fake(workflow, *more, observers=[seen.append], **setup)
    return result, [e.path.partition("/")[2] for e in seen if e.kind == "node_finished"]


@pytest.fixture
def scripted(tmp_path):
    """Compile a workflow with trusted scripts, given as source by path."""

    def make(workflow, **sources):
        canonical = {}
        for name, source in sources.items():
            file = tmp_path / f"{name}.py"
            file.write_text(textwrap.dedent(source))
            canonical[f"scripts/{name}.py"] = file
        return compile_fake(workflow, canonical=canonical)

    return make


def script(name, type_="script", **inputs):
    return {"type": type_, "script": f"scripts/{name}.py", "inputs": inputs}


def test_a_chain_runs_in_order_and_passes_values():
    w = fake_workflow(
        {"a": tool("Add", a=1, b=2), "b": tool("Add", a=ref("a.total"), b=10)},
        [("START", "a"), ("a", "b"), ("b", "done")],
        outputs={"sum": ref("b.total")},
    )
    seen = []
    result = run_fake(w, observers=[seen.append])
    assert (result.status, result.end, result.exits) == ("success", "success", [("main", "done")])
    assert seen[-2].data["outputs"] == {"sum": 13.0}


def test_a_join_runs_once_after_every_branch_however_long_they_are():
    edges = [("START", "a"), ("a", "b"), ("b", "c"), ("a", "join"), ("c", "join"), ("join", "done")]
    result, order = trace(fake_workflow({n: "fake.Nothing" for n in ("a", "b", "c", "join")}, edges))
    assert order == ["a", "b", "c", "join", "done"]
    assert result.status == "success"


def test_a_branch_not_taken_is_not_waited_for():
    w = fake_workflow(
        {"a": tool("Add", a=1), "yes": "fake.Nothing", "no": "fake.Nothing", "join": "fake.Nothing"},
        [("START", "a"), ("yes", "join"), ("no", "join"), ("join", "done")],
        conditional_edges={"a": {"router_field": "positive", "mapping": {"true": "yes", "false": "no"}}},
    )
    assert trace(w)[1] == ["a", "yes", "join", "done"]


def test_commits_are_sorted_whatever_the_order_of_declaration():
    nodes = {n: "fake.Nothing" for n in ["zebra", "apple", "mango"]}
    edges = [("START", n) for n in nodes] + [(n, "done") for n in nodes]
    assert trace(fake_workflow(nodes, edges))[1] == ["apple", "mango", "zebra", "done"]
    two = dict.fromkeys("abyz", "fake.Nothing")
    edges = [("START", "a"), ("START", "b"), ("a", "z"), ("b", "y"), ("y", "done"), ("z", "done")]
    assert trace(fake_workflow(two, edges))[1] == ["a", "b", "y", "z", "done"]


def test_a_value_that_leads_nowhere_is_a_failure_that_lists_where_it_could_lead():
    w = fake_workflow(
        {"a": tool("Add", a=1), "b": "fake.Nothing"},
        [("START", "a"), ("b", "done")],
        conditional_edges={"a": {"router_field": "total", "mapping": {"2.0": "b"}}},
    )
    result = run_fake(w)
    assert result.status == "failure" and result.failed_node == "main/a"
    assert "'1.0'" in result.error and "2.0" in result.error


def test_an_error_becomes_on_error_then_the_recovery_of_the_end_it_leads_to():
    world = FakeCell()
    recovery = [{"tool": "fake.Fail"}, {"tool": "fake.Grip", "inputs": {"width": 0.05}}]
    w = fake_workflow(
        {"a": "fake.Fail", "b": "fake.Nothing"}, [("START", "a"), ("a", "b"), ("b", "done")], recovery=recovery
    )
    result = run_fake(w, cell=world)
    assert (result.status, result.end, result.failed_node) == ("failure", "abort", "main/a")
    assert result.exits == [("main", "failed")]
    assert [type(e) for _, e in result.failures] == [ToolError]
    assert [p for p, _ in result.recovery_failures] == ["abort/00.fake.Fail"]
    assert world.arms[0].commands == ["set_width"]
    with pytest.raises(ExecutionError, match="main/a") as caught:
        result.raise_for_status()
    assert caught.value.causes == result.causes


def test_an_output_nobody_ran_is_not_produced_and_reading_it_says_so():
    w = fake_workflow(
        {"a": tool("Add", a=1), "b": tool("Echo", value=1), "c": tool("Echo", value=ref("b"))},
        [("START", "a"), ("b", "done"), ("c", "done")],
        conditional_edges={"a": {"router_field": "positive", "mapping": {"true": "c", "false": "b"}}},
    )
    result = run_fake(w)
    assert "'b' has not run on this path" in result.error


def test_the_exit_may_be_a_field_of_the_last_output(scripted):
    w = fake_workflow(
        {"s": script("say")}, [("START", "s"), ("s", "END")],
        exit={"router_field": "exit", "success_values": ["done", "empty"]},
    )  # fmt: skip
    source = """
    from typing import NamedTuple
    class Said(NamedTuple):
        exit: str
    def run(ctx) -> Said:
        return Said({word!r})
    """
    assert run_graph(scripted(w, say=source.format(word="done")), RunSetup()).exits == [("main", "done")]
    result = run_graph(scripted(w, say=source.format(word="other")), RunSetup())
    assert result.status == "failure" and "'other'" not in result.exits and "done, empty" in str(result.causes[0])


def test_two_exits_at_once_are_refused():
    w = fake_workflow(
        {"a": "fake.Nothing", "b": "fake.Nothing", "also": {"type": "noop"}},
        [("START", "a"), ("START", "b"), ("a", "done"), ("b", "also"), ("also", "END")],
        exit={"success_values": ["done", "also"]},
    )
    assert "several exits: also, done" in run_fake(w).error


def test_a_router_names_where_to_go(scripted):
    w = fake_workflow(
        {"r": script("route", "router", n=3), "big": "fake.Nothing", "small": "fake.Nothing"},
        [("START", "r"), ("big", "done"), ("small", "done")],
        conditional_edges={"r": {"mapping": {"big": "big", "few": "small"}}},
    )
    graph = scripted(w, route="def run(ctx, n: int) -> str:\n    return 'big' if n > 2 else 'few'\n")
    seen = []
    run_graph(graph, RunSetup(), [seen.append])
    assert [e.path for e in seen if e.kind == "node_finished"] == ["main/r", "main/big", "main/done"]


FAN_OUT = (
    "def run(ctx, items: list[float]) -> list[dict]:\n    return [{'to': 'each', 'inputs': {'a': x}} for x in items]\n"
)
COLLECT = "def run(ctx, sums: list[dict]) -> float:\n    return sum(s.total for s in sums)\n"


@pytest.mark.parametrize("items, total", [([1, 2, 3], 36.0), ([5], 15.0), ([], 0.0)])
def test_a_router_sends_copies_and_collects_their_outputs_in_order(scripted, items, total):
    w = fake_workflow(
        {
            "r": script("send", "router", items=items),
            "each": tool("Add", b=10),
            "collect": script("collect", sums=ref("r")),
        },
        [("START", "r"), ("each", "collect"), ("collect", "done")],
        conditional_edges={"r": {"mapping": {"each": "each"}}},
        outputs={"total": ref("collect"), "all": ref("r")},
    )
    seen = []
    result = run_graph(scripted(w, send=FAN_OUT, collect=COLLECT), RunSetup(), [seen.append])
    assert result.status == "success", result.error
    assert seen[-2].data["outputs"]["total"] == total
    assert [s.total for s in seen[-2].data["outputs"]["all"]] == [x + 10 for x in items]
    assert [e.data["send"] for e in seen if e.kind == "node_finished" and e.path == "main/each"] == list(
        range(len(items))
    )


@pytest.mark.parametrize(
    "send",
    [
        "{'to': 'nobody'}",
        "{'to': 'each', 'inputs': {'q': 1}}",
        "{'inputs': {}}",
        "3",
        "{'to': 'each', 'inputs': {'a': 'x'}}",
    ],
)
def test_a_bad_send_fails_the_graph_with_a_reason(scripted, send):
    w = fake_workflow(
        {"r": script("send", "router"), "each": tool("Add")}, [("START", "r"), ("each", "done")],
        conditional_edges={"r": {"mapping": {"each": "each"}}},
    )  # fmt: skip
    result = run_graph(scripted(w, send=f"def run(ctx) -> list[dict]:\n    return [{send}]\n"), RunSetup())
    assert result.status == "failure" and result.error


def test_a_loop_inside_a_subgraph_runs_until_it_is_told_to_stop():
    w = fake_workflow(
        {"n": "fake.Count", "more": tool("Add", a=ref("n"), b=-3)},
        [("START", "n"), ("n", "more")],
        conditional_edges={"more": {"router_field": "positive", "mapping": {"true": "done", "false": "n"}}},
    )
    assert trace(w)[1].count("n") == 4


def test_a_loop_without_an_end_is_cut_by_its_visit_budget():
    w = fake_workflow(
        {"n": {**tool("Count"), "max_visits": 5}, "m": "fake.Nothing"}, [("START", "n"), ("n", "m"), ("m", "n")]
    )
    result = run_fake(w)
    assert result.status == "error" and "more than 5 times" in result.error and result.end == "abort"


def two_subgraphs(first, second, edges, mappings, **ends):
    base = fake_workflow({"a": "fake.Nothing"}, [("START", "a"), ("a", "done")]).model_dump()
    sub = base["subgraphs"]["main_sg"]
    nodes = {
        "first": {"type": "subgraph", "ref": "first", **first.pop("node", {})},
        "second": {"type": "subgraph", "ref": "second"},
        **{n: v for n, v in base["nodes"].items() if n != "main"},
    }
    return Workflow.load(
        {
            "nodes": nodes,
            "edges": edges,
            "conditional_edges": {k: {"router_field": "exit", "mapping": m} for k, m in mappings.items()},
            "subgraphs": {"first": {**sub, **first}, "second": {**sub, **second}},
        },
        "two",
    )


SERIAL = {"first": {"done": "second", "failed": "abort"}, "second": {"done": "success", "failed": "abort"}}


def consumer():
    node = {**tool("Echo", value=ref("in.total"))}
    return {"inputs": {"total": "float"}, "nodes": {"a": node, "done": {"type": "noop"}}}


def producer(name="total"):
    return {"nodes": {"a": tool("Add", a=2), "done": {"type": "noop"}}, "outputs": {name: ref("a.total")}}


def test_outputs_flow_by_name_from_subgraph_to_subgraph():
    seen = []
    result = run_fake(two_subgraphs(producer(), consumer(), [("START", "first")], SERIAL), observers=[seen.append])
    assert result.exits == [("first", "done"), ("second", "done")]
    assert next(e for e in seen if e.kind == "node_finished" and e.path == "second/a").data["output"] == 2.0


def test_a_missing_producer_is_named():
    result = run_fake(two_subgraphs(producer("other"), consumer(), [("START", "first")], SERIAL))
    assert result.failed_node == "second/a" and "nothing upstream has produced 'total'" in result.error


def test_two_producers_of_one_name_are_an_error_not_a_race():
    result = run_fake(two_subgraphs(producer(), producer(), [("START", "first")], SERIAL))
    assert result.status == "error" and "both produce 'total'" in result.error


def test_a_subgraph_loop_counts_visits_and_ends_with_its_budget():
    mappings = {"first": {"done": "second", "failed": "abort"}, "second": {"done": "first", "failed": "abort"}}
    w = two_subgraphs({**producer(), "node": {"max_visits": 3}}, consumer(), [("START", "first")], mappings)
    result = run_fake(w)
    assert result.status == "error" and result.visits["first"] == 3 and "more than 3 times" in result.error


def test_a_second_pass_does_not_read_what_only_the_first_one_produced():
    nodes = {"n": tool("Count"), "second": tool("Add", a=ref("n"), b=-1.5), "made": tool("Echo", value=1.0)}
    first = {
        "nodes": {**nodes, "done": {"type": "noop"}},
        "edges": [("START", "n"), ("n", "second"), ("made", "done"), ("done", "END")],
        "conditional_edges": {"second": {"router_field": "positive", "mapping": {"true": "done", "false": "made"}}},
        "outputs": {"total": ref("made")},
    }
    mappings = {"first": {"done": "second", "failed": "abort"}, "second": {"done": "first", "failed": "abort"}}
    result = run_fake(two_subgraphs(first, consumer(), [("START", "first")], mappings))
    assert result.visits == {"first": 2, "second": 2}
    assert result.failed_node == "second/a" and "nothing upstream has produced 'total'" in result.error


def test_subgraphs_side_by_side_are_joined_before_the_end():
    both = {"first": {"done": "success", "failed": "abort"}, "second": {"done": "success", "failed": "abort"}}
    chain = {"nodes": {n: tool("Nothing") for n in "abc"} | {"done": {"type": "noop"}},
             "edges": [("START", "a"), ("a", "b"), ("b", "c"), ("c", "done"), ("done", "END")]}  # fmt: skip
    w = two_subgraphs({}, chain, [("START", "first"), ("START", "second")], both)
    result = run_fake(w)
    assert result.status == "success" and sorted(result.exits) == [("first", "done"), ("second", "done")]


def test_a_failing_subgraph_stops_the_one_beside_it():
    both = {"first": {"done": "success", "failed": "abort"}, "second": {"done": "success", "failed": "abort"}}
    w = two_subgraphs(
        {"nodes": {"a": tool("Fail"), "done": {"type": "noop"}}},
        {"nodes": {"a": tool("Spin", seconds=60), "done": {"type": "noop"}}},
        [("START", "first"), ("START", "second")], both,
    )  # fmt: skip
    result = run_fake(w)
    assert result.status == "failure" and result.failed_node == "first/a"
    assert len(result.failures) == 1


def test_a_failure_made_good_by_a_fallback_is_a_success_that_remembers():
    mappings = {"first": {"done": "success", "failed": "second"}, "second": {"done": "success", "failed": "abort"}}
    w = two_subgraphs({"nodes": {"a": tool("Fail"), "done": {"type": "noop"}}}, {}, [("START", "first")], mappings)
    result = run_fake(w)
    assert (result.status, result.error, result.failed_node) == ("success", "", "")
    assert [p for p, _ in result.failures] == ["first/a"]


def test_an_exit_that_leads_nowhere_is_an_error_and_still_recovers():
    world = FakeCell()
    mappings = {"first": {"failed": "abort"}, "second": {"done": "success", "failed": "abort"}}
    w = two_subgraphs({}, {}, [("START", "first")], mappings)
    w = Workflow.load({**w.model_dump(), "nodes": {**w.model_dump()["nodes"], "abort": {
        "type": "end", "status": "failure", "recovery": [{"tool": "fake.Grip"}]}}}, "w")  # fmt: skip
    result = run_fake(w, cell=world)
    assert result.status == "error" and "leads nowhere" in result.error
    assert world.arms[0].commands == ["set_width"]


def test_parameters_are_read_from_the_skill_or_its_override(scripted):
    from gap_runtime.contracts.skill import Parameter

    node = {"a": tool("Add", a=ref("param.offset"))}
    for override, expected in (({}, 0.1), ({"offset": 0.2}, 0.2)):
        w = fake_workflow(node, [("START", "a"), ("a", "done")], parameters=override, outputs={"o": ref("a.total")})
        graph = compile_fake(w, parameters={"offset": Parameter(type="float", default=0.1)})
        seen = []
        run_graph(graph, RunSetup(), [seen.append])
        assert seen[-2].data["outputs"]["o"] == expected


def test_checkpoints_are_enforced_where_the_workflow_asks():
    w = fake_workflow({"a": "fake.Nothing"}, [("START", "a"), ("a", "done")])
    asking = w.model_copy(update={"meta": {"validate_checkpoints": "true"}})
    held = run_fake(asking, checkpoints=lambda node, ref, exit_: [])
    broken = run_fake(asking, checkpoints=lambda node, ref, exit_: [f"{node}:{ref}:{exit_}"])
    assert held.status == "success"
    assert broken.status == "failure" and "main:main_sg:done" in broken.error and broken.failed_node == "main"
    assert run_fake(w, checkpoints=lambda *a: ["never asked"]).status == "success"
    with pytest.raises(ExecutionError, match="nothing here can evaluate them"):
        run_fake(asking)


def test_a_run_out_of_world_time_ends_at_the_next_step():
    w = fake_workflow(
        {"a": tool("Move", duration=2.0), "b": tool("Move", duration=2.0)}, [("START", "a"), ("a", "b"), ("b", "done")]
    )
    world = FakeCell()
    result = run_fake(w, cell=world, cell_budget_s=1.0)
    assert result.status == "error" and "time is up" in result.error
    assert world.arms[0].commands == ["execute"]


def test_a_run_out_of_wall_time_is_stopped_wherever_it_is():
    result = run_fake(fake_workflow({"a": tool("Spin")}, [("START", "a"), ("a", "done")]), budget_s=0.05)
    assert result.status == "error" and "longer than its 0.05 s" in result.error and result.failed_node == "main/a"


def test_physics_that_diverged_ends_the_run_at_once_and_nothing_moves_again():
    @tool_("fake.Diverge", effect="actuate", resources=("arm:0",))
    def diverge(ctx: ToolContext) -> None:
        """Blows up."""
        raise SimulationDivergedError("qacc is not finite")

    world = FakeCell()
    w = fake_workflow({"a": "fake.Diverge"}, [("START", "a"), ("a", "done")], recovery=[{"tool": "fake.Grip"}])
    result = run_fake(w, diverge, cell=world)
    assert result.status == "error" and isinstance(result.causes[0], SimulationDivergedError)
    assert world.arms[0].commands == [] and len(result.causes) == 1


def test_an_inline_script_without_a_jail_is_refused_before_anything_runs(tmp_path):
    (tmp_path / "scripts").mkdir()
    (tmp_path / "scripts" / "x.py").write_text("def run(ctx) -> None:\n    raise SystemExit\n")
    graph = compile_fake(fake_workflow({"x": script("x")}, [("START", "x"), ("x", "done")]), folder=tmp_path)
    with pytest.raises(ExecutionError, match="no jail"):
        run_graph(graph, RunSetup())


def test_an_inline_script_runs_in_the_jail_with_the_host_checking_each_call(tmp_path):
    (tmp_path / "scripts").mkdir()
    (tmp_path / "scripts" / "x.py").write_text("def run(ctx, n: float) -> float:\n    return n\n")
    w = fake_workflow({"x": script("x", n=3)}, [("START", "x"), ("x", "done")], outputs={"o": ref("x")})
    asked = []

    def jail(path, inputs, call_tool, deadline_s, **more):
        asked.append((path.name, inputs, deadline_s <= 60))
        return call_tool("fake.Add", {"a": inputs["n"], "b": 1}).total

    seen = []
    run_graph(compile_fake(w, folder=tmp_path), RunSetup(script_runner=jail), [seen.append])
    assert asked == [("x.py", {"n": 3.0}, True)]
    assert seen[-2].data["outputs"] == {"o": 4.0}
    assert [e.data["tool"] for e in seen if e.kind == "tool_called"] == ["fake.Add"]


def test_compute_time_leaves_out_what_the_world_took():
    w = fake_workflow({"a": tool("Move", duration=1.0)}, [("START", "a"), ("a", "done")])
    seen = []
    run_fake(w, cell=FakeCell(pace=0.05), observers=[seen.append])
    moved = next(e.data for e in seen if e.kind == "node_finished")
    assert moved["duration_s"] - moved["compute_s"] >= 0.05
