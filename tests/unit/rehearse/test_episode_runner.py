"""Preparations run once, before any episode, and only for plugins the graph uses."""

from __future__ import annotations

from types import SimpleNamespace

from gap_cli.rehearse.episode_runner import prepare_models
from gap_runtime.plugins import Entry


def registry(called):
    entries = {name: Entry(name, lambda ctx, name=name: called.append((name, ctx)), name) for name in ("used", "idle")}
    tools = {"svc.Look": SimpleNamespace(plugin="used")}
    return SimpleNamespace(
        preparations=entries, tool=tools.__getitem__, robot=lambda model: f"spec of {model}", renderer=None
    )


def test_only_the_plugins_in_use_are_prepared():
    called = []
    task = SimpleNamespace(robots=[SimpleNamespace(model="arm")])
    prepare_models(registry(called), task, frozenset({"svc.Look"}))
    ((name, context),) = called
    assert (name, context.task, context.robot(0)) == ("used", task, "spec of arm")


def test_what_is_prepared_is_what_nodes_find():
    from gap_cli.rehearse.episode_runner import ModelContext
    from gap_runtime.run.services import SHARED

    made = ModelContext(None, (), None).shared("test.warm", object)
    assert SHARED.get("test.warm", object) is made
