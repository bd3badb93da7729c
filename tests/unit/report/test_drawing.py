from xml.etree import ElementTree

import pytest

from gap_cli.report.drawing import edges, graph_svg
from gap_runtime.graph.dump import dump_workflow
from gap_runtime.graph.model import Workflow
from gap_runtime.testing import fake_workflow

STATS = {"main": {"validation": {"rate": 0.25, "passed": 1, "of": 4}}}


@pytest.fixture
def workflow():
    nodes = {"look": "fake.Look", "act<b>": "fake.Move"}
    recovery = [{"tool": "fake.Grip"}]
    return fake_workflow(nodes, [("START", "look"), ("look", "act<b>"), ("act<b>", "done")], recovery=recovery)


def parse(svg):
    return ElementTree.fromstring(svg)


def test_it_is_well_formed_whatever_the_names(workflow):
    text = " ".join(parse(graph_svg(workflow, {})).itertext())
    for word in ("start", "main", "fake", "look", "fake.Look", "act<b>", "abort", "recover: fake.Grip"):
        assert word in text


def test_boxes_stay_inside_and_apart(workflow):
    root = parse(graph_svg(workflow, STATS))
    _, _, width, height = map(float, root.attrib["viewBox"].split())
    boxes = [[float(r.attrib[k]) for k in ("x", "y", "width", "height")] for r in root.iter("rect")]
    assert len(boxes) == 4
    for i, (x, y, w, h) in enumerate(boxes):
        assert x >= 0 and y >= 0 and x + w <= width and y + h <= height
        for x2, y2, w2, h2 in boxes[i + 1 :]:
            assert x + w <= x2 or x2 + w2 <= x or y + h <= y2 or y2 + h2 <= y


def test_a_failure_of_one_beside_another_is_led_below_it(workflow):
    data = dump_workflow(workflow)
    data["nodes"]["other"] = data["nodes"]["main"]
    data["edges"].append(["START", "other"])
    data["conditional_edges"]["other"] = data["conditional_edges"]["main"]
    root = parse(graph_svg(Workflow.load(data, "fork"), {}))
    tops = {g.find("text").text: g.find("rect").attrib for g in root.iter("g")}
    feet = [float(tops[n]["y"]) + float(tops[n]["height"]) for n in ("main", "other")]
    starts = [float(p.attrib["d"].split()[1]) for p in root.iter("path") if p.attrib.get("class") == "edge fails"]
    assert len(starts) == 2 and sum(y in feet for y in starts) == 1
    assert edges(Workflow.load(data, "fork"))["other", "success"] == "done"


def test_a_subgraph_wears_its_rate(workflow):
    assert "poor" in graph_svg(workflow, STATS) and "1/4" in graph_svg(workflow, STATS)
    assert "poor" not in graph_svg(workflow, {})


def test_every_exit_is_on_an_edge(workflow):
    assert edges(workflow) == {("START", "main"): "", ("main", "success"): "done", ("main", "abort"): "failed"}
