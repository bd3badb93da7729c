"""No input, however mangled, gives more than one clear error, and none takes long."""

from __future__ import annotations

import copy
import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gap_cli.validate.validator import validate
from gap_runtime.contracts.documents import parse_json
from gap_runtime.errors import DocumentError, GapError, WorkflowError
from gap_runtime.graph.load import load_workflow, parse_workflow
from tests.unit.validate.kit import WorkflowSpec, assemble, catalog, declare, pick_sg, plain_workflow, see_sg

GOOD = json.dumps(plain_workflow())


def judge(text):
    """Load and validate; the codes of the findings, or the error."""
    try:
        return [f.code for f in validate(parse_workflow(parse_json(text, "it"), "it"), catalog())]
    except WorkflowError as error:
        assert all(f.code and f.path and f.message for f in error.findings)
        return [f.code for f in error.findings]
    except GapError as error:
        assert error.message
        return error


def test_the_good_one_is_good():
    assert judge(GOOD) == []


NOT_JSON = {
    "empty": "", "space": " ", "cut": GOOD[: len(GOOD) // 2], "trailing comma": GOOD[:-1] + ",}",
    "comment": "// x\n" + GOOD, "two": GOOD + GOOD, "NaN": GOOD.replace("3", "NaN", 1),
    "infinite": GOOD.replace("3", "1e999", 1), "minus infinity": GOOD.replace("3", "-Infinity", 1),
    "duplicate key": '{"version": 3, "version": 3}', "deep": "[" * 10_000 + "]" * 10_000, "BOM": "\ufeff" + GOOD,
    "long int": '{"version": ' + "9" * 5000 + "}", "single quotes": GOOD.replace('"', "'"),
}  # fmt: skip


@pytest.mark.parametrize("text", NOT_JSON.values(), ids=NOT_JSON)
def test_what_is_not_json_is_one_error(text):
    assert isinstance(judge(text), DocumentError)


@pytest.mark.parametrize("text", ["null", "[]", '"x"', "3", "true", "{}", '{"nodes": 3}', '{"nodes": {"a": null}}'])
def test_what_is_not_a_workflow_is_refused(text):
    assert judge(text)


@pytest.mark.parametrize("name", ["", "a" * 10_000, "__proto__.x", "a.b", "START", "in", "a b", "é", "1", "\u202e"])
def test_strange_names_are_named(name):
    data = plain_workflow()
    data["subgraphs"]["pick_sg"]["nodes"][name] = {"type": "noop"}
    assert "W5" in judge(json.dumps(data))


EXTREMES = {
    "nodes": {f"n{i}": {"type": "noop"} for i in range(100_000)},
    "edges": [["open", "done"]] * 10_000,
    "inputs": {f"x{i}": "Mask" for i in range(10_000)},
    "outputs": {f"x{i}": 1 for i in range(10_000)},
    "exit": {"success_values": [f"x{i}" for i in range(10_000)]},
    "conditional_edges": {"open": {"router_field": "x", "mapping": {str(i): "done" for i in range(10_000)}}},
}


@pytest.mark.parametrize("part", EXTREMES)
def test_too_many_of_anything_is_refused_before_it_costs(part):
    data = plain_workflow()
    data["subgraphs"]["pick_sg"][part] = EXTREMES[part]
    found = judge(json.dumps(data))
    assert "W6" in found
    assert len(found) < 10


def test_too_many_subgraphs_are_refused():
    data = plain_workflow()
    data["subgraphs"] = {f"s{i}": data["subgraphs"]["see_sg"] for i in range(3000)}
    assert "W6" in judge(json.dumps(data))


def test_retired_types_and_other_faults_of_shape_come_together():
    data = plain_workflow()
    data["subgraphs"]["pick_sg"]["nodes"]["open"] = {
        "type": "service",
        "service": "gripper.v1.Gripper",
        "method": "Open",
    }
    data["subgraphs"]["see_sg"]["skil"] = "see"
    assert judge(json.dumps(data)) == ["W2", "W1"]


def findings_of(data):
    with pytest.raises(WorkflowError) as error:
        parse_workflow(data, "it")
    return error.value.findings


@pytest.mark.parametrize(("version", "hint"), [
    (2, "begin -> an edge from START"), ("3", "Write 3, without quotes."), (True, '"version": 3'), (4, '"version": 3'),
])  # fmt: skip
def test_another_version_is_the_only_thing_said(version, hint):
    (finding,) = findings_of({"version": version, "begin": "x", "states": {"x": {"type": "service"}}})
    assert (finding.path, finding.code) == ("version", "W3") and hint in finding.hint


@pytest.mark.parametrize(("key", "value", "hint"), [
    ("max_visits", "2", "Write 2, without quotes."), ("deadline_s", "2.5", "Write 2.5, without quotes."),
    ("streaming", "true", "Write true, without quotes."), ("description", 3, 'Write "3", in quotes.'),
    ("max_visits", "two", ""), ("streaming", 1, ""),
])  # fmt: skip
def test_text_is_no_number_and_a_number_no_text(key, value, hint):
    data = plain_workflow()
    data["subgraphs"]["pick_sg"]["nodes"]["open"][key] = value
    (finding,) = findings_of(data)
    assert (finding.code, finding.path.rpartition(".")[2], finding.hint) == ("W1", key, hint)


@pytest.mark.parametrize(("parent", "key"), [
    ("subgraphs.pick_sg", "skill"), ("subgraphs.pick_sg", "exit"), ("subgraphs.pick_sg.exit", "success_values"),
    ("subgraphs.pick_sg.nodes.open", "type"), ("conditional_edges.pick", "mapping"), ("", "nodes"), ("", "subgraphs"),
])  # fmt: skip
def test_a_key_that_is_missing_is_given_as_the_line_to_add(parent, key):
    data = plain_workflow()
    place = data
    for name in filter(None, parent.split(".")):
        place = place[name]
    del place[key]
    (finding,) = findings_of(data)
    assert finding.message == "is missing" and finding.hint.startswith(f'Add "{key}": ')


def test_depth_is_refused_wherever_it_comes_from():
    data, deep = plain_workflow(), []
    for _ in range(10_000):
        deep = [deep]
    data["subgraphs"]["pick_sg"]["nodes"]["open"]["inputs"] = {"x": deep}
    with pytest.raises(DocumentError, match="nested"):
        parse_workflow(data, "it")


@pytest.mark.parametrize("value", [float("nan"), float("inf"), {1: 2}, object(), b"x", {1, 2}])
def test_python_values_no_file_holds_are_refused(value):
    data = plain_workflow()
    data["subgraphs"]["pick_sg"]["nodes"]["open"]["inputs"] = {"arm_id": value}
    with pytest.raises(DocumentError):
        parse_workflow(data, "it")


def test_a_file_of_a_hundred_megabytes_is_not_read(tmp_path):
    path = tmp_path / "workflow.json"
    with path.open("wb") as file:
        file.truncate(100_000_000)
    with pytest.raises(DocumentError, match="larger"):
        load_workflow(path)


@settings(max_examples=150, deadline=None)
@given(st.integers(0, len(GOOD)), st.integers(0, 40), st.text(max_size=12))
def test_any_cut_and_any_paste_ends_in_findings_or_one_error(at, drop, paste):
    judge(GOOD[:at] + paste + GOOD[at + drop :])


JUNK = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**70), 2**70) | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=8) | st.sampled_from(["START", "END", "open", "done", "$ref", "pick_sg", "in.target_obb"]),
    lambda inner: st.lists(inner, max_size=4)
    | st.dictionaries(st.text(max_size=6) | st.just("$ref"), inner, max_size=4),
    max_leaves=12,
)  # fmt: skip


