"""Findings in detail: what each says, where, and what it lets pass."""

from __future__ import annotations

import json

import pytest

from gap_cli.analysis.catalog import contract_names, infer_names, read_catalog, substitute
from gap_cli.validate.validator import require_valid, validate
from gap_runtime.bundle.bundle import GraphBundle
from gap_runtime.errors import WorkflowError
from gap_runtime.graph.dump import dump_workflow
from gap_runtime.graph.load import parse_workflow
from gap_runtime.graph.scripts import read_signature
from tests.unit.validate.kit import SCRIPTS, SKILLS, SOURCES, TOOLS, catalog, findings_at, plain_workflow

OPEN = 'sg.add_node("open", type="tool", tool="gripper.Open")\n'
CHECK = 'sg.add_node("check", type="script", script="scripts/check.py", inputs={"opening": 0.02})\n'
AIM = (
    'sg.add_node("aim", type="tool", tool="geometry_svc.TopDownGraspFromOBB", inputs={"obb": Ref("in.target_obb")%s})\n'
)
LOOK = 'sg.add_node("look", type="tool", tool="observation.GetObservation")\n'


def of(code):
    return [(f.code, f.path.removeprefix("subgraphs.pick_sg.")) for f in findings_at("sg", code)]


def only(code, at="sg"):
    (finding,) = findings_at(at, code)
    return finding


def node(tool, **inputs):
    return f'sg.add_node("n", type="tool", tool="{tool}", inputs={inputs!r})\n'


def test_findings_come_sorted_and_all_at_once():
    found = findings_at("sg", 'sg.add_node("z", type="tool", tool="x.Y")\nsg.add_node("a", type="tool", tool="x.Z")')
    assert [f.path.rpartition("nodes.")[2] for f in found] == ["a.tool", "z.tool"]


def test_a_finding_carries_the_line_of_the_code_that_wrote_it():
    assert only("\n\n" + OPEN.replace("gripper", "griper")).line == 3


def test_near_misses_are_named():
    assert only(node("gripper.Opn")).hint == "Did you mean 'gripper.Open'?"
    assert only(node("gripper.Open", arm=0)).hint == "Did you mean 'arm_id'?"
    assert only('sg.add_node("n", type="tool", tool="grip.GoHome")').hint == "Did you mean 'robot_control.GoHome'?"


@pytest.mark.parametrize(("inputs", "codes"), [
    ({"settle_steps": 40}, []), ({"settle_steps": 40.5}, ["D6"]), ({"settle_steps": True}, ["D6"]),
    ({"settle_steps": None}, ["D6"]), ({"settle_steps": [1]}, ["D6"]), ({"settle_steps": {"$ref": ""}}, ["D1"]),
    ({"settle_steps": {"$ref": "x", "y": 1}}, ["D1"]), ({"settle_steps": {"$ref": 3}}, ["D1"]),
])  # fmt: skip
def test_literals_are_held_to_their_types(inputs, codes):
    assert [c for c, _ in of(node("gripper.Open", **inputs))] == codes


def test_a_word_is_one_of_those_a_script_takes():
    grip = 'sg.add_node("n", type="script", script="scripts/grip.py", inputs=%r)'
    assert of(grip % {"how": "firm", "times": 2}) == []
    assert only(grip % {"how": "frim"}).hint == "Did you mean 'firm'?"
    assert [c for c, _ in of(grip % {"how": "soft", "times": 3})] == ["D6"]


POSE = {"position": {"x": 0.1, "y": 0.0, "z": 0.3}, "rotation": {"w": 0.0, "x": 1.0, "y": 0.0, "z": 0.0}}


def test_a_contract_type_can_be_written_out_with_references_inside():
    assert of(node("robot_control.GoToPose", pose=POSE)) == []
    mixed = {**POSE, "position": {"$ref": "in.target_obb.center"}}
    assert of(node("robot_control.GoToPose", pose=mixed)) == []
    wrong = {**POSE, "position": {"$ref": "in.target_obb.orientation"}}
    assert of(node("robot_control.GoToPose", pose=wrong)) == [("D4", "nodes.n.inputs.pose.position")]
    short = {"position": POSE["position"]}
    assert [c for c, _ in of(node("robot_control.GoToPose", pose=short))] == ["D6"]
    strange = {**mixed, "colour": 1}
    assert [c for c, _ in of(node("robot_control.GoToPose", pose=strange))] == ["D6"]
    partial = {"position": {"$ref": "in.target_obb.center"}}
    assert [c for c, _ in of(node("robot_control.GoToPose", pose=partial))] == ["D6"]


