"""The published schemas accept what the reader accepts, and refuse what it refuses."""

from __future__ import annotations

import copy
from pathlib import Path

import jsonschema
import pytest

from gap_cli.commands.schema import KINDS, schema_of
from gap_cli.validate.validator import validate
from gap_runtime.contracts.documents import read_yaml
from gap_runtime.errors import UnknownNameError, WorkflowError
from gap_runtime.graph.load import parse_workflow
from tests.unit.validate.kit import catalog, plain_workflow

ROOT = Path(__file__).parents[3]


def accepts(kind, data):
    return jsonschema.Draft202012Validator(schema_of(kind)).is_valid(data)


@pytest.mark.parametrize("kind", KINDS)
def test_it_is_a_schema(kind):
    jsonschema.Draft202012Validator.check_schema(schema_of(kind))


@pytest.mark.parametrize(
    ("kind", "path"),
    [
        *(("contract", p) for p in sorted(ROOT.glob("morsl/*/contract.yaml"))),
        *(("task", p) for p in sorted(ROOT.glob("tasks/*/task.yaml"))),
    ],
    ids=lambda v: v.parent.name if isinstance(v, Path) else v,
)
def test_every_document_of_the_house_fits(kind, path):
    assert accepts(kind, read_yaml(path))


@pytest.mark.parametrize(("shape", "more", "fits"), [
    ({"kind": "box", "size": [1, 1, 1]}, {"mass": 1}, True), ({"kind": "box", "size": [1, 1, 1]}, {}, False),
    ({"kind": "box"}, {"mass": 1}, False), ({"kind": "mesh", "file": "a.stl"}, {"density": 800}, True),
    ({"kind": "mesh", "file": "a.stl"}, {}, False),
    ({"kind": "articulated", "file": "a.xml", "size": [1, 1, 1]}, {}, True),
])  # fmt: skip
def test_what_a_file_says_of_an_object_need_not_be_given(shape, more, fits):
    task = read_yaml(ROOT / "tasks/fulfill-grocery/task.yaml")
    task["objects"]["thing"] = {"label": "thing", "shape": shape, **more}
    assert accepts("task", task) == fits


def test_a_workflow_fits():
    data = plain_workflow()
    assert accepts("workflow", data)
    data["subgraphs"]["pick_sg"]["inputs"]["observation_stream"] = "ObservationStream"
    del data["subgraphs"]["pick_sg"]["on_error"]
    assert accepts("workflow", data)


MUTATIONS = {
    "unknown key": lambda w: w.update(colour="red"),
    "wrong version": lambda w: w.update(version=2),
    "text for a number": lambda w: w["subgraphs"]["pick_sg"]["nodes"]["open"].update(deadline_s="2"),
    "no such stream": lambda w: w["subgraphs"]["pick_sg"]["inputs"].update(observation_stream="Mask"),
    "retired type": lambda w: w["subgraphs"]["pick_sg"]["nodes"]["open"].update(type="service"),
    "end inside": lambda w: w["subgraphs"]["pick_sg"]["nodes"].update(x={"type": "end", "status": "success"}),
    "tool on top": lambda w: w["nodes"].update(x={"type": "tool", "tool": "gripper.Open"}),
    "tool without a tool": lambda w: w["subgraphs"]["pick_sg"]["nodes"]["open"].pop("tool"),
    "key of another type": lambda w: w["nodes"]["pick"].update(status="success"),
    "no exit": lambda w: w["subgraphs"]["pick_sg"].pop("exit"),
    "edge of three": lambda w: w["edges"].append(["see", "pick", "done"]),
    "empty mapping": lambda w: w["conditional_edges"]["see"].update(mapping={}),
    "no such type": lambda w: w["subgraphs"]["pick_sg"]["inputs"].update(target_obb="OrientedBox"),
    "negative deadline": lambda w: w["subgraphs"]["pick_sg"]["nodes"]["open"].update(deadline_s=-1),
}


@pytest.mark.parametrize("mutate", MUTATIONS.values(), ids=MUTATIONS)
def test_schema_and_reader_refuse_alike(mutate):
    data = copy.deepcopy(plain_workflow())
    mutate(data)
    assert not accepts("workflow", data)
    try:
        findings = validate(parse_workflow(data, "it"), catalog())
    except WorkflowError as error:
        findings = error.findings
    assert findings


def test_an_unknown_kind_says_what_there_is():
    with pytest.raises(UnknownNameError, match="workflow"):
        schema_of("workflo")