def spots(data, path=()):
    """Every place in plain data."""
    yield path
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        yield from spots(value, (*path, key))


SPOTS = [s for s in spots(plain_workflow()) if s]


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(SPOTS), JUNK)
def test_junk_anywhere_ends_in_findings_or_one_error(spot, junk):
    data = copy.deepcopy(plain_workflow())
    place = data
    for key in spot[:-1]:
        place = place[key]
    place[spot[-1]] = junk
    try:
        found = validate(parse_workflow(data, "it"), catalog())
    except GapError:
        return
    assert all(f.code and f.path and f.message for f in found)


BUILT = {s.name: s.to_dict() for s in (see_sg(), pick_sg('sg.add_node("open", type="tool", tool="gripper.Open")'))}


def topology():
    spec = WorkflowSpec("example")
    for sg in (see_sg(), pick_sg('sg.add_node("open", type="tool", tool="gripper.Open")')):
        declare(spec, sg)
    return spec.to_dict()


PARTS = {"spec": topology(), "subgraphs": BUILT}


@settings(max_examples=200, deadline=None)
@given(st.sampled_from([s for s in spots(PARTS) if len(s) > 1 and "lines" not in s]), JUNK)
def test_junk_from_a_sandbox_ends_in_findings_or_one_error(spot, junk):
    parts = copy.deepcopy(PARTS)
    place = parts
    for key in spot[:-1]:
        place = place[key]
    place[spot[-1]] = junk
    try:
        validate(assemble(parts["spec"], parts["subgraphs"]), catalog())
    except GapError as error:
        assert error.message
