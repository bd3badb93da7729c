"""Runs a graph through without a cell: every output is made up from its type, every branch drawn from a seed."""

from __future__ import annotations

import random
from dataclasses import replace
from typing import Any

from gap_runtime.graph.compiled import BoundCallable, CompiledGraph, CompiledNode
from gap_runtime.graph.values import Check
from gap_runtime.run.placeholders import PLACEHOLDER, placeholder
from gap_runtime.run.substitute import Mock, mocked, rebuilt

COPIES = 2  # of a dynamic fan-out
Decision = tuple[tuple[str, ...], list[str]]
"""The field of an output that decides where control goes ('()': the output itself), and what it may say."""


def dry(graph: CompiledGraph, *, seed: int = 0) -> CompiledGraph:
    """The graph with everything mocked. It needs no cell, no jail and no model.

    A dry run shows that the graph holds together, not that it does anything.
    """
    callees = {name: _lenient(mocked(c, _constant(_placeholder_output(c)))) for name, c in graph.callees.items()}

    def new(node: CompiledNode, callee: BoundCallable) -> BoundCallable:
        rng = random.Random(f"{seed}/{node.path}")  # its own, so that parallel branches draw the same every time
        return _lenient(mocked(callee, _mock(graph, node, callee, rng)))

    made = rebuilt(replace(graph, callees=callees, dry=True), new)
    return replace(made, nodes=tuple(replace(t, subgraph=t.subgraph and replace(
        t.subgraph, nodes=tuple(_lenient_readers(n) for n in t.subgraph.nodes))) for t in made.nodes))  # fmt: skip


def _constant(value: Any) -> Mock:
    return lambda ctx, kwargs: value


def _mock(graph: CompiledGraph, node: CompiledNode, callee: BoundCallable, rng: random.Random) -> Mock:
    decision = _decision(graph, node)
    if node.kind == "router" and callee.output is not None and callee.output.is_list:
        return lambda ctx, kwargs: _sends(graph, node)

    def mock(ctx: Any, kwargs: dict[str, Any]) -> Any:
        made = _placeholder_output(callee)
        return made if decision is None else _decided(callee, made, decision[0], rng.choice(decision[1]))

    return mock


def _placeholder_output(callee: BoundCallable) -> Any:
    if callee.output is not None:
        words = callee.choices.get("")
        return words[0] if words else placeholder(callee.output)
    made = {name: placeholder(ref) for name, ref in callee.fields.items()}
    return {**made, **{name: _as_type(callee, name, words[0]) for name, words in callee.choices.items()}} or None


def _decided(callee: BoundCallable, made: Any, fields: tuple[str, ...], word: str) -> Any:
    if not fields:
        return word
    return {**made, fields[0]: _as_type(callee, fields[0], word)} if isinstance(made, dict) else made


def _as_type(callee: BoundCallable, field: str, word: str) -> Any:
    name = callee.fields[field].name if field in callee.fields else "string"
    if name == "bool":
        return word == "true"
    return int(word) if name == "int" else word


def _decision(graph: CompiledGraph, node: CompiledNode) -> Decision | None:
    if node.routes is not None:
        return node.routes.fields, sorted(node.routes.targets)
    top = next((n for n in graph.nodes if n.subgraph is not None and node.path.startswith(f"{n.name}/")), None)
    if top is None or top.subgraph is None or not node.ends or top.subgraph.exit_fields is None:
        return None
    return top.subgraph.exit_fields, sorted(top.subgraph.success_values)


def _sends(graph: CompiledGraph, router: CompiledNode) -> list[dict[str, Any]]:
    top = next(n for n in graph.nodes if n.subgraph is not None and router.path.startswith(f"{n.name}/"))
    assert top.subgraph is not None and router.routes is not None
    target = top.subgraph.nodes[min(t for ts in router.routes.targets.values() for t in ts)]
    known = {*target.constants, *(name for name, _, _ in target.readers)}
    wanted = [p for p in (target.callee.arguments if target.callee else ()) if p.required and p.name not in known]
    return [{"to": target.name, "inputs": {p.name: placeholder(p.type) for p in wanted}} for _ in range(COPIES)]


def _lenient(callee: BoundCallable) -> BoundCallable:
    return replace(callee, checks={name: _accepting(check) for name, check in callee.checks.items()})


def _lenient_readers(node: CompiledNode) -> CompiledNode:
    return replace(node, readers=tuple((name, read, _accepting(check)) for name, read, check in node.readers))


def _accepting(check: Check) -> Check:
    return lambda value, where: value if value is PLACEHOLDER else check(value, where)
