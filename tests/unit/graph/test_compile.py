"""Compiling: what is missing is named at once, what is known is settled now."""

from __future__ import annotations

from pathlib import Path

import pytest

from gap_runtime.contracts.failures import (
    BadRequestError,
    DocumentError,
    GapError,
    PrivilegedReadError,
    UnknownNameError,
)
from gap_runtime.contracts.skill import Exits, SkillContract
from gap_runtime.contracts.tool import tool
from gap_runtime.contracts.types import Vec3
from gap_runtime.graph.compile import compile_workflow
from gap_runtime.run.execute import RunSetup, run_graph
from gap_runtime.testing import compile_fake, fake_skill, fake_tools, fake_workflow

CHAIN = [("START", "a"), ("a", "done")]


def one(node, **definition):
    return fake_workflow({"a": node}, CHAIN, **definition)


@pytest.mark.parametrize(
    "node, error, says",
    [
        ("fake.Ad", UnknownNameError, "fake.Add"),
        ({"type": "tool", "tool": "fake.Add", "inputs": {"a": "x"}}, BadRequestError, "main/a.a"),
        ({"type": "tool", "tool": "fake.Add", "inputs": {"q": 1}}, DocumentError, "'q'"),
        ({"type": "tool", "tool": "fake.Add", "inputs": {"a": {"$ref": "b.x"}}}, UnknownNameError, "node"),
        ({"type": "tool", "tool": "fake.Add", "inputs": {"a": {"$ref": "in.x"}}}, UnknownNameError, "input"),
        ({"type": "tool", "tool": "fake.Add", "inputs": {"a": {"$ref": "param.x"}}}, UnknownNameError, "parameter"),
        ({"type": "script", "script": "scripts/no.py"}, DocumentError, "no such file"),
        ({"type": "end"}, DocumentError, "'end'"),
    ],
)
def test_what_is_not_there_is_named(node, error, says):
    with pytest.raises(error) as caught:
        compile_fake(one(node))
    assert says in str(caught.value)


def test_an_unknown_skill_is_named():
    with pytest.raises(UnknownNameError, match="fake"):
        compile_fake(one("fake.Nothing", skill="fakee"))


@pytest.mark.parametrize("recovery", [False, True])
def test_a_privileged_tool_is_refused_in_a_graph_and_in_a_recovery(recovery):
    @tool("fake.Truth", privileged=True)
    def truth() -> None:
        """Reads ground truth."""

    w = (
        fake_workflow({"a": "fake.Nothing"}, CHAIN, recovery=[{"tool": "fake.Truth"}])
        if recovery
        else one("fake.Truth")
    )
    with pytest.raises(PrivilegedReadError, match=r"fake\.Truth"):
        compile_fake(w, truth)


def test_the_papers_spelling_of_a_skill_resolves():
    tools = fake_tools()
    w = one("fake.Nothing", skill="pick_up")
    assert compile_workflow(w, Path(), tools, {"pick-up": fake_skill()}, {}).nodes


def test_without_on_error_a_subgraph_fails_as_its_skill_does():
    w = one("fake.Nothing")
    bare = w.model_copy(
        update={"subgraphs": {n: d.model_copy(update={"on_error": ""}) for n, d in w.subgraphs.items()}}
    )
    assert [n.subgraph.on_error for n in compile_fake(bare).nodes if n.subgraph] == [fake_skill().exits.failure]


def test_a_script_that_cannot_be_loaded_says_why(tmp_path):
    for source, says in (
        ("def run(ctx) -> None:\n  pass\nimport nonsense_module\n", "ModuleNotFoundError"),
        ("x = 1\n", "no function run"),
    ):
        file = tmp_path / "s.py"
        file.write_text(source)
        with pytest.raises(GapError, match=says):
            compile_fake(one({"type": "script", "script": "scripts/s.py"}), canonical={"scripts/s.py": file})


