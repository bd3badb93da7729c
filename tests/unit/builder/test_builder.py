"""Builder code becomes data, the data becomes a workflow, and a workflow becomes builder code again."""

from __future__ import annotations

import json

import pytest

from gap_cli.builder.assemble import assemble, assembled_lines
from gap_cli.builder.source import builder_lines, spec_source, subgraph_source
from gap_cli.builder.workflow import END, START, Ref, ServiceCall, Subgraph, WorkflowSpec
from gap_runtime.errors import DocumentError, WorkflowError
from gap_runtime.graph.checkpoints import Checkpoint
from gap_runtime.graph.dump import dump_workflow
from gap_runtime.graph.load import parse_workflow
from tests.unit.validate.kit import SKILLS, declare, fill, pick_sg, plain_workflow, run, see_sg, workflow_of


def node(**keys):
    sg = Subgraph("sg", skill="pick")
    sg.add_node("n", **keys)
    return sg.to_dict()["def"]["nodes"]["n"]


def test_a_node_keeps_what_was_said_and_nothing_else():
    assert node(type="tool", tool="gripper.Open") == {"type": "tool", "tool": "gripper.Open"}
    assert node(type="tool", tool="gripper.Open", inputs={"arm_id": 0})["inputs"] == {"arm_id": 0}


def test_references_are_written_wherever_they_stand():
    given = node(type="noop", inputs={"a": Ref("x.y"), "b": [Ref("z"), {"c": Ref("in.d")}]})["inputs"]
    assert given == {"a": {"$ref": "x.y"}, "b": [{"$ref": "z"}, {"c": {"$ref": "in.d"}}]}


@pytest.mark.parametrize("call", [ServiceCall("gripper.v1.Gripper", "Open", {"arm_id": 1}),
                                  ServiceCall("gripper.Open", {"arm_id": 1}),
                                  ServiceCall("gripper.Open", inputs={"arm_id": 1})])  # fmt: skip
def test_both_spellings_of_a_recovery_mean_the_flat_name(call):
    assert (call.tool, call.inputs) == ("gripper.Open", {"arm_id": 1})


@pytest.mark.parametrize("code", [
    'sg.add_node("a", type="noop")\nsg.add_node("a", type="noop")',
    'sg.add_exit("a")\nsg.add_node("a", type="noop")',
    'sg.add_node("a", type="noop", inputs={...})',
    'sg.add_node("a", type="noop", inputs={"x": object()})',
    'sg.add_node("a", type="noop", inputs={"x": float("nan")})',
    'sg.add_node("a", type="noop", inputs={1: 2})',
    'sg.add_node("a", type="noop", colour="red")',
    'sg.add_conditional_edges("a", {})',
    'sg.add_conditional_edges("a", {"x": "y"})\nsg.add_conditional_edges("a", {"z": "y"})',
    'sg.add_edge("a", "b")\nsg.add_edge("a", "b")',
    'sg.add_edge("a", 3)',
    'sg.set_on_error("a")\nsg.set_on_error("b")',
    'sg.add_exit("a")\nsg.set_exit_router(router_field="x", success_values=["a"])',
    'sg.set_outputs(a=Ref("x"))\nsg.set_outputs(a=Ref("y"))',
    'sg.add_checkpoint("a", 3)',
    'sg.add_checkpoint("a", lambda w, v: True)',
    'x = []\nfor _ in range(100): x = [x]\nsg.add_node("a", type="noop", inputs={"x": x})',
])  # fmt: skip
def test_what_no_file_can_hold_is_refused_where_it_is_written(code):
    with pytest.raises(DocumentError):
        run(code, sg=Subgraph("sg", skill="pick"))


