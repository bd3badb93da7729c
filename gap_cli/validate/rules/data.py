"""D1-D8 and D10: every input and output is bound to something that is there, of the right type, frame and unit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from gap_cli.analysis.catalog import Callee
from gap_cli.analysis.scope import Scope
from gap_cli.analysis.value_types import (
    ANY,
    NoSuchFieldError,
    Place,
    Shape,
    is_ref,
    literal_problem,
    parameter_shape,
    places,
    unit_of,
    walk_shape,
)
from gap_runtime.contracts.types.typeref import TypeRef
from gap_runtime.errors import did_you_mean
from gap_runtime.graph.findings import Finding
from gap_runtime.graph.model import Node
from gap_runtime.graph.references import STREAM, Reference
from gap_runtime.graph.walks import parse_reference

FORMS = "Write node, node.field.0, in.<name> or param.<name>."


def d_inputs(scope: Scope) -> Iterator[Finding]:
    """D1-D8, D10 over the inputs of every node."""
    for name, node in scope.nodes.items():
        callee = scope.callees[name]
        if callee is not None:
            yield from _required(scope, name, node, callee)
        for given, value in node.inputs.items():
            path = f"nodes.{name}.inputs.{given}"
            wanted = ANY
            if callee is not None:
                parameter = callee.inputs.get(given)
                if parameter is None:
                    hint = did_you_mean(given, callee.inputs) if callee.inputs else "It takes none."
                    yield scope.find("D8", path, f"{callee.what} has no input {given!r}", hint)
                else:
                    wanted = parameter.type
                yield from _word(scope, path, value, callee.words.get(given, ()))
            for place in places(value, wanted, path, unit_of(given)):
                yield from _place(scope, name, place)


def _required(scope: Scope, name: str, node: Node, callee: Callee) -> Iterator[Finding]:
    if name in scope.copied:  # what it is not given here the router sends
        return
    for parameter in callee.inputs.values():
        if parameter.required and parameter.name not in node.inputs:
            message = f"{callee.what} needs {parameter.name!r} ({parameter.type})"
            yield scope.find("D7", f"nodes.{name}", message, f'Add "{parameter.name}": ... to its inputs.')


def _word(scope: Scope, path: str, value: Any, words: tuple[str, ...]) -> Iterator[Finding]:
    """D6 for an input that takes one of a few words."""
    if words and isinstance(value, (str, int)):
        word = str(value).lower() if isinstance(value, bool) else str(value)
        if word not in words:
            yield scope.find("D6", path, f"{_shown(value)} is not one of {', '.join(words)}", did_you_mean(word, words))


def d_outputs(scope: Scope) -> Iterator[Finding]:
    """D1-D6 over the outputs of the subgraph."""
    types = scope.contract_types[1]
    for name, value in scope.definition.outputs.items():
        for place in places(value, types.get(name, ANY), f"outputs.{name}"):
            yield from _place(scope, None, place)


def _place(scope: Scope, node: str | None, place: Place) -> Iterator[Finding]:
    """One reference or literal; `node` is who reads it, None for the subgraph's outputs."""
    if place.problem:
        yield scope.find("D6", place.path, f"does not fit {place.type}: {place.problem}")
        return
    if not is_ref(place.value):
        problem = literal_problem(place.value, place.type) if place.type.name != "any" else None
        if problem is not None:
            message, hint = problem
            yield scope.find("D6", place.path, f"{_shown(place.value)} does not fit {place.type}: {message}", hint)
        return
    reference = parse_reference(place.value)
    if reference is None:
        yield scope.find("D1", place.path, f"{_shown(place.value.get('$ref'))} is not a reference", FORMS)
        return
    yield from _order(scope, node, place.path, reference)
    yield from _flow(scope, place, reference)


def _order(scope: Scope, node: str | None, path: str, reference: Reference) -> Iterator[Finding]:
    """D2: what is read is there by then."""
    other = reference.name
    if reference.source != "node" or other not in scope.nodes:
        return
    if other in scope.copied:
        router = scope.copied[other]
        hint = f'Read Ref("{router}"), the list of what they gave.'
        yield scope.find("D2", path, f"{other!r} runs in copies, one per item {router!r} sends", hint)
    elif node is None:
        ends = [t for t in scope.terminals if scope.flow.index[t] in scope.flow.rank]
        if ends and not any(scope.given_at(t, other) for t in ends):
            yield scope.find(
                "D2", path, f"{other!r} has not surely run at {' or '.join(map(repr, ends))}", _certain(other)
            )
    elif scope.flow.index[node] in scope.flow.rank and not scope.surely_before(node, other):
        yield scope.find("D2", path, *_why_not(scope, node, other))


