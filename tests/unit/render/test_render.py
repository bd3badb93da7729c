"""Mermaid, tree, trace and page: everything is there, nothing escapes, nothing is fetched."""

from __future__ import annotations

import io
import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from rich.console import Console

from gap_cli.render.mermaid import mermaid
from gap_cli.render.page import page
from gap_cli.render.preview import preview
from gap_cli.render.timeline import MAX_PICTURED, Tracer, read_timeline
from gap_cli.render.tree import tree
from gap_runtime.contracts.types import DepthImage, Image, Mask, PointCloud, Vec3
from gap_runtime.graph.model import Workflow
from gap_runtime.run.execute import RunSetup, run_graph
from gap_runtime.testing import FakeCell, compile_fake, fake_workflow

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


def ref(text):
    return {"$ref": text}


def workflow(last="fake.Echo"):
    return fake_workflow(
        {
            "look": "fake.Look",
            "add": {"type": "tool", "tool": "fake.Add", "inputs": {"a": 1, "b": 2}},
            "yes": {"type": "tool", "tool": last, "inputs": {"value": ref("look")} if last == "fake.Echo" else {}},
            "no": {"type": "noop"},
            "track": {"type": "tool", "tool": "fake.Ticker", "streaming": True},
        },
        [("START", "look"), ("START", "track"), ("look", "add"), ("yes", "done"), ("no", "done")],
        conditional_edges={"add": {"router_field": "positive", "mapping": {"true": "yes", "false": "no"}}},
        recovery=[{"tool": "fake.Grip", "inputs": {"width": 0.08}}],
    )


def traced(w):
    tracer = Tracer()
    graph = compile_fake(w)
    run_graph(graph, RunSetup(cell=FakeCell(), seed=4), [tracer])
    return graph, json.loads(json.dumps(tracer.rows))


def test_a_timeline_is_what_happened():
    _, rows = traced(workflow())
    timeline = read_timeline(rows)
    assert (timeline.status, timeline.end, timeline.seed, timeline.exits) == (
        "success",
        "success",
        4,
        {"main": ["done"]},
    )
    assert {v.path: v.status for v in timeline.visits} == dict.fromkeys(
        ["main/look", "main/add", "main/yes", "main/done", "main/track"], "finished"
    )
    add = timeline.latest["main/add"]
    assert add.data["inputs"]["fields"] == {"a": 1.0, "b": 2.0} and add.data["output"]["fields"]["total"] == 3.0
    assert all(v.end >= v.start for v in timeline.visits)


def test_a_failed_run_keeps_the_error():
    timeline = read_timeline(traced(workflow("fake.Fail"))[1])
    assert timeline.status == "failure" and timeline.latest["main/yes"].error == "no luck"
    assert "abort/00.fake.Grip" in timeline.latest


def test_tool_calls_inside_scripts_are_part_of_the_timeline(tmp_path):
    file = tmp_path / "s.py"
    file.write_text(
        "def run(ctx) -> float:\n    return ctx.tool('fake.Add', a=1).total + ctx.tool('fake.Add', a=2).total\n"
    )
    w = fake_workflow({"s": {"type": "script", "script": "scripts/s.py"}}, [("START", "s"), ("s", "done")])
    tracer = Tracer()
    run_graph(compile_fake(w, canonical={"scripts/s.py": file}), RunSetup(), [tracer])
    calls = read_timeline(json.loads(json.dumps(tracer.rows))).latest["main/s"].data["calls"]
    assert [(c["tool"], c["inputs"]["fields"]["a"], c["output"]["fields"]["total"]) for c in calls] == [
        ("fake.Add", 1.0, 1.0), ("fake.Add", 2.0, 2.0),
    ]  # fmt: skip


def test_mermaid_has_every_node_and_every_link_once():
    text = mermaid(workflow())
    for node in ("look", "add", "yes", "no", "track", "done"):
        assert len(re.findall(rf"^    n_main__{node}[\[(]", text, re.M)) == 1
    assert "n_main__add -->|true| n_main__yes" in text and "n_main -->|failed| n_abort" in text
    links = re.findall(r"^ *(\S+ --.*)$", text, re.M)
    assert len(links) == len(set(links)) == 8, links
    assert text.count("subgraph ") == text.count("\n  end\n") == 1


def test_mermaid_survives_names_that_mean_something_to_it():
    w = fake_workflow(
        {"end": "fake.Nothing", "graph": {"type": "noop"}}, [("START", "end"), ("end", "graph"), ("graph", "done")]
    )
    assert "n_main__end --> n_main__graph" in mermaid(w)


def rendered(w, timeline=None):
    console = Console(width=120, no_color=True, file=io.StringIO())
    console.print(tree(w, timeline))
    return console.file.getvalue()


