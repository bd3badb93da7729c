"""From a sentence to a validated graph over the real skills and tools: the plan, the code, the workflow."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from gap_cli import author
from gap_cli.author.plans import Plan
from gap_cli.skills import load_bundle, load_library
from gap_cli.skills.library import SkillLibrary
from gap_runtime.contracts.task import load_task
from gap_runtime.errors import (
    DocumentError,
    InstructionError,
    RunError,
    SandboxError,
    UnknownNameError,
    WorkflowError,
)
from gap_runtime.graph.compile import compile_workflow
from gap_runtime.graph.dump import dump_workflow
from gap_runtime.plugins import load_registry
from gap_runtime.run.dry import dry
from gap_runtime.run.execute import RunSetup, run_graph
from tests.unit.author.conftest import make_task
from tests.unit.author.test_understand import PAN, kitchen_with

REGISTRY = load_registry()
LIBRARY = load_library(REGISTRY.skill_paths)
TOOLS = {name: tool.spec for name, tool in REGISTRY.tools.items()}
ONE = "Put the milk in the basket"
TWO = "Put the milk and the ketchup in the basket"


@pytest.fixture(scope="module")
def made():
    task = make_task()
    plan = author.plan(task, TWO, LIBRARY, TOOLS)
    return plan, author.generate(plan, task, LIBRARY, TOOLS)


def route(plan):
    """Segments in the order the success exits lead through them."""
    return [f"{s.skill} {' '.join(s.roles.values())}" for s in plan.content.segments if s.layer is not None]


def test_a_pick_and_place_sees_first_and_acts_after(task):
    assert route(author.plan(task, ONE, LIBRARY, TOOLS)) == [
        "perception-single milk",
        "perception-single basket",
        "grasp-direct-ik milk",
        "transport-to-drop milk basket",
    ]


@pytest.mark.parametrize(
    ("sentence", "target", "container"),
    [
        ("Pack the ketchup into the tray", "ketchup", "tray"),
        ("Please move the bbq sauce to the basket", "bbq_sauce", "basket"),
        ("Grab the catsup and drop it in the basket", "ketchup", "basket"),
    ],
)
def test_another_object_container_and_phrasing_give_the_right_graph(task, sentence, target, container):
    plan = author.plan(task, sentence, LIBRARY, TOOLS)
    workflow = author.generate(plan, task, LIBRARY, TOOLS).workflow
    assert [p.fact for p in plan.goals.predicates()] == [f"in({target}, {container})"]
    looks = [d for d in workflow.subgraphs.values() if d.stage == "perceive"]
    texts = {node.inputs.get("object_name") for d in looks for node in d.nodes.values()}
    assert texts - {None} == {task.objects[target].label, task.objects[container].label}


def test_two_goals_give_one_valid_graph(made):
    plan, generated = made
    assert generated.findings == []
    assert [line.split()[0] for line in route(plan)].count("transport-to-drop") == 2


def started_together(workflow, scripts, folder):
    """The nodes of each super-step of a dry run, from its events."""
    for path, text in scripts.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    canonical = {path: folder / path for path in scripts}
    graph = dry(compile_workflow(workflow, folder, REGISTRY.tools, LIBRARY.contracts, canonical))
    seen, steps = [], [[]]
    result = run_graph(graph, RunSetup(), [seen.append])
    assert result.status == "success", result.error
    for event in seen:
        if event.kind == "node_started":
            steps[-1].append(event.path)
        elif event.kind == "node_finished" and steps[-1]:
            steps.append([])
    return steps


def test_target_and_container_of_a_goal_are_perceived_in_one_super_step(made, tmp_path):
    steps = started_together(made[1].workflow, made[1].scripts, tmp_path)
    both = [["perceive_milk", "perceive_basket"], ["perceive_ketchup", "perceive_basket_2"]]
    for pair in both:
        for node in ("observe", "perceive", "filter_obb"):
            assert sorted(f"{name}/{node}" for name in pair) in steps
    entered = [s[0].partition("/")[0] for s in steps if s]
    assert entered.index("place_milk") < entered.index("perceive_basket_2") < entered.index("grasp_ketchup")


def test_either_perception_failing_is_a_failure_of_the_task(made):
    workflow = made[1].workflow
    looks = [n for n, d in workflow.subgraphs.items() if d.stage == "perceive"]
    assert len(looks) == 8
    for name in looks:
        assert workflow.nodes[workflow.conditional_edges[name].mapping["not_found"]].status == "failure"
    assert sum(source == "START" for source, _ in workflow.edges) == 2
    followed = [b for a, b in workflow.edges if a == "place_milk"]
    assert followed == [b for a, b in workflow.edges if a == "place_milk_2"]
    assert {workflow.subgraphs[b].stage for b in followed} == {"perceive"}
    assert set(workflow.conditional_edges["place_milk"].mapping) == {"failed"}


def test_a_pan_is_filled_like_any_container():
    task = kitchen_with(pan=PAN)
    plan = author.plan(task, "Put the milk in the pan", LIBRARY, TOOLS)
    assert author.generate(plan, task, LIBRARY, TOOLS).findings == []
    assert route(plan)[-1] == "transport-to-drop milk pan"


def test_objects_for_one_container_are_counted(task):
    sentence = "Put the milk in the basket, the ketchup in the tray and the bbq sauce in the basket"
    plan = author.plan(task, sentence, LIBRARY, TOOLS)
    placed = [s for s in plan.content.segments if s.stage == "place" and s.layer is not None]
    counted = [tuple(s.literals.values()) for s in placed]
    assert counted == [(0, 2), (0, 1), (1, 2)]


def test_when_every_way_has_failed_the_end_lets_go_and_goes_home(made):
    workflow = made[1].workflow
    failures = {n: workflow.conditional_edges[n].mapping[d.on_error] for n, d in workflow.subgraphs.items()}
    for start in failures:
        seen, name = [], start
        while name != "abort":
            assert name not in seen
            seen.append(name)
            name = failures[name]
    assert failures["grasp_milk"] == failures["place_milk"] == "retreat_milk"
    assert [c.tool for c in workflow.nodes["abort"].recovery] == ["gripper.Open", "robot_control.GoHome"]


def test_a_recovery_calls_only_tools_that_are_served(task):
    served = {n: t for n, t in TOOLS.items() if n != "robot_control.GoHome"}
    drop = LIBRARY["transport-to-drop"]
    tools = [t for t in drop.contract.tools if t in served]
    contract = drop.contract.model_copy(update={"tools": tools})
    bundles = [b for b in LIBRARY.values() if b is not drop]
    library = SkillLibrary([*bundles, drop.__class__(**{**vars(drop), "contract": contract})])
    assert author.plan(task, ONE, library, served).data["recovery"] == ["gripper.Open"]


def test_checkpoints_speak_of_the_objects_of_their_segment(made):
    files = made[1].checkpoints
    assert 'w.body("ketchup").is_in(w.body("basket"))' in files["place_ketchup"]
    assert "milk" not in files["place_ketchup"]


def test_canonical_scripts_are_copied_and_known_as_such(made, tmp_path):
    generated = made[1]
    for path, text in generated.scripts.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    canonical = LIBRARY.canonical_scripts(generated.workflow, tmp_path)
    assert set(canonical) == set(generated.scripts)
    edited = next(iter(canonical))
    (tmp_path / edited).write_text("def run(ctx) -> None: ...\n")
    assert set(LIBRARY.canonical_scripts(generated.workflow, tmp_path)) == set(canonical) - {edited}


def test_the_same_sentence_gives_the_same_bytes(task, made):
    again = author.plan(task, TWO, LIBRARY, TOOLS)
    plan, generated = made
    assert (again.source, again.markdown, again.data) == (plan.source, plan.markdown, plan.data)
    other = author.generate(again, task, LIBRARY, TOOLS)
    assert json.dumps(dump_workflow(other.workflow)) == json.dumps(dump_workflow(generated.workflow))
    assert other.sources == generated.sources


def test_a_plan_survives_its_file(made, task):
    plan = made[0]
    loaded = Plan.load(json.loads(json.dumps(plan.data)), "plan.json", plan.source)
    assert loaded == plan
    assert author.generate(loaded.data, task, LIBRARY, TOOLS).workflow == made[1].workflow


@pytest.mark.parametrize(
    ("key", "value"), [("segments", []), ("schema", "gap/plan/v9"), ("color", "red"), ("goals", "milk")]
)
def test_a_malformed_plan_names_its_key(made, key, value):
    with pytest.raises(DocumentError, match=rf"plan\.json.*{key}"):
        Plan.load({**made[0].data, key: value})


def test_plan_page_is_for_people(made):
    page = made[0].markdown
    assert "1. `in(milk, basket)`" in page
    assert "| `grasp_ketchup` | Grasp the ketchup | grasp-direct-ik | cost 1; grasp-curobo-obb 1.5" in page
    assert "failed: retreat\\_ketchup" in page


def test_the_scene_named_after_the_first_target_is_preferred(task):
    assert author.plan(task, "Put the ketchup in the basket", LIBRARY, TOOLS).data["scene"] == "ketchup"
    assert author.plan(task, "Put the milk and the ketchup in the tray", LIBRARY, TOOLS).data["scene"] == "ketchup"
    assert author.plan(task, ONE, LIBRARY, TOOLS).data["scene"] == "all"


@pytest.mark.parametrize(
    ("sentence", "says"),
    [
        ("Put the butter in the tray", "The butter and the tray are not together in any scene"),
        ("Put the butter and the milk in the basket", "not together in any scene"),
    ],
)
def test_objects_no_scene_holds_together_are_refused(task, sentence, says):
    with pytest.raises(InstructionError, match=says):
        author.plan(task, sentence, LIBRARY, TOOLS)


def test_an_object_no_scene_holds_is_refused():
    with pytest.raises(InstructionError, match="The milk is not in any scene"):
        author.plan(make_task(scenes={"dairy": {"butter": "near", "basket": "near"}}), ONE, LIBRARY, TOOLS)


def test_an_unknown_author_is_named(task):
    with pytest.raises(UnknownNameError, match="symbolic"):
        author.plan(task, ONE, LIBRARY, TOOLS, author="oracle")


def test_a_tool_nobody_serves_is_named(task):
    served = {n: t for n, t in TOOLS.items() if n != "sam3.SegmentBox"}
    with pytest.raises(InstructionError, match=r"perception-single: no plugin serves its tool sam3\.SegmentBox"):
        author.plan(task, ONE, LIBRARY, served)


def third_party(tmp_path, name, like, **changes):
    """A skill of someone else: a copy of ours under another name with other contract keys."""
    bundle = LIBRARY[like]
    root = tmp_path / name
    for file in bundle.files:
        target = root / file.relative_to(bundle.path)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(file.read_text().replace(f"name: {like}", f"name: {name}"))
    contract = yaml.safe_load((root / "contract.yaml").read_text())
    (root / "contract.yaml").write_text(yaml.safe_dump({**contract, **changes}, sort_keys=False))
    return SkillLibrary([*LIBRARY.values(), load_bundle(root, "theirs")])


def test_a_better_skill_of_someone_else_is_used_without_a_change_here(task, tmp_path):
    library = third_party(tmp_path, "magnet-grasp", "grasp-direct-ik", cost=0.5)
    plan = author.plan(task, ONE, library, TOOLS)
    assert "magnet-grasp milk" in route(plan)
    assert author.generate(plan, task, library, TOOLS).findings == []


def test_a_skill_with_another_way_to_the_goal_shortens_the_plan(task, tmp_path):
    changes = {"needs": ["located(target)", "located(container)"], "cost": 1.5}
    inputs = {k: v for k, v in LIBRARY["transport-to-drop"].contract.inputs.items() if k != "ee_pose_at_grasp"}
    library = third_party(tmp_path, "sweep-into", "transport-to-drop", inputs=inputs, **changes)
    plan = author.plan(task, ONE, library, TOOLS)
    assert [s.skill for s in plan.content.segments][-1] == "sweep-into"
    assert len(plan.content.segments) == 3


def test_generation_fails_closed_on_a_finding(task, tmp_path):
    library = third_party(tmp_path, "bad-grasp", "grasp-direct-ik", cost=0.5, tools=["gripper.Open"])
    plan = author.plan(task, ONE, library, TOOLS)
    with pytest.raises(WorkflowError, match="bad-grasp") as caught:
        author.generate(plan, task, library, TOOLS)
    assert len(caught.value.findings) > 1


def test_hostile_builder_code_in_an_edited_plan_is_stopped(made, task):
    plan = Plan.load(made[0].data, source="import os\nspec = os.system('true')\n")
    with pytest.raises(SandboxError):
        author.generate(plan, task, LIBRARY, TOOLS)


def test_a_topology_that_disagrees_with_its_plan_is_refused(made, task):
    source = made[0].source.replace('"grasp_milk"', '"seize_milk"')
    with pytest.raises(RunError, match=r"'(grasp|seize)_milk' is only in plan/"):
        author.generate(Plan.load(made[0].data, source=source), task, LIBRARY, TOOLS)


GROCERY = load_task(Path(__file__).parents[3] / "tasks" / "fulfill-grocery")


@pytest.mark.parametrize("sentence", GROCERY.instructions)
def test_every_instruction_the_grocery_task_offers_is_served(sentence):
    plan = author.plan(GROCERY, sentence, LIBRARY, TOOLS)
    target = plan.goals.predicates()[0].roles["target"]
    assert plan.data["scene"] == target
    assert route(plan) == [
        f"perception-single {target}",
        "perception-single basket",
        f"grasp-direct-ik {target}",
        f"transport-to-drop {target} basket",
    ]
