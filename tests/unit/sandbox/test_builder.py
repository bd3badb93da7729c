import contextlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gap_cli.sandbox import builder, level, run_builder
from gap_cli.sandbox.server import ForkServer
from gap_runtime.errors import SandboxError

GRASP = """
from vos.builder import Subgraph, Ref, START, END

sg = Subgraph(name="grasp_sg", skill="grasp-direct-ik")
sg.add_node("close", type="tool", tool="gripper.Close")
sg.add_exit("grasped")
for edge in [(START, "close"), ("close", "grasped"), ("grasped", END)]:
    sg.add_edge(*edge)
sg.set_on_error("failed")
sg.add_checkpoint("held", lambda w: w.body("soup").is_grasped(), rationale="the promise")
"""
TASK = """
from vos.builder import WorkflowSpec, START
from vos.runtime.workflow import ServiceCall
spec = WorkflowSpec(name="t", description="d")
spec.add_end("abort", status="failure", recovery=[ServiceCall("gripper.v1.Gripper", "Open", {})])
"""

pytestmark = pytest.mark.skipif(level() == "none", reason="this kernel has no seccomp: nothing would run")


def refused(source, **options):
    with pytest.raises(SandboxError) as caught:
        run_builder(source, **options)
    return caught.value


def test_a_subgraph_comes_out_as_data():
    data = run_builder(GRASP)
    assert list(data["def"]["nodes"]) == ["close", "grasped"]
    assert data["def"]["on_error"] == "failed"


def test_the_source_of_a_lambda_is_found_without_a_file():
    assert run_builder(GRASP)["checkpoints"][0]["predicate"] == "w.body('soup').is_grasped()"


def test_lines_of_the_builder_code_are_known():
    assert run_builder(GRASP)["lines"]["nodes.close"] == 5


def test_a_spec_comes_out_as_data():
    end = run_builder(TASK)["def"]["nodes"]["abort"]
    assert end["status"] == "failure"
    assert end["recovery"][0]["tool"] == "gripper.Open"


def test_names_need_no_import():
    assert run_builder("sg = Subgraph('a', skill='b')\nr = (Ref, ServiceCall, WorkflowSpec, START, END)")


@pytest.mark.parametrize("source", ["", "x = 1", "sg = 1", GRASP + TASK, "spec = Subgraph('a', skill='b')"])
def test_exactly_one_result_is_wanted(source):
    assert "must bind" in refused(source).message


def test_the_one_expected_may_be_named():
    assert "def" in run_builder(GRASP + TASK, expect="sg")
    assert "spec = WorkflowSpec" in refused(GRASP, expect="spec").message


@pytest.mark.parametrize(
    ("source", "cause", "line", "said"),
    [
        ("x = 1\ny = (", "error", 2, "never closed"),
        ("x = 1\n\nspec.add()", "error", 3, "NameError"),
        ("def f():\n    return 1 / 0\nf()", "error", 2, "ZeroDivisionError"),
        ("WorkflowSpec('a', description='b').declare_subgraph('s')", "error", 1, "missing"),
        ("import os", "forbidden", 1, "os cannot be imported"),
        ("x = 1\nraise SystemExit", "error", 2, "SystemExit"),
    ],
)
def test_an_error_names_its_line(source, cause, line, said):
    error = refused(source)
    assert (error.cause, error.line) == (cause, line)
    assert said in error.message


def test_an_endless_loop_is_ended():
    assert refused("while True: pass", wall_s=0.2).cause == "timeout"


def test_the_same_code_gives_the_same_bytes():
    source = "sg = Subgraph('a', skill='b')\nfor name in {'x', 'y', 'z', 'u', 'v'}: sg.add_exit(name)"
    first = run_builder(source)
    other = ForkServer("gap_cli.sandbox.builder_child")
    assert list(run_builder(source, server=other)["def"]["nodes"]) == list(first["def"]["nodes"])
    other.close()


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_mangled_code_gives_a_graph_or_a_typed_error(data):
    place = st.integers(0, len(GRASP))
    start, end = sorted((data.draw(place), data.draw(place)))
    source = GRASP[:start] + data.draw(st.text(max_size=5) | st.just(GRASP[start:end] * 2)) + GRASP[end:]
    with contextlib.suppress(SandboxError):
        assert isinstance(run_builder(source), dict)


@pytest.mark.parametrize("source", ["#" * 300_000, None, b"x = 1"])
def test_what_is_not_a_reasonable_text_is_refused_at_the_door(source):
    assert refused(source).cause == "forbidden"


def test_where_the_kernel_cannot_filter_nothing_runs_unless_told_so():
    helpless = ForkServer("gap_cli.sandbox.builder_child", machine="unheard-of")
    assert helpless.level() == "none"
    error = refused(GRASP, server=helpless)
    assert error.cause == "unavailable"
    assert "--unsafe-no-sandbox" in error.hint
    assert run_builder(GRASP, unsafe=True, server=helpless) == run_builder(GRASP)
    helpless.close()


def test_a_jail_that_cannot_start_holds_nothing(monkeypatch):
    broken = ForkServer("no_such_worker")
    monkeypatch.setattr(builder, "builder_server", lambda: broken)
    assert level() == "none"
    assert "no_such_worker" in refused(GRASP).message