def test_literals_get_their_types_before_anything_runs():
    @tool("fake.Where")
    def where(point: Vec3) -> float:
        """How high."""
        return point.z

    graph = compile_fake(
        one({"type": "tool", "tool": "fake.Where", "inputs": {"point": {"x": 0, "y": 0, "z": 2}}}), where
    )
    (node,) = [n for n in graph.inner_nodes() if n.name == "a"]
    assert node.constants["point"] == Vec3(0.0, 0.0, 2.0)


def test_the_effect_of_a_script_is_the_most_its_tools_do(tmp_path):
    for calls, effect in (("fake.Add", "pure"), ("fake.Look", "sense"), ("fake.Grip", "actuate")):
        file = tmp_path / "s.py"
        file.write_text(f"def run(ctx) -> None:\n    ctx.tool({calls!r})\n")
        graph = compile_fake(one({"type": "script", "script": "scripts/s.py"}), canonical={"scripts/s.py": file})
        assert next(n for n in graph.inner_nodes() if n.name == "a").effect == effect


def test_a_computed_tool_name_may_be_anything_the_skill_may_do(tmp_path):
    file = tmp_path / "s.py"
    file.write_text("def run(ctx, t: str) -> None:\n    ctx.tool(t)\n")
    node = {"type": "script", "script": "scripts/s.py", "inputs": {"t": "fake.Add"}}
    effects = {}
    for tools in (["fake.Add"], ["fake.Add", "fake.Grip"]):
        graph = compile_fake(one(node), canonical={"scripts/s.py": file}, tools=tools)
        effects[len(tools)] = next(n for n in graph.inner_nodes() if n.name == "a").effect
    assert effects == {1: "pure", 2: "actuate"}


def test_an_arm_named_in_the_inputs_is_known_before_the_run():
    graph = compile_fake(one({"type": "tool", "tool": "fake.Move", "inputs": {"arm_id": 1}}))
    assert next(n for n in graph.inner_nodes() if n.name == "a").resources == ("arm:1",)


def test_an_atomic_skill_is_called_like_a_tool(tmp_path):
    file = tmp_path / "twice.py"
    file.write_text("def run(ctx, x: float) -> float:\n    return ctx.tool('fake.Add', a=x, b=x).total\n")
    atomic = SkillContract(kind="atomic", exits=Exits(success={"ok": "ok"}, failure="failed"), tools=["fake.Add"])
    skills = {"fake": fake_skill(["twice-it"]), "twice-it": atomic}
    w = one({"type": "tool", "tool": "twice_it", "inputs": {"x": 4}}, outputs={"o": {"$ref": "a"}})
    seen = []
    run_graph(compile_workflow(w, Path(), fake_tools(), skills, {"twice-it": file}), RunSetup(), [seen.append])
    assert seen[-2].data["outputs"] == {"o": 8.0}


def test_a_script_may_call_an_atomic_skill_its_contract_spells_the_papers_way(tmp_path):
    files = {n: tmp_path / f"{n}.py" for n in ("twice", "main")}
    files["twice"].write_text("def run(ctx, x: float) -> float:\n    return ctx.tool('fake.Add', a=x, b=x).total\n")
    files["main"].write_text("def run(ctx) -> float:\n    return ctx.tool('twice_it', x=3)\n")
    atomic = SkillContract(kind="atomic", exits=Exits(success={"ok": "ok"}, failure="failed"), tools=["fake.Add"])
    skills = {"fake": fake_skill(tools=["twice_it"]), "twice-it": atomic}
    w = one({"type": "script", "script": "scripts/main.py"}, outputs={"o": {"$ref": "a"}})
    canonical = {"twice-it": files["twice"], "scripts/main.py": files["main"]}
    seen = []
    run_graph(compile_workflow(w, Path(), fake_tools(), skills, canonical), RunSetup(), [seen.append])
    assert seen[-2].data["outputs"] == {"o": 6.0}