@pytest.mark.parametrize(("path", "code"), [
    ("look.cameras", None), ("look.cameras.rgb", "D3"), ("look.cameras.0", "D4"), ("look", "D4"), ("nothing", "D1"),
    ("look.cameras.0.rgb", "D4"), ("look.cameras.x", "D3"), ("look.cameras.0.rgb.date", "D3"),
])  # fmt: skip
def test_a_walk_is_followed_type_by_type(path, code):
    find = f"""sg.add_node("find", type="script", script="scripts/perceive.py",
        inputs={{"cameras": Ref("{path}"), "object_name": "soup"}})"""
    assert [c for c, _ in of(LOOK + find)] == [code] * (code is not None)


def test_what_may_be_absent_does_not_flow_where_it_must_be_there():
    find = """sg.add_node("find", type="script", script="scripts/perceive.py",
        inputs={"cameras": Ref("look.cameras"), "object_name": "soup"})
sg.add_node("again", type="script", script="scripts/masked.py", inputs={"mask": Ref("find.mask")})"""
    finding = only(LOOK + find)
    assert finding.code == "D4" and "may be absent" in finding.message


@pytest.mark.parametrize("arm", [0, 1])
def test_different_arms_do_not_clash_and_an_arm_not_known_may(arm):
    both = f"""
sg.add_node("a", type="tool", tool="gripper.Open", inputs={{"arm_id": 0}})
sg.add_node("b", type="tool", tool="gripper.Open", inputs={{"arm_id": {arm}}})
for n in "ab":
    sg.add_edge(START, n)
    sg.add_edge(n, "done")
"""
    assert [c for c, _ in of(both)] == (["R1"] if arm == 0 else [])
    computed = both.replace('{"arm_id": 0}', '{"arm_id": Ref("param.lift")}')
    assert "R1" in [c for c, _ in of(computed)]


def test_a_script_that_computes_tool_names_may_hold_whatever_its_skill_allows():
    beside = (
        OPEN
        + """
sg.add_node("any", type="script", script="scripts/anything.py", inputs={"name": "x"})
for n in ("open", "any"):
    sg.add_edge(START, n)
    sg.add_edge(n, "done")
"""
    )
    assert {c for c, _ in of(beside)} == {"R1", "P2"}  # the skill of the tests lists a privileged tool


def test_senses_run_beside_each_other():
    beside = (
        LOOK
        + """
sg.add_node("pose", type="tool", tool="robot_control.GetEEPose")
for n in ("look", "pose"):
    sg.add_edge(START, n)
    sg.add_edge(n, "done")
"""
    )
    assert of(beside) == []


def test_a_tracker_watches_while_the_arm_moves():
    beside = (
        OPEN
        + """
sg.add_node("track", type="tool", tool="track_object", streaming=True,
            inputs={"observation_stream": Ref("in.observation_stream")})
sg.add_edge(START, "track")
sg.add_edge(START, "open")
sg.add_edge("open", "done")
"""
    )
    assert of(beside) == []


SEND = """
sg.add_node("send", type="router", script="scripts/send.py")
sg.add_node("item", type="script", script="scripts/item.py")
sg.add_edge(START, "send")
sg.add_conditional_edges("send", {"item": "item"})
"""
JOIN = 'sg.add_edge("item", "done")\n'


def test_a_fan_out_gives_inputs_runs_copies_and_collects_under_its_own_name():
    assert of(SEND + JOIN) == []
    reads = """
sg.add_node("sum", type="script", script="scripts/item.py", inputs={"item": Ref("%s")})
sg.add_edge("item", "sum")
sg.add_edge("sum", "done")
"""
    assert of(SEND + reads % "send.0") == []
    assert of(SEND + reads % "item") == [("D2", "nodes.sum.inputs.item")]
    choice = 'sg.add_conditional_edges("item", {"1": "done"}, router_field="x")'
    assert "S6" in [c for c, _ in of(SEND + choice)]


def test_copies_of_what_moves_would_move_together():
    assert of(SEND.replace("scripts/item.py", "scripts/squeeze.py") + JOIN) == [("R1", "nodes.item")]


def test_a_static_router_is_held_to_its_words():
    code = """
sg.add_node("choose", type="router", script="scripts/choose.py")
sg.add_node("left", type="tool", tool="gripper.Open")
sg.add_edge(START, "choose")
sg.add_conditional_edges("choose", {"left": "left", "%s": "done"})
sg.add_edge("left", "done")
"""
    assert of(code % "right") == []
    assert {c for c, _ in of(code % "up")} == {"D9"}