@pytest.mark.parametrize(("code", "says"), [
    ('sg.add_input("a", type_name="Mask")', "add_input(): has no 'type_name' Known: proto_type."),
    ('sg.add_checkpoint("a", "w.time > 1", rational="x")', "has no 'rational' Did you mean 'rationale'?"),
    ('sg.add_node("a", type="noop", colour="red")', "a node has no 'colour' Known: deadline_s,"),
    ('sg.add_node("a", type="tool", tol="x")', "a node has no 'tol' Did you mean 'tool'?"),
    ('sg.add_node("a")', "missing a required"),
    ('sg.add_edge("a", "b", "c")', "too many positional arguments It takes source, target."),
    ('sg.add_nodes("a")', "Subgraph.add_nodes: does not exist Did you mean 'add_node'?"),
    ('Subgraph("a", skil="b")', "Subgraph(): has no 'skil' Did you mean 'skill'?"),
    ('ServiceCall("a.B", input={})', "ServiceCall(): has no 'input' Did you mean 'inputs'?"),
    ('Ref(node="a")', "Ref(): has no 'node' Known: path."),
])  # fmt: skip
def test_a_call_that_does_not_exist_says_what_does(code, says):
    with pytest.raises(DocumentError) as error:
        run(code, sg=Subgraph("sg", skill="pick"))
    assert says in str(error.value)


def test_what_a_topology_takes_is_said_too():
    with pytest.raises(DocumentError, match="has no 'exits' Did you mean 'exit_success_values'"):
        WorkflowSpec("w").declare_subgraph("a", skill="pick", exits=["done"])


@pytest.mark.parametrize(("keys", "hint"), [
    ({"type": "service", "service": "gripper.v1.Gripper", "method": "Open"}, 'type="tool", tool="gripper.Open"'),
    ({"type": "skill", "skill": "run_policy"}, 'type="tool", tool="run_policy"'),
    ({"type": "policy", "policy": "libero_pi05"}, 'type="tool", tool="libero_pi05"'),
])  # fmt: skip
def test_retired_types_say_exactly_what_to_write_instead(keys, hint):
    with pytest.raises(DocumentError) as error:
        node(**keys)
    assert hint in error.value.hint
    data = plain_workflow()
    data["subgraphs"]["pick_sg"]["nodes"]["open"] = keys
    with pytest.raises(WorkflowError) as error:
        parse_workflow(data, "w")
    assert hint in error.value.findings[0].hint


def test_every_call_remembers_its_line():
    sg = Subgraph("sg", skill="pick")
    run('sg.add_node("a", type="noop")\n\nsg.add_edge(\n    START, "a")\nsg.add_exit("b")', sg=sg)
    assert sg.to_dict()["lines"] == {"nodes.a": 1, "edges.0": 3, "nodes.b": 5}


@pytest.mark.parametrize(("code", "text"), [
    ('sg.add_checkpoint("c", \'w.body("x").z > 1\')', 'w.body("x").z > 1'),
    ('sg.add_checkpoint("c", lambda w: w.body("x").z > 1)', "w.body('x').z > 1"),
    ('sg.add_checkpoint("c", lambda world: world.body("x").is_grasped())', "w.body('x').is_grasped()"),
    ('K = "soup"\nsg.add_checkpoint("c", lambda w: w.body(K).z > 1)', "w.body('soup').z > 1"),
    ('def held(w):\n    return w.body("x").is_grasped()\nsg.add_checkpoint("c", held)', "w.body('x').is_grasped()"),
    ('a, b = (lambda w: w.time > 1), (lambda w: w.time > 2)\nsg.add_checkpoint("c", b)', "w.time > 2"),
])  # fmt: skip
def test_a_predicate_leaves_as_text(code, text):
    sg = Subgraph("sg", skill="pick")
    run(code, sg=sg)
    assert sg.to_dict()["checkpoints"][0]["predicate"] == text


def example():
    spec = WorkflowSpec("example", "Pick the soup.", {"observation_stream_hz": "10"})
    subgraphs = [see_sg(), pick_sg("""
sg.add_node("check", type="script", script="scripts/check.py", inputs={"opening": 0.02}, deadline_s=2.5)
sg.add_node("open", type="tool", tool="gripper.Open", inputs={"arm_id": 0}, description="let go")
sg.add_edge(START, "check")
sg.add_conditional_edges("check", {"held": "done", "empty": "open"}, router_field="state")
sg.add_edge("open", "done")
sg.add_checkpoint("held", lambda w: w.body("soup").z > 0.1, rationale="up", diagnostics={"z": 'w.body("soup").z'})
sg.add_checkpoint("slow", 'w.time > 1', validate=False, weight=0.5)
""")]  # fmt: skip
    declare(spec, subgraphs[0], names={"name": "target"})
    declare(spec, subgraphs[1], stage="grasp", parameters={"lift": 0.12})
    spec.add_subgraph_node("see", ref="see_sg", max_visits=2)
    spec.add_subgraph_node("pick", ref="pick_sg")
    spec.add_end("abort", status="failure", recovery=[ServiceCall("gripper.Open", {"arm_id": 0})])
    return spec, subgraphs


