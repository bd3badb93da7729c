"""Text is data: whatever stands in a label, an instruction or a skill, it is shown or looked for, and never obeyed."""

from __future__ import annotations

import ast
import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gap_cli import author
from gap_cli.author.plans import Plan
from gap_cli.author.segment import render_checkpoint_file, render_subgraph
from gap_cli.author.skill_check import sample_plan
from gap_cli.sandbox import run_builder
from gap_cli.skills import load_library
from gap_cli.workspace.canonical import json_text, write_yaml
from gap_cli.workspace.run import RunConfig
from gap_runtime.contracts.documents import parse_json, read_yaml
from gap_runtime.errors import InstructionError
from gap_runtime.graph.checkpoints import parse_checkpoints
from gap_runtime.plugins import load_registry
from tests.unit.author.conftest import make_task

LIBRARY = load_library(load_registry().skill_paths)
TOOLS = {name: tool.spec for name, tool in load_registry().tools.items()}
COMPOSITE = [name for name, bundle in LIBRARY.items() if bundle.contract.kind == "composite"]
INJECTED = (
    '"', "'", '"""', "'''", "\\", "\n", "\r", "\0", "\u2028", "{{ 7 * 7 }}", "{% endfor %}", "{#", "#}", "`", "|",
    "<b>", '"""\nimport os\n"""', '")\nspec.add_edge("a", "b")\n("', "\\N{DASH}", "é", "牛奶", "🥛", "\ud800",
)  # fmt: skip
hostile = st.lists(st.sampled_from(INJECTED) | st.text(max_size=4), max_size=6).map("".join)


def shape(source):
    """The code with every text in it taken out: what it does, whatever it is about."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            node.value = ""
    return ast.dump(tree)


def texts(source):
    return [n.value for n in ast.walk(ast.parse(source)) if isinstance(n, ast.Constant) and isinstance(n.value, str)]


def told(name, text):
    """A sample plan of one skill in which everything that people write is `text`."""
    content = sample_plan(LIBRARY[name])[0].content
    segment = content.segments[0]
    given = {"string": text, "string[]": [text]}
    literals = {k: given.get(LIBRARY[name].contract.literals[k], v) for k, v in segment.literals.items()}
    segment = segment.model_copy(update={"description": text, "literals": literals, "on_error": text})
    changes = {"task": text, "instruction": text, "variant": text, "scene": text, "segments": [segment]}
    return Plan.of(content.model_copy(update=changes))


@given(hostile)
@settings(deadline=None)
def test_text_does_not_change_what_a_topology_says(text):
    plan = told("perception-single", text)
    assert shape(plan.source) == shape(told("perception-single", "milk").source)
    assert texts(plan.source).count(text) >= 4


@pytest.mark.parametrize("name", COMPOSITE)
@given(hostile)
@settings(max_examples=25, deadline=None)
def test_text_does_not_change_what_a_subgraph_does(name, text):
    source = render_subgraph(told(name, text).content.segments[0], LIBRARY[name])
    assert shape(source) == shape(render_subgraph(told(name, "milk").content.segments[0], LIBRARY[name]))
    words = [type_ for type_ in LIBRARY[name].contract.literals.values() if type_.startswith("string")]
    assert texts(source).count(text) >= 2 + len(words)


@given(hostile)
@settings(max_examples=10, deadline=None)
def test_text_comes_out_of_the_sandbox_as_it_went_in(text):
    text = text.encode("utf-8", "replace").decode()
    built = run_builder(told("perception-any", text).source, expect="spec")
    assert built["def"]["meta"].get("description", "") == text
    assert built["def"]["subgraphs"]["sample"].get("description", "") == text


@given(hostile)
@settings(deadline=None)
def test_a_label_in_a_checkpoint_is_data(text):
    bundle = LIBRARY["perception-single"]
    segment = sample_plan(bundle)[0].content.segments[0]
    points = parse_checkpoints(render_checkpoint_file(segment, bundle, {"some_name": text}), "checkpoints.py")
    assert [p.name for p in points] == ["in_place"]


@given(hostile)
@settings(deadline=None)
def test_the_page_of_a_plan_shows_text_as_text(text):
    page = told("perception-single", text).markdown
    plain = told("perception-single", "milk").markdown
    assert page.count("\n") == plain.count("\n")
    rows = [line.replace("\\|", "") for line in page.splitlines() if line.startswith("|")]
    assert {row.count("|") for row in rows} == {9}


ODD = ("", "“", "”", "'", '"', "\t", "\n", "\r\n", "  ", "«", "\u00a0", "\v")


@given(st.lists(st.sampled_from(ODD), min_size=8, max_size=8), hostile)
@settings(max_examples=50, deadline=None)
def test_an_instruction_that_is_accepted_is_read_again(tmp_path_factory, odd, label):
    said = "{}Put{} the{} milk{} in{} the{} basket{}.{}".format(*odd)
    base = make_task()
    milk = base.objects["milk"].model_copy(update={"label": label.encode("utf-8", "replace").decode()})
    task = base.model_copy(update={"objects": {**base.objects, "milk": milk}})
    try:
        plan = author.plan(task, said, LIBRARY, TOOLS)
    except InstructionError:
        return
    file = tmp_path_factory.mktemp("run") / "run.yaml"
    asked = RunConfig(task="kitchen", instruction=said)
    write_yaml(file, asked.model_dump(by_alias=True))
    assert RunConfig.load(read_yaml(file), "run.yaml") == asked
    assert Plan.load(parse_json(json_text(plan.data), "plan.json")) == plan


@pytest.mark.parametrize("hidden", ["\v", "\x1b[2J", "\0", "\u200b", "\u202e", "\ufeff", "\udc80"])
def test_what_nobody_can_see_is_refused_when_the_instruction_is_read(task, hidden):
    with pytest.raises(InstructionError, match="invisible character"):
        author.plan(task, f"Put the milk {hidden}in the basket", LIBRARY, TOOLS)


def test_an_instruction_is_never_cut_short(task):
    said = "Put the milk in the basket" + ", the milk" * 300 + " and put the pepsi in the fridge"
    with pytest.raises(InstructionError, match=rf"has {len(said)} characters"):
        author.plan(task, said, LIBRARY, TOOLS)


def test_quotation_marks_in_an_instruction_are_data(task):
    plan = author.plan(task, 'Put the "milk" in the "basket"', LIBRARY, TOOLS)
    assert author.generate(plan, task, LIBRARY, TOOLS).workflow.meta["description"] == 'Put the "milk" in the "basket"'
    assert json.loads(json_text(plan.goals.data))["goals"][0]["roles"] == {"target": "milk", "container": "basket"}