@pytest.mark.parametrize("returns", ["dict", "dict[str, str]", "Any", "list[str]", "float", "None"])
def test_a_router_returns_the_name_of_a_node_or_a_list_of_sends(returns):
    route = read_signature(f"from typing import Any\ndef run(ctx) -> {returns}: ...", "route")
    data = plain_workflow()
    sg = data["subgraphs"]["pick_sg"]
    sg["nodes"] |= {"route": {"type": "router", "script": "scripts/route.py"}, "opened": {"type": "noop"}}
    sg["edges"] = [["START", "route"], ["open", "done"], ["done", "END"], ["opened", "END"]]
    sg["conditional_edges"] = {"route": {"mapping": {"ok": "open", "no": "opened"}}}
    sg["exit"]["success_values"] = ["done", "opened"]
    data["conditional_edges"]["pick"]["mapping"]["opened"] = "done"
    (finding,) = validate(parse_workflow(data, "x"), catalog(scripts={**SCRIPTS, "scripts/route.py": route}))
    assert (finding.code, finding.path) == ("D9", "subgraphs.pick_sg.conditional_edges.route")
    assert "the name of a node" in finding.message and "-> str" in finding.hint


def with_two_ways_of_seeing(data):
    """`see` finds its box at exit found, and by chance at exit maybe."""
    sg = data["subgraphs"]["see_sg"]
    sg["nodes"] |= {
        "check": {"type": "script", "script": "scripts/check.py", "inputs": {"opening": 0.0}},
        "sure": {"type": "script", "script": "scripts/check.py", "inputs": {"opening": 0.0}},
        "maybe": {"type": "noop"},
    }
    sg["edges"] = [["START", "check"], ["look", "find"], ["find", "box"], ["box", "sure"], ["found", "END"],
                   ["maybe", "END"]]  # fmt: skip
    sg["conditional_edges"] = {
        "check": {"router_field": "state", "mapping": {"held": "look", "empty": "maybe"}},
        "sure": {"router_field": "state", "mapping": {"held": "found", "empty": "maybe"}},
    }
    sg["exit"]["success_values"] = ["found", "maybe"]
    exits = type(SKILLS["see"].exits)(success={"found": "it", "maybe": "or not"}, failure="not_found")
    given = catalog()
    return type(given)(given.tools, {**SKILLS, "see": SKILLS["see"].model_copy(update={"exits": exits})}, given.scripts)


def test_an_output_that_is_there_only_sometimes_may_collide_and_may_be_missing():
    data = plain_workflow()
    known = with_two_ways_of_seeing(data)
    routes = data["conditional_edges"]["see"]["mapping"]
    routes["maybe"] = "done"
    assert validate(parse_workflow(data, "x"), known) == []
    routes["maybe"] = "pick"
    assert [f.code for f in validate(parse_workflow(data, "x"), known)] == ["W12"]
    data["nodes"]["again"] = {"type": "subgraph", "ref": "again_sg"}
    data["subgraphs"]["again_sg"] = data["subgraphs"]["see_sg"]
    data["conditional_edges"]["again"] = {
        "router_field": "exit", "mapping": {"found": "pick", "maybe": "done", "not_found": "abort"},
    }  # fmt: skip
    routes |= {"found": "pick", "maybe": "again"}
    found = validate(parse_workflow(data, "x"), known)
    assert {f.code for f in found} == {"W13"}
    assert {f.path for f in found} == {f"subgraphs.again_sg.outputs.target_{n}" for n in ("obb", "cloud")}


def test_an_output_that_only_some_exits_give_is_missed_only_after_the_others():
    data = plain_workflow()
    sg = data["subgraphs"]["see_sg"]
    sg["nodes"]["check"] = {"type": "script", "script": "scripts/check.py", "inputs": {"opening": 0.0}}
    sg["nodes"]["none"] = {"type": "noop"}
    sg["edges"] = [
        ["START", "check"],
        ["look", "find"],
        ["find", "box"],
        ["box", "found"],
        ["found", "END"],
        ["none", "END"],
    ]
    sg["conditional_edges"] = {"check": {"router_field": "state", "mapping": {"held": "look", "empty": "none"}}}
    sg["exit"]["success_values"] = ["found", "none"]
    skills = {**SKILLS, "see": SKILLS["see"].model_copy(update={"exits": type(SKILLS["see"].exits)(
        success={"found": "it", "none": "nothing there"}, failure="not_found")})}  # fmt: skip

    def codes(target):
        routes = data["conditional_edges"]["see"]["mapping"]
        routes["none"] = target
        given = catalog()
        found = validate(parse_workflow(data, "x"), type(given)(given.tools, skills, given.scripts))
        return [f.code for f in found]

    assert codes("done") == []
    assert codes("pick") == ["W12"]