def _why_not(scope: Scope, node: str, other: str) -> tuple[str, str]:
    if node == other:
        return "reads its own output", "Read what an earlier node gave."
    if scope.flow.index[other] not in scope.flow.rank:
        return f"{other!r} never runs", f'Lead to it before "{node}".'
    if other in scope.streaming:
        return f"{other!r} is not surely started before {node!r}", f'Start it with an edge from where "{node}" starts.'
    if scope.flow.can_precede(node, other):
        return f"{other!r} is not certain to have run: a way to {node!r} leaves it out", _certain(other)
    if scope.flow.can_precede(other, node):
        return f"{other!r} runs after {node!r}", f'Lead from "{other}" to "{node}", or read an earlier node.'
    return f"{other!r} runs beside {node!r}, not before it", f'Add add_edge("{other}", "{node}").'


def _certain(other: str) -> str:
    return f'Lead every way through "{other}", or read a node that always runs.'


def _flow(scope: Scope, place: Place, reference: Reference) -> Iterator[Finding]:
    """D1, D3, D4, D5, D10: what is read exists and is what is wanted."""
    source = _source(scope, reference)
    if isinstance(source, tuple):
        if source[0] and not (reference.source == "node" and place.path.startswith("outputs.")):  # S8 has those
            yield scope.find("D1", place.path, *source)
        return
    what = f"{reference.source}.{reference.name}" if reference.source != "node" else reference.name
    if source is None:
        yield scope.find("D3", place.path, f"{what} gives nothing to read", "Read the node that makes the value.")
        return
    try:
        shape = walk_shape(source, reference.fields, what)
    except NoSuchFieldError as error:
        yield scope.find("D3", place.path, error.message, error.hint)
        return
    yield from _types(scope, place, str(reference), shape)


def _source(scope: Scope, reference: Reference) -> Shape | tuple[str, str] | None:
    """What the head of a reference is: None for nothing, (message, hint) where there is none ('': said elsewhere)."""
    name = reference.name
    if reference.source == "in":
        if name == STREAM:
            return Shape(TypeRef("Observation"))
        return scope.inputs.get(name) or ("", "")  # S12 has it
    if reference.source == "param":
        known = scope.contract.parameters if scope.contract is not None else {}
        if name not in known and scope.contract is not None:
            hint = did_you_mean(name, known) if known else "It has none."
            return f"{scope.definition.skill} has no parameter {name!r}", hint
        return parameter_shape(known[name]) if name in known else Shape(ANY)
    if name not in scope.nodes:
        return f"there is no node {name!r}", did_you_mean(name, scope.nodes)
    return scope.outputs[name]


def _types(scope: Scope, place: Place, what: str, shape: Shape) -> Iterator[Finding]:
    wanted = place.type
    if shape.type is None:
        if wanted.name != "any":
            fits = [n for n, t in shape.fields.items() if wanted.accepts(t)]
            hint = f"Write Ref({f'{what}.{(fits or [*shape.fields])[0]}'!r})."
            message = f"wants {wanted}, and {what} is several results: {', '.join(shape.fields)}"
            yield scope.find("D4", place.path, message, hint)
        return
    if not wanted.accepts(shape.type):
        yield scope.find(*_mismatch(place, what, wanted, shape.type))
    if place.unit and shape.unit and place.unit != shape.unit:
        message = f"is in {place.unit} by its name, and {what} is in {shape.unit}"
        yield scope.find("D10", place.path, message, "Convert it in a script.")


def _mismatch(place: Place, what: str, wanted: TypeRef, given: TypeRef) -> tuple[str, str, str, str]:
    message = f"wants {wanted}, and {what} is {given}"
    same = wanted.name == given.name and wanted.is_list == given.is_list
    if same and given.optional and not wanted.optional:
        return "D4", place.path, f"{message}: it may be absent", "Check it in a script that raises where it is."
    if same:
        hint = "Transform it first (geometry_svc.TransformPoints for clouds)."
        return "D5", place.path, message, hint
    if given.is_list and not wanted.is_list and wanted.name == given.name:
        return "D4", place.path, message, f"Pick one: Ref({what + '.0'!r})."
    return "D4", place.path, message, ""


def _shown(value: Any) -> str:
    text = repr(dict(value)) if isinstance(value, Mapping) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


RULES = (d_inputs, d_outputs)
