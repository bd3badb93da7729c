"""Dry runs: any graph runs through without a world."""

from __future__ import annotations

import pytest

from gap_runtime.contracts.encoding.codec import from_plain, to_plain
from gap_runtime.contracts.types import CONTRACT_TYPES
from gap_runtime.contracts.types.typeref import TypeRef
from gap_runtime.run.dry import dry
from gap_runtime.run.execute import RunSetup, run_graph
from gap_runtime.run.placeholders import PLACEHOLDER, placeholder
from gap_runtime.testing import compile_fake, fake_workflow


@pytest.mark.parametrize("name", sorted(CONTRACT_TYPES))
def test_every_contract_type_can_be_made_up_and_survives_the_codec(name):
    value = placeholder(TypeRef(name))
    assert isinstance(value, CONTRACT_TYPES[name])
    assert from_plain(to_plain(value), TypeRef(name)) == value


def test_lists_have_an_item_and_anything_stays_anything():
    assert len(placeholder(TypeRef("Mask", is_list=True))) == 1
    assert PLACEHOLDER.a.b[3] is PLACEHOLDER


def ref(text):
    return {"$ref": text}


def everything(tmp_path):
    """A graph with a choice, a fan-out, a stream, an actuator and an inline script."""
    (tmp_path / "scripts").mkdir(exist_ok=True)
    for name, source in {
        "route": "def run(ctx, seen: list) -> list[dict]:\n    raise SystemExit\n",
        "collect": "def run(ctx, sums: list[dict]) -> str:\n    raise SystemExit\n",
    }.items():
        (tmp_path / "scripts" / f"{name}.py").write_text(source)
    return fake_workflow(
        {
            "track": {"type": "tool", "tool": "fake.Ticker", "streaming": True},
            "look": "fake.Look",
            "add": {"type": "tool", "tool": "fake.Add", "inputs": {"a": ref("look.stamp")}},
            "left": {"type": "tool", "tool": "fake.Echo", "inputs": {"value": ref("track")}},
            "right": {"type": "tool", "tool": "fake.Echo", "inputs": {"value": ref("in.observation_stream")}},
            "route": {"type": "router", "script": "scripts/route.py", "inputs": {"seen": [ref("look")]}},
            "each": {"type": "tool", "tool": "fake.Add"},
            "collect": {"type": "script", "script": "scripts/collect.py", "inputs": {"sums": ref("route")}},
            "move": "fake.Move",
        },
        [("START", "track"), ("START", "look"), ("look", "add"), ("left", "route"), ("right", "route"),
         ("each", "collect"), ("collect", "move"), ("move", "done")],
        conditional_edges={
            "add": {"router_field": "positive", "mapping": {"true": "left", "false": "right"}},
            "route": {"mapping": {"each": "each"}},
        },
        outputs={"end": ref("collect")},
    )  # fmt: skip


def test_a_graph_with_everything_in_it_runs_dry(tmp_path):
    graph = compile_fake(everything(tmp_path), folder=tmp_path)
    ways = set()
    for seed in range(8):
        seen = []
        result = run_graph(dry(graph, seed=seed), RunSetup(), [seen.append])
        assert result.status == "success", result.error
        paths = [e.path for e in seen if e.kind == "node_finished"]
        assert paths.count("main/each") == 2
        ways.add("main/left" in paths)
    assert ways == {True, False}


def test_a_dry_run_is_a_function_of_its_seed(tmp_path):
    graph = compile_fake(everything(tmp_path), folder=tmp_path)

    def paths(seed):
        seen = []
        run_graph(dry(graph, seed=seed), RunSetup(), [seen.append])
        return [(e.kind, e.path) for e in seen if e.path != "main/track"]

    assert paths(3) == paths(3)
    assert len({str(paths(seed)) for seed in range(8)}) > 1


def test_checkpoints_are_not_asked_for_in_a_dry_run(tmp_path):
    w = everything(tmp_path).model_copy(update={"meta": {"validate_checkpoints": "true"}})
    assert run_graph(dry(compile_fake(w, folder=tmp_path)), RunSetup()).status == "success"