def test_names_substitute_exactly_then_by_slot_then_by_role():
    assert substitute("target_obb", {"target_obb": "x", "target": "y"}) == "x"
    assert substitute("<name>_obb", {"name": "soup"}) == "soup_obb"
    assert substitute("target_obb", {"target": "target_2"}) == "target_2_obb"
    assert substitute("target_lid_obb", {"target": "a", "target_lid": "b"}) == "b_obb"
    assert substitute("targets_obb", {"target": "a"}) == "targets_obb"


def test_the_slot_is_inferred_where_the_declared_names_leave_no_doubt():
    see = SKILLS["see"]
    assert infer_names(see, {}, ["soup_obb", "soup_cloud"]) == {"name": "soup"}
    assert infer_names(see, {}, ["soup_obb", "basket_cloud"]) == {}
    assert infer_names(see, {"name": "x"}, ["soup_obb"]) == {"name": "x"}
    assert list(contract_names(see, {"name": "soup"})[1]) == ["soup_obb", "soup_cloud"]


def stored(workflow, folder):
    (folder / "workflow.json").write_text(json.dumps(dump_workflow(workflow)))
    return GraphBundle.load(folder)


def test_a_folder_s_scripts_and_checkpoints_are_read_and_their_faults_become_findings(tmp_path):
    workflow = parse_workflow(plain_workflow(), "x")
    for name in ("scripts", "checkpoints"):
        (tmp_path / name).mkdir()
    (tmp_path / "scripts" / "perceive.py").write_text("def run(ctx) -> Bananas: ...")
    point = "Checkpoint('held', 'w.body(\"soup\").z > 0', rationale='up')"
    (tmp_path / "checkpoints" / "see_sg.py").write_text(f"CHECKPOINTS = [{point}]")
    (tmp_path / "checkpoints" / "pick_sg.py").write_text("CHECKPOINTS = [print(1)]")
    found = validate(workflow, read_catalog(stored(workflow, tmp_path), TOOLS, SKILLS, ["soup"]))
    by_code = {f.code: f for f in found}
    assert set(by_code) == {"K3", "K10"}
    assert "Bananas" in by_code["K3"].message and by_code["K10"].path == "subgraphs.pick_sg.checkpoints"
    (tmp_path / "scripts" / "perceive.py").write_text(__import__("textwrap").dedent(SOURCES["perceive"]))
    (tmp_path / "checkpoints" / "pick_sg.py").write_text(f"CHECKPOINTS = [{point}]")
    assert validate(workflow, read_catalog(stored(workflow, tmp_path), TOOLS, SKILLS, ["soup"])) == []


@pytest.mark.parametrize("path", ["../secret.py", "scripts/../../secret.py", "/secret.py", "scripts\\..\\secret.py"])
def test_a_script_outside_the_folder_is_not_read(tmp_path, path):
    (tmp_path / "run" / "scripts").mkdir(parents=True)
    (tmp_path / "secret.py").write_text("def run(ctx) -> None: ...")
    found, given = judged_with_script(tmp_path / "run", f"{tmp_path}{path}" if path[0] == "/" else path)
    assert "K3" in found and not any("secret" in name for name in given.scripts)


@pytest.mark.parametrize("path", ["x.py", "scripts/x.txt"])
def test_a_script_is_a_python_file_below_scripts(tmp_path, path):
    (tmp_path / "scripts").mkdir()
    (tmp_path / path).write_text("def run(ctx) -> None: ...")
    assert "K3" in judged_with_script(tmp_path, path)[0]


def judged_with_script(folder, path):
    data = plain_workflow()
    data["subgraphs"]["see_sg"]["nodes"]["find"]["script"] = path
    workflow = parse_workflow(data, "x")
    given = read_catalog(stored(workflow, folder), TOOLS, SKILLS, checkpoints=False)
    return {f.code for f in validate(workflow, given)}, given


def test_a_link_out_of_the_folder_is_not_followed(tmp_path):
    (tmp_path / "run" / "scripts").mkdir(parents=True)
    (tmp_path / "secret.py").write_text("def run(ctx) -> None: ...")
    (tmp_path / "run" / "scripts" / "perceive.py").symlink_to(tmp_path / "secret.py")
    workflow = parse_workflow(plain_workflow(), "x")
    given = read_catalog(stored(workflow, tmp_path / "run"), TOOLS, SKILLS, checkpoints=False)
    assert "leads out" in given.problems["scripts/perceive.py"]


