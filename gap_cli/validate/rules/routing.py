"""D9: conditional edges decide by a value that exists and that leads somewhere, whatever it is."""

from __future__ import annotations

from collections.abc import Iterator

from gap_cli.analysis.scope import Scope
from gap_cli.analysis.value_types import NoSuchFieldError, Shape, walk_shape
from gap_runtime.errors import did_you_mean
from gap_runtime.graph.findings import Finding
from gap_runtime.graph.model import Routing

_DECIDES = ("string", "bool", "int", "any")


def d9_routing_values(scope: Scope) -> Iterator[Finding]:
    """D9: the field is there, can decide, and every word it may take has an edge."""
    for source, routes in scope.definition.conditional_edges.items():
        node = scope.nodes.get(source)
        if node is None or node.type == "noop" or scope.callees[source] is None:
            continue
        path = f"conditional_edges.{source}"
        if node.type == "router":
            yield from _router(scope, source, routes, path)
        elif routes.router_field is not None:
            yield from _field(scope, source, routes, routes.router_field, path)


def _router(scope: Scope, source: str, routes: Routing, path: str) -> Iterator[Finding]:
    callee = scope.callees[source]
    assert callee is not None
    if callee.output is None or callee.output.name not in ("string", "any"):
        yield scope.find("D9", path, f"{callee.what} does not return a node's name", "Make run(...) -> str.")
    elif not callee.output.is_list:
        yield from _words(scope, path, callee.choices.get("", ()), {*routes.mapping, *routes.mapping.values()}, routes)


def _field(scope: Scope, source: str, routes: Routing, field: str, path: str) -> Iterator[Finding]:
    try:
        shape = walk_shape(scope.outputs[source] or Shape(None), tuple(field.split(".")), source)
    except NoSuchFieldError as error:
        yield scope.find("D9", path, error.message, error.hint)
        return
    kind = shape.type
    if kind is None or kind.is_list or kind.name not in _DECIDES:
        yield scope.find("D9", path, f"{source}.{field} is {kind or 'several results'} and cannot decide")
    elif kind.optional:
        yield scope.find("D9", path, f"{source}.{field} may be absent and then decides nothing")
    else:
        words = ("true", "false") if kind.name == "bool" else shape.words
        yield from _words(scope, path, words, set(routes.mapping), routes)


def _words(scope: Scope, path: str, words: tuple[str, ...], routed: set[str], routes: Routing) -> Iterator[Finding]:
    if not words:
        return
    for word in words:
        if word not in routed:
            yield scope.find("D9", path, f"{word!r} leads nowhere", f'Add "{word}": <node> to the mapping.')
    for value, target in routes.mapping.items():
        if value not in words and target not in words:
            yield scope.find("D9", f"{path}.mapping.{value}", f"{value!r} never happens", did_you_mean(value, words))


RULES = (d9_routing_values,)
