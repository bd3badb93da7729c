"""Plugins: what a broken, chatty or clashing one does to the rest (nothing), and what the user is told."""

from __future__ import annotations

import sys
import textwrap
from types import SimpleNamespace

import pytest

from gap_runtime.errors import PluginError, UnknownNameError
from gap_runtime.plugins import load_registry

TOOL = """
from gap_runtime.contracts.tool import tool
from gap_runtime.hookspecs import hookimpl

@tool("extra.Double"{options})
def double(x: {type}) -> {type}:
    "Twice x."
    return 2 * x

@hookimpl
def gap_register_tools(register):
    register(double)
"""

HOOK = "from gap_runtime.hookspecs import hookimpl\n@hookimpl\ndef gap_register_{name}(register): {body}"


def tool_source(type="float", options=""):
    return TOOL.format(type=type, options=options)


@pytest.fixture
def plugin(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    made = []

    def make(name, source):
        (tmp_path / f"{name}.py").write_text(textwrap.dedent(source))
        made.append(name)
        return name

    yield make
    for name in made:
        sys.modules.pop(name, None)


def load(*names):
    return load_registry(names, entry_points=False)


def test_a_tool_is_stamped_with_the_plugin_it_came_from(plugin):
    tool = load(plugin("good", tool_source())).tool("extra.Double")
    assert tool.plugin == "good" and tool(None, x=2.0) == 4.0


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("raise ValueError('no licence')", "ValueError: no licence"),
        ("import sys; sys.exit(3)", "SystemExit: 3"),
        ("import no_such_module", "ModuleNotFoundError"),
        ("def nonsense(", "SyntaxError"),
        ("class Stop(BaseException): pass\nraise Stop", "Stop"),
        (HOOK.format(name="toolz", body="pass"), "misspelled hook"),
        (HOOK.format(name="tools", body="register(1)"), "not a function"),
    ],
)  # fmt: skip
def test_a_broken_plugin_is_named_and_left_out(plugin, source, reason):
    registry = load(plugin("bad", source), plugin("good", tool_source()))
    assert reason in registry.broken["bad"]
    assert "extra.Double" in registry.tools


def test_a_plugin_that_fails_half_way_leaves_nothing(plugin):
    source = tool_source() + "    raise RuntimeError('half way')\n"
    registry = load(plugin("half", source))
    assert registry.tools == {} and "half way" in registry.broken["half"]


def test_printing_at_import_does_not_reach_stdout(plugin, capsys):
    load(plugin("chatty", "print('hello'); import sys; sys.stdout.write('more')\n" + tool_source()))
    assert capsys.readouterr().out == ""


def test_two_plugins_with_one_name_are_an_error_naming_both(plugin):
    with pytest.raises(PluginError, match="'one' and 'two'"):
        load(plugin("one", tool_source()), plugin("two", tool_source()))


def test_another_provider_of_a_tool_can_be_chosen(plugin):
    registry = load(plugin("one", tool_source()), plugin("two", tool_source(options=', provider="gpu"')))
    assert registry.tool("extra.Double").plugin == "one"
    registry.choose("extra.*", "gpu")
    assert registry.tool("extra.Double").plugin == "two"
    with pytest.raises(UnknownNameError, match="embedded"):
        registry.choose("extra.Double", "embeded")


def test_a_whole_service_is_chosen_as_far_as_the_provider_serves_it(plugin):
    more = tool_source().replace("extra.Double", "extra.Triple")
    registry = load(
        plugin("one", tool_source()), plugin("two", tool_source(options=', provider="gpu"')), plugin("three", more)
    )
    registry.choose("extra.*", "gpu")
    assert {name: tool.provider for name, tool in registry.tools.items()} == {
        "extra.Double": "gpu", "extra.Triple": "embedded",
    }  # fmt: skip
    with pytest.raises(UnknownNameError, match=r"Unknown provider of extra\.\* 'cloud'. Known: embedded, gpu"):
        registry.choose("extra.*", "cloud")
    with pytest.raises(UnknownNameError, match=r"provider of extra\.Triple"):
        registry.choose("extra.Triple", "gpu")


POLICY = """
from gap_runtime.contracts.types import ActionChunk
from gap_runtime.hookspecs import hookimpl

class Counting:
    built = 0
    def __init__(self): Counting.built, self.acts = Counting.built + 1, 0
    def reset(self): self.acts = 0
    def act(self, observation, instruction):
        self.acts += 1
        return ActionChunk(rate=float(self.acts), done=instruction == "stop")

@hookimpl
def gap_register_policies(register): register("counting", Counting)
"""


def test_a_policy_is_a_provider_of_one_tool_and_reset_once_an_episode(plugin):
    registry = load("gap_motion", plugin("learned", POLICY))
    registry.choose("policy.Act", "counting")
    tool = registry.tool("policy.Act")
    assert (tool.plugin, sorted(registry.providers["policy.Act"])) == ("learned", ["counting", "hold"])
    models = {}
    shared = lambda key, make: models.setdefault(key, None) or models.update({key: make()}) or models[key]  # noqa: E731
    episodes = [SimpleNamespace(state={}, shared=shared) for _ in range(2)]
    seen = [tool(ctx, observation=None, instruction="go").rate for ctx in episodes for _ in range(2)]
    assert seen == [1, 2, 1, 2]
    assert len(models) == 1 and type(models["policy:counting"]).built == 1


def test_providers_must_agree_on_the_contract(plugin):
    with pytest.raises(PluginError, match="disagree"):
        load(plugin("one", tool_source()), plugin("two", tool_source("int", ', provider="gpu"')))


def test_a_near_miss_is_suggested(plugin):
    with pytest.raises(UnknownNameError, match=r"Did you mean 'extra\.Double'"):
        load(plugin("good", tool_source())).tool("extra.Doubel")