def test_require_valid_raises_with_every_finding():
    data = plain_workflow()
    require_valid(parse_workflow(data, "x"), catalog())
    data["subgraphs"]["pick_sg"]["nodes"]["open"]["tool"] = "gripper.Opn"
    data["nodes"]["abort"]["status"] = "success"
    data["meta"]["validate_checkpoints"] = "maybe"
    with pytest.raises(WorkflowError) as error:
        require_valid(parse_workflow(data, "x"), catalog())
    assert [f.code for f in error.value.findings] == ["W3", "K2"]


@pytest.mark.parametrize("declared", ["ObservationStream", "Observation", None])
def test_the_stream_of_observations_is_always_there(declared):
    data = plain_workflow()
    sg = data["subgraphs"]["pick_sg"]
    sg["inputs"] |= {"observation_stream": declared} if declared else {}
    stream = {"observation_stream": {"$ref": "in.observation_stream"}}
    sg["nodes"]["track"] = {"type": "tool", "tool": "track_object", "streaming": True, "inputs": stream}
    sg["edges"].append(["START", "track"])
    assert validate(parse_workflow(data, "x"), catalog()) == []


def test_the_stream_of_observations_is_of_one_type():
    data = plain_workflow()
    data["subgraphs"]["pick_sg"]["inputs"]["observation_stream"] = "Mask"
    (finding,) = validate(parse_workflow(data, "x"), catalog())
    assert finding.code == "W11" and "ObservationStream" in finding.message


def test_without_on_error_a_subgraph_fails_as_its_skill_does():
    data = plain_workflow()
    del data["subgraphs"]["pick_sg"]["on_error"]
    assert validate(parse_workflow(data, "x"), catalog()) == []
    del data["conditional_edges"]["pick"]["mapping"]["failed"]
    (finding,) = validate(parse_workflow(data, "x"), catalog())
    assert finding.code == "W8" and "'failed' of 'pick' leads nowhere" in finding.message
    assert finding.hint == 'Add "failed": <node> to the conditional edges of pick.'


def test_a_failure_exit_routed_by_another_name_is_found_with_the_word_to_write():
    data = plain_workflow()
    for node, failure in (("see", "not_found"), ("pick", "failed")):
        mapping = data["conditional_edges"][node]["mapping"]
        mapping["abort"] = mapping.pop(failure)
    found = validate(parse_workflow(data, "x"), catalog())
    assert [f.code for f in found] == ["W8"] * 4
    assert {(f.path, f.hint) for f in found} == {
        ("conditional_edges.see", 'Write "not_found" for "abort" in the conditional edges of see.'),
        ("conditional_edges.see.mapping.abort", 'Write "not_found" for it.'),
        ("conditional_edges.pick", 'Write "failed" for "abort" in the conditional edges of pick.'),
        ("conditional_edges.pick.mapping.abort", 'Write "failed" for it.'),
    }


def test_a_failure_that_ends_well_is_a_note_and_stops_nothing():
    data = plain_workflow()
    data["conditional_edges"]["pick"]["mapping"]["failed"] = "done"
    workflow = parse_workflow(data, "x")
    assert [(f.code, f.severity) for f in validate(workflow, catalog())] == [("W15", "note")]
    require_valid(workflow, catalog())


def test_empty_keys_of_another_type_say_nothing():
    data = plain_workflow()
    data["nodes"]["done"] |= {"inputs": {}, "tool": "", "streaming": False}
    assert validate(parse_workflow(data, "x"), catalog()) == []
    data["nodes"]["done"]["inputs"] = {"x": 1}
    assert [f.code for f in validate(parse_workflow(data, "x"), catalog())] == ["W2"]


def test_an_index_from_the_back_is_refused_with_what_is_allowed():
    finding = only(
        LOOK
        + """sg.add_node("find", type="script", script="scripts/perceive.py",
        inputs={"cameras": Ref("look.cameras.-1"), "object_name": "soup"})"""
    )
    assert finding.code == "D3" and "'-1'" in finding.message and "look.cameras.0" in finding.hint


def test_only_the_loop_without_a_budget_is_named():
    data = plain_workflow()
    routes = data["conditional_edges"]
    routes["see"]["mapping"]["not_found"] = "see"
    routes["pick"]["mapping"]["failed"] = "pick"
    data["nodes"]["pick"]["max_visits"] = 2
    del data["nodes"]["abort"]
    (finding,) = validate(parse_workflow(data, "x"), catalog())
    assert (finding.code, finding.path) == ("W14", "nodes.see") and finding.message.startswith("see can go round")
