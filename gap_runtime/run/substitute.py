"""Replaces nodes or tools, found by wildcard, by mocks and injected faults read from a file of rules."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from gap_runtime.contracts.documents import read_yaml
from gap_runtime.contracts.failures import (
    DocumentError,
    GraspError,
    MotionError,
    PerceptionError,
    PlanningError,
    ToolError,
    did_you_mean,
)
from gap_runtime.contracts.models import Document
from gap_runtime.graph.compiled import BoundCallable, CompiledGraph, CompiledNode, CompiledSubgraph, TopNode
from gap_runtime.run.context import NodeContext

ERRORS: dict[str, type[ToolError]] = {
    "tool": ToolError, "perception": PerceptionError, "planning": PlanningError, "motion": MotionError,
    "grasp": GraspError,
}  # fmt: skip
LATEST_S = 3600.0
Mock = Callable[[NodeContext, dict[str, Any]], Any]


class Fault(Document):
    """An error to raise: which of the tool errors, its code and its message."""

    kind: Literal["tool", "perception", "planning", "motion", "grasp"] = "tool"
    code: str = "injected"
    message: str = "an injected fault"


class Rule(Document):
    """One replacement. Exactly one of `node` (a node's path, as in `grasp_sg/close`) and `tool` (a tool's name, also
    where scripts call it); both take wildcards. What happens, in this order: `delay_s` of wall time passes, or, with
    `late`, all of the deadline and more; `raise` is raised; `output` (plain data) is returned, or with `wrong_type`
    something no contract allows; with none of these the real thing runs. `calls` limits it to the n-th calls from 1.
    """

    node: str | None = None
    tool: str | None = None
    output: Any = None
    raise_: Fault | None = Field(default=None, alias="raise")
    delay_s: float = Field(default=0.0, ge=0)
    late: bool = False
    wrong_type: bool = False
    calls: list[int] = []

    @model_validator(mode="after")
    def _one_target(self) -> Rule:
        if (self.node is None) == (self.tool is None):
            raise ValueError("give exactly one of node and tool")
        return self

    def matches(self, path: str, callee: BoundCallable) -> bool:
        """True for the node at `path` which calls `callee`."""
        return (self.node is not None and fnmatchcase(path, self.node)) or self.matches_tool(callee)

    def matches_tool(self, callee: BoundCallable) -> bool:
        """True for a tool of this name."""
        return self.tool is not None and callee.kind == "tool" and fnmatchcase(callee.name, self.tool)


class Substitutions(Document):
    """A file of rules; of several that match, the first one counts."""

    schema_: Literal["gap/substitutions/v1"] = Field(default="gap/substitutions/v1", alias="schema")
    rules: list[Rule]


def load_substitutions(file: Path) -> Substitutions:
    """Read a rules file. Raises `DocumentError`."""
    return Substitutions.load(read_yaml(file), str(file))


def substitute(graph: CompiledGraph, rules: Sequence[Rule], where: str = "substitutions") -> CompiledGraph:
    """The graph with every matching node and tool replaced. Raises `DocumentError` for a rule that matches nothing."""
    for i, rule in enumerate(rules):
        nodes = [n for n in graph.inner_nodes() if n.callee is not None]
        if not any(rule.matches(n.path, n.callee) for n in nodes if n.callee) and not any(
            rule.matches_tool(c) for c in graph.callees.values()
        ):
            wanted = rule.node or rule.tool or ""
            known = [n.path for n in nodes] if rule.node else list(graph.callees)
            raise DocumentError(where, f"rules.{i}: nothing matches {wanted!r}", hint=did_you_mean(wanted, known))

    def new(path: str, callee: BoundCallable) -> BoundCallable:
        rule = next((r for r in rules if r.matches(path, callee)), None)
        return callee if rule is None else mocked(callee, rule_mock(rule, callee))

    def new_tool(callee: BoundCallable) -> BoundCallable:
        rule = next((r for r in rules if r.matches_tool(callee)), None)
        return callee if rule is None else mocked(callee, rule_mock(rule, callee))

    callees = {name: new_tool(callee) for name, callee in graph.callees.items()}
    return rebuilt(replace(graph, callees=callees), lambda n, c: new(n.path, c))


def mocked(callee: BoundCallable, mock: Mock) -> BoundCallable:
    """The callee with `mock` in place of what it does; its contract stays, so what the mock returns is checked."""
    return replace(callee, invoke=mock, takes_context=True, jailed=False)


def rule_mock(rule: Rule, callee: BoundCallable) -> Mock:
    """What a rule does in place of `callee`."""
    calls = 0

    def mock(ctx: NodeContext, kwargs: dict[str, Any]) -> Any:
        nonlocal calls
        calls += 1
        if rule.calls and calls not in rule.calls:
            return callee.invoke(ctx, kwargs)
        _delay(rule, callee, ctx)
        if rule.raise_ is not None:
            raise ERRORS[rule.raise_.kind](rule.raise_.code, rule.raise_.message)
        if rule.wrong_type:
            return object()
        return rule.output if "output" in rule.model_fields_set else callee.invoke(ctx, kwargs)

    return mock


def _delay(rule: Rule, callee: BoundCallable, ctx: NodeContext) -> None:
    """Wall time passes. A late node is deaf: it neither listens nor stops, as a call stuck in C would not."""
    if rule.late:
        time.sleep(min(ctx.seconds_left(), LATEST_S) + 1.0)
        return
    end = time.monotonic() + rule.delay_s
    while time.monotonic() < end:
        ctx.raise_if_cancelled()
        time.sleep(min(0.01, rule.delay_s))


def rebuilt(graph: CompiledGraph, new: Callable[[CompiledNode, BoundCallable], BoundCallable]) -> CompiledGraph:
    """The graph with `new(node, its callee)` in every node that calls something."""

    def node(old: CompiledNode) -> CompiledNode:
        return old if old.callee is None else replace(old, callee=new(old, old.callee))

    def subgraph(old: CompiledSubgraph | None) -> CompiledSubgraph | None:
        return None if old is None else replace(old, nodes=tuple(node(n) for n in old.nodes))

    def top(old: TopNode) -> TopNode:
        return replace(old, subgraph=subgraph(old.subgraph), recovery=subgraph(old.recovery))

    return replace(graph, nodes=tuple(top(n) for n in graph.nodes))
