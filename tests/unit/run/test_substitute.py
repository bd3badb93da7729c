"""Mocks and injected faults, by node path or tool name."""

from __future__ import annotations

import pytest

from gap_runtime.contracts.failures import (
    DocumentError,
    GraspError,
    MotionError,
    PerceptionError,
    PlanningError,
    ToolError,
)
from gap_runtime.run.execute import RunSetup, run_graph
from gap_runtime.run.substitute import Rule, load_substitutions, substitute
from gap_runtime.testing import FakeCell, compile_fake, fake_workflow

W = fake_workflow(
    {"a": {"type": "tool", "tool": "fake.Add", "inputs": {"a": 1}}, "b": {"type": "tool", "tool": "fake.Move"}},
    [("START", "a"), ("a", "b"), ("b", "done")],
    outputs={"sum": {"$ref": "a.total"}},
)


def run(*rules, workflow=W, **setup):
    graph = substitute(compile_fake(workflow), [Rule.load(r, "rule") for r in rules])
    seen = []
    result = run_graph(graph, RunSetup(**{"cell": FakeCell(), **setup}), [seen.append])
    return result, seen[-2].data.get("outputs")


def test_a_node_gives_what_the_rule_says():
    assert run({"node": "main/a", "output": {"total": 7, "positive": True}})[1] == {"sum": 7.0}


def test_wildcards_match_and_the_first_rule_counts():
    first = {"node": "*/a", "output": {"total": 1, "positive": True}}
    second = {"node": "main/[ab]", "output": 2.0}
    result, outputs = run(first, second)
    assert result.status == "success" and outputs == {"sum": 1.0}


@pytest.mark.parametrize(
    "fault, kind",
    [
        ("tool", ToolError),
        ("perception", PerceptionError),
        ("planning", PlanningError),
        ("motion", MotionError),
        ("grasp", GraspError),
    ],
)
def test_an_injected_error_is_of_the_kind_asked_for(fault, kind):
    result, _ = run({"node": "main/b", "raise": {"kind": fault, "code": "stalled", "message": "stuck"}})
    assert type(result.causes[0]) is kind and result.causes[0].code == "stalled" and result.failed_node == "main/b"


def test_a_wrong_type_is_caught_at_the_border_of_the_node():
    result, _ = run({"node": "main/a", "wrong_type": True})
    assert result.failed_node == "main/a" and "not its fields" in result.error


def test_a_late_node_misses_its_deadline():
    node = {"type": "tool", "tool": "fake.Add", "inputs": {"a": 1}, "deadline_s": 0.05}
    w = fake_workflow({"a": node}, [("START", "a"), ("a", "done")])
    result, _ = run({"node": "main/a", "late": True}, workflow=w, patience=1.0, grace_s=0.05)
    assert result.causes[0].code == "deadline"


def test_a_delayed_node_listens_while_it_waits():
    node = {"type": "tool", "tool": "fake.Add", "inputs": {"a": 1}, "deadline_s": 0.05}
    w = fake_workflow({"a": node}, [("START", "a"), ("a", "done")])
    result, _ = run({"node": "main/a", "delay_s": 10.0}, workflow=w, patience=1.0, grace_s=60.0)
    assert result.causes[0].code == "deadline"


def test_a_rule_may_count_calls():
    edges = [("START", "a"), ("b", "done")]
    w = fake_workflow(
        {
            "a": {"type": "tool", "tool": "fake.Add", "inputs": {"a": 1}},
            "again": {"type": "noop"},
            "b": {"type": "noop"},
        },
        [*edges, ("again", "a")],
        conditional_edges={"a": {"router_field": "positive", "mapping": {"true": "b", "false": "again"}}},
    )
    rule = {"tool": "fake.Add", "output": {"total": -1, "positive": False}, "calls": [1, 2]}
    graph = substitute(compile_fake(w), [Rule.load(rule, "rule")])
    seen = []
    run_graph(graph, RunSetup(), [seen.append])
    assert [e.path for e in seen if e.kind == "node_finished"].count("main/a") == 3


def test_a_tool_rule_reaches_into_scripts(tmp_path):
    file = tmp_path / "s.py"
    file.write_text("def run(ctx) -> float:\n    return ctx.tool('fake.Add', a=1).total\n")
    w = fake_workflow(
        {"s": {"type": "script", "script": "scripts/s.py"}},
        [("START", "s"), ("s", "done")],
        outputs={"o": {"$ref": "s"}},
    )
    rule = Rule.load({"tool": "fake.A*", "output": {"total": 5, "positive": True}}, "rule")
    graph = substitute(compile_fake(w, canonical={"scripts/s.py": file}), [rule])
    seen = []
    run_graph(graph, RunSetup(), [seen.append])
    assert seen[-2].data["outputs"] == {"o": 5.0}


def test_a_rule_that_matches_nothing_is_an_error_with_the_nearest_name():
    with pytest.raises(DocumentError, match="main/a"):
        substitute(compile_fake(W), [Rule.load({"node": "main/aa"}, "rule")])


@pytest.mark.parametrize(
    "text, says",
    [
        ("rules: [{node: a, tool: b}]", "exactly one"),
        ("rules: [{}]", "exactly one"),
        ("rules: [{node: a, raise: {kind: oops}}]", "rules.0.raise.kind"),
        ("rules: [{node: a, delay: 3}]", "delay_s"),
        ("rules: 3", "rules"),
    ],
)
def test_a_bad_rules_file_gets_one_clear_error(tmp_path, text, says):
    file = tmp_path / "rules.yaml"
    file.write_text(text)
    with pytest.raises(DocumentError) as caught:
        load_substitutions(file)
    assert says in str(caught.value)


def test_a_rules_file_is_read(tmp_path):
    file = tmp_path / "rules.yaml"
    file.write_text("schema: gap/substitutions/v1\nrules:\n  - node: main/a\n    output: {total: 3, positive: true}\n")
    assert load_substitutions(file).rules[0].output == {"total": 3, "positive": True}
