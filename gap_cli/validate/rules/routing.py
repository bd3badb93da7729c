"""D9: conditional edges decide by a value that exists and that leads somewhere, whatever it is."""

from __future__ import annotations

from collections.abc import Iterator

from gap_cli.analysis.context import SubgraphContext
from gap_cli.analysis.value_types import NoSuchFieldError, StaticType, walk_type
from gap_runtime.errors import did_you_mean
from gap_runtime.graph.findings import Finding
from gap_runtime.graph.model import Routing

_DECIDES = ("string", "bool", "int", "any")


def d9_routing_values(sg: SubgraphContext) -> Iterator[Finding]:
    """D9: the field is there, can decide, and every word it may take has an edge."""
    for source, routes in sg.definition.conditional_edges.items():
        node = sg.nodes.get(source)
        if node is None or node.type == "noop" or sg.callees[source] is None:
            continue
        path = f"conditional_edges.{source}"
        if node.type == "router":
            yield from _router(sg, source, routes, path)
        elif routes.router_field is not None:
            yield from _field(sg, source, routes, routes.router_field, path)


def _router(sg: SubgraphContext, source: str, routes: Routing, path: str) -> Iterator[Finding]:
    callee = sg.callees[source]
    assert callee is not None
    if callee.output is None or callee.output.name not in ("string", "any"):
        yield sg.finding("D9", path, f"{callee.what} does not return a node's name", "Make run(...) -> str.")
    elif not callee.output.is_list:
        yield from _words(sg, path, callee.choices.get("", ()), {*routes.mapping, *routes.mapping.values()}, routes)


def _field(sg: SubgraphContext, source: str, routes: Routing, field: str, path: str) -> Iterator[Finding]:
    try:
        found = walk_type(sg.outputs[source] or StaticType(None), tuple(field.split(".")), source)
    except NoSuchFieldError as error:
        yield sg.finding("D9", path, error.message, error.hint)
        return
    kind = found.type
    if kind is None or kind.is_list or kind.name not in _DECIDES:
        yield sg.finding("D9", path, f"{source}.{field} is {kind or 'several results'} and cannot decide")
    elif kind.optional:
        yield sg.finding("D9", path, f"{source}.{field} may be absent and then decides nothing")
    else:
        words = ("true", "false") if kind.name == "bool" else found.words
        yield from _words(sg, path, words, set(routes.mapping), routes)


def _words(
    sg: SubgraphContext, path: str, words: tuple[str, ...], routed: set[str], routes: Routing
) -> Iterator[Finding]:
    if not words:
        return
    for word in words:
        if word not in routed:
            yield sg.finding("D9", path, f"{word!r} leads nowhere", f'Add "{word}": <node> to the mapping.')
    for value, target in routes.mapping.items():
        if value not in words and target not in words:
            yield sg.finding("D9", f"{path}.mapping.{value}", f"{value!r} never happens", did_you_mean(value, words))


RULES = (d9_routing_values,)