def test_what_builders_say_is_json():
    spec, subgraphs = example()
    for data in (spec.to_dict(), *(s.to_dict() for s in subgraphs)):
        assert json.loads(json.dumps(data, allow_nan=False)) == data


def test_a_workflow_becomes_builder_code_that_makes_the_same_workflow():
    workflow, checkpoints, _ = workflow_of(*example())
    points = {n: [Checkpoint.of(c, n) for c in cs] for n, cs in checkpoints.items()}
    codes = {n: subgraph_source(n, d, points[n]) for n, d in workflow.subgraphs.items()}
    # `vos` is there in the sandbox only; the names it offers are there here
    built = {n: run(_without_imports(code))["sg"].to_dict() for n, code in codes.items()}
    spec = run(_without_imports(spec_source(workflow, SKILLS)), WorkflowSpec=WorkflowSpec)["spec"].to_dict()
    assert dump_workflow(assemble(spec, built)) == dump_workflow(workflow)
    assert {n: b["checkpoints"] for n, b in built.items()} == checkpoints


def _without_imports(code):
    return "\n".join(line for line in code.splitlines() if not line.startswith("from "))


def test_data_survives_a_round_trip_through_the_model():
    data = plain_workflow()
    assert dump_workflow(parse_workflow(data, "w")) == data


def test_a_subgraph_without_on_error_has_the_declared_one_or_that_of_its_skill():
    spec, subgraphs = example()
    built = {s.name: s.to_dict() for s in subgraphs}
    for name in built:
        built[name]["def"]["on_error"] = ""
    assert assemble(spec.to_dict(), built).subgraphs["pick_sg"].on_error == "failed"
    spec.subgraphs["pick_sg"]["on_error"] = ""
    workflow = assemble(spec.to_dict(), built)
    assert "on_error" not in dump_workflow(workflow)["subgraphs"]["pick_sg"]
    assert "on_error" not in subgraph_source("pick_sg", workflow.subgraphs["pick_sg"])


def test_the_stream_of_observations_may_be_declared_on_either_side():
    spec, subgraphs = example()
    subgraphs[1].add_input("observation_stream", "ObservationStream")
    assemble(spec.to_dict(), {s.name: s.to_dict() for s in subgraphs})


def test_assembling_names_every_disagreement():
    spec, subgraphs = example()
    declare(spec, fill(Subgraph("lost_sg", skill="pick")))
    built = {s.name: s.to_dict() for s in subgraphs}
    built["pick_sg"]["def"] |= {"on_error": "abort", "skill": "pack", "inputs": {}, "outputs": {}}
    spec.subgraphs["pick_sg"]["outputs"] = {"grasp_pose": "Se3Pose"}
    built["extra_sg"] = built["see_sg"]
    with pytest.raises(WorkflowError) as error:
        assemble(spec.to_dict(), built)
    assert {f.code for f in error.value.findings} == {"W4"}
    assert {f.path.removeprefix("subgraphs.") for f in error.value.findings} == {
        "extra_sg", "lost_sg", "pick_sg.inputs", "pick_sg.on_error", "pick_sg.outputs", "pick_sg.skill",
    }  # fmt: skip


def test_lines_read_from_the_code_are_those_it_ran_with():
    workflow, _, _ = workflow_of(*example())
    codes = {n: subgraph_source(n, d) for n, d in workflow.subgraphs.items()}
    top = spec_source(workflow, SKILLS)
    blank = {n: "\n" * code.count("from ") + _without_imports(code) for n, code in codes.items()}
    built = {n: run(code)["sg"].to_dict() for n, code in blank.items()}
    spec = run("\n" * top.count("\nfrom ") + "\n" + _without_imports(top), WorkflowSpec=WorkflowSpec)["spec"].to_dict()
    sources = {"plan/spec.py": top, **{f"generate/subgraphs/{n}.py": code for n, code in codes.items()}}
    assert builder_lines(workflow, sources) == assembled_lines(spec, built)


def test_start_and_end_are_the_paper_s_words():
    assert (START, END) == ("START", "END")