def test_the_tree_reads_in_the_order_of_control_and_shows_how_it_went():
    lines = rendered(workflow(), read_timeline(traced(workflow("fake.Fail"))[1])).splitlines()
    order = [next(i for i, line in enumerate(lines) if f" {n}  " in line) for n in ("look", "add", "yes")]
    assert order == sorted(order)
    assert "✗ yes" in lines[order[2]] and "no luck" in lines[order[2]] and "✓ look" in lines[order[0]]


def test_values_are_shown_in_short():
    assert preview(Vec3(1, 2, 3))["fields"] == {"x": 1, "y": 2, "z": 3}
    assert "float64 1000x3" in preview(PointCloud(np.zeros((1000, 3))))["fields"]["points"]["text"]
    assert preview(np.arange(3))["items"] == [0, 1, 2]
    assert preview("x" * 1000).endswith("...") and len(preview("x" * 1000)) < 500
    assert preview(list(range(100)))["text"] == "100 items"
    assert (
        preview({"a": {"b": {"c": {"d": {"e": 1}}}}})["fields"]["a"]["fields"]["b"]["fields"]["c"]["fields"]["d"][
            "text"
        ]
        == "..."
    )
    assert preview(float("nan")) == "nan"


@pytest.mark.parametrize(
    "value",
    [Image(np.zeros((480, 640, 3), np.uint8)), Mask(np.ones((4, 6), bool)), DepthImage(np.zeros((4, 6), np.float32)),
     DepthImage(np.full((4, 6), np.nan, np.float32)), DepthImage(np.linspace(0.5, 2, 24).reshape(4, 6))],
)  # fmt: skip
def test_pictures_become_thumbnails(value):
    shown = preview(value)
    assert shown["image"].startswith("data:image/jpeg;base64,") and len(shown["image"]) < 20_000
    assert "image" not in preview(value, pictures=False)


def test_a_long_trace_stops_taking_pictures():
    _, rows = traced(workflow())
    assert "image" in json.dumps(rows)
    tracer = Tracer()
    tracer.rows += [{}] * MAX_PICTURED
    run_graph(compile_fake(workflow()), RunSetup(cell=FakeCell()), [tracer])
    assert "image" not in json.dumps(tracer.rows[MAX_PICTURED:])


def test_the_page_needs_no_network_and_carries_the_scripts():
    _, rows = traced(workflow())
    html = page(workflow(), {"scripts/x.py": "def run(ctx) -> None: ..."}, read_timeline(rows), title="A & B")
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", html) and "@import" not in html
    assert "<title>A &amp; B</title>" in html and "def run(ctx)" in html


NASTY = "</script><script>document.title='stolen'</script>"


def nasty():
    data = workflow().model_dump()
    data["meta"] = {"name": NASTY, "description": NASTY}
    data["subgraphs"]["main_sg"]["nodes"]["add"]["inputs"]["a"] = 1.0
    data["subgraphs"]["main_sg"]["nodes"]["yes"]["inputs"] = {"value": NASTY}
    data["subgraphs"]["main_sg"]["nodes"]["yes"]["description"] = NASTY
    return Workflow.load(data, "nasty")


def test_nothing_in_a_graph_can_escape_into_the_page():
    w = nasty()
    _, rows = traced(w)
    html = page(w, {"scripts/x.py": NASTY}, read_timeline(rows), title=NASTY)
    assert html.count("</script>") == 2 and NASTY not in html


def dom(tmp_path, html):
    file = tmp_path / "view.html"
    file.write_text(html, encoding="utf-8")
    command = [
        CHROMIUM,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--virtual-time-budget=2000",
        "--dump-dom",
        file.as_uri(),
    ]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout


@pytest.mark.skipif(CHROMIUM is None, reason="no browser here")
@pytest.mark.parametrize("last, panel", [("fake.Echo", "The graph"), ("fake.Fail", "no luck")])
def test_a_real_browser_draws_lanes_and_opens_what_failed(tmp_path, last, panel):
    _, rows = traced(workflow(last))
    shown = dom(tmp_path, page(workflow(last), {}, read_timeline(rows)))
    body = shown.partition('<script type="application/json"')[0]
    assert panel in body.partition('id="panel"')[2]
    assert len(re.findall(r'class="lane ', body)) == len({v.path for v in read_timeline(rows).visits}) + 1
    assert re.search(r'class="node tool finished[^"]*" data-path="main/look"', body)


@pytest.mark.skipif(CHROMIUM is None, reason="no browser here")
def test_a_real_browser_runs_none_of_what_a_graph_smuggles_in(tmp_path):
    _, rows = traced(nasty())
    assert "<title>stolen" not in dom(tmp_path, page(nasty(), {"scripts/x.py": NASTY}, read_timeline(rows)))


def test_a_page_without_a_run_shows_the_graph_alone():
    html = page(workflow(), {})
    assert 'data-path="main/look"' in html and 'id="time"' not in html
