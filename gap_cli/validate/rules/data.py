"""D1-D10: every input, output and decision is bound to something that is there, of the right type, frame and unit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from gap_cli.analysis.catalog import Signature
from gap_cli.analysis.context import SENDS, SubgraphContext
from gap_cli.analysis.value_types import (
    ANY,
    InputSlot,
    NoSuchFieldError,
    StaticType,
    input_slots,
    literal_problem,
    parameter_type,
    unit_of,
    walk_type,
)
from gap_runtime.contracts.types.typeref import TypeRef
from gap_runtime.errors import Finding, did_you_mean
from gap_runtime.graph.model import Node, Routing
from gap_runtime.graph.references import STREAM, Reference, is_reference, parse_reference

_DECIDES = ("string", "bool", "int", "any")
FORMS = "Write node, node.field.0, in.<name> or param.<name>."


def d_inputs(sg: SubgraphContext) -> Iterator[Finding]:
    """D1-D8, D10 over the inputs of every node."""
    for name, node in sg.nodes.items():
        callee = sg.callees[name]
        if callee is not None:
            yield from _required(sg, name, node, callee)
        for given, value in node.inputs.items():
            path = f"nodes.{name}.inputs.{given}"
            wanted = ANY
            if callee is not None:
                parameter = callee.inputs.get(given)
                if parameter is None:
                    hint = did_you_mean(given, callee.inputs) if callee.inputs else "It takes none."
                    yield sg.finding("D8", path, f"{callee.what} has no input {given!r}", hint)
                else:
                    wanted = parameter.type
                yield from _word(sg, path, value, callee.words.get(given, ()))
            for slot in input_slots(value, wanted, path, unit_of(given)):
                yield from _check_slot(sg, name, slot)


def _required(sg: SubgraphContext, name: str, node: Node, callee: Signature) -> Iterator[Finding]:
    if name in sg.copied:  # what it is not given here the router sends
        return
    for parameter in callee.inputs.values():
        if parameter.required and parameter.name not in node.inputs:
            message = f"{callee.what} needs {parameter.name!r} ({parameter.type})"
            yield sg.finding("D7", f"nodes.{name}", message, f'Add "{parameter.name}": ... to its inputs.')


def _word(sg: SubgraphContext, path: str, value: Any, words: tuple[str, ...]) -> Iterator[Finding]:
    """D6 for an input that takes one of a few words."""
    if words and isinstance(value, (str, int)):
        word = str(value).lower() if isinstance(value, bool) else str(value)
        if word not in words:
            yield sg.finding("D6", path, f"{_shown(value)} is not one of {', '.join(words)}", did_you_mean(word, words))


def d_outputs(sg: SubgraphContext) -> Iterator[Finding]:
    """D1-D6 over the outputs of the subgraph."""
    types = sg.contract_types[1]
    for name, value in sg.definition.outputs.items():
        for slot in input_slots(value, types.get(name, ANY), f"outputs.{name}"):
            yield from _check_slot(sg, None, slot)


def _check_slot(sg: SubgraphContext, node: str | None, slot: InputSlot) -> Iterator[Finding]:
    """One reference or literal; `node` is who reads it, None for the subgraph's outputs."""
    if slot.problem:
        yield sg.finding("D6", slot.path, f"does not fit {slot.type}: {slot.problem}")
        return
    if not is_reference(slot.value):
        problem = literal_problem(slot.value, slot.type) if slot.type.name != "any" else None
        if problem is not None:
            message, hint = problem
            yield sg.finding("D6", slot.path, f"{_shown(slot.value)} does not fit {slot.type}: {message}", hint)
        return
    reference = parse_reference(slot.value)
    if reference is None:
        yield sg.finding("D1", slot.path, f"{_shown(slot.value.get('$ref'))} is not a reference", FORMS)
        return
    yield from _check_order(sg, node, slot.path, reference)
    yield from _check_reference(sg, slot, reference)


def _check_order(sg: SubgraphContext, node: str | None, path: str, reference: Reference) -> Iterator[Finding]:
    """D2: what is read is there by then."""
    other = reference.name
    if reference.source != "node" or other not in sg.nodes:
        return
    if other in sg.copied:
        router = sg.copied[other]
        hint = f'Read Ref("{router}"), the list of what they gave.'
        yield sg.finding("D2", path, f"{other!r} runs in copies, one per item {router!r} sends", hint)
    elif node is None:
        ends = [t for t in sg.terminals if sg.flow.index[t] in sg.flow.rank]
        if ends and not any(sg.given_at(t, other) for t in ends):
            yield sg.finding(
                "D2", path, f"{other!r} has not always run at {' or '.join(map(repr, ends))}", _lead_through(other)
            )
    elif sg.flow.index[node] in sg.flow.rank and not sg.must_precede(node, other):
        yield sg.finding("D2", path, *_why_not(sg, node, other))


def _why_not(sg: SubgraphContext, node: str, other: str) -> tuple[str, str]:
    if node == other:
        return "reads its own output", "Read what an earlier node gave."
    if sg.flow.index[other] not in sg.flow.rank:
        return f"{other!r} never runs", f'Lead to it before "{node}".'
    if other in sg.streaming:
        return f"{other!r} is not always started before {node!r}", f'Start it with an edge from where "{node}" starts.'
    if sg.flow.may_precede(node, other):
        return f"{other!r} has not always run: a path to {node!r} leaves it out", _lead_through(other)
    if sg.flow.may_precede(other, node):
        return f"{other!r} runs after {node!r}", f'Lead from "{other}" to "{node}", or read an earlier node.'
    return f"{other!r} runs beside {node!r}, not before it", f'Add add_edge("{other}", "{node}").'


def _lead_through(other: str) -> str:
    return f'Lead every path through "{other}", or read a node that always runs.'


def _check_reference(sg: SubgraphContext, slot: InputSlot, reference: Reference) -> Iterator[Finding]:
    """D1, D3, D4, D5, D10: what is read exists and is what is wanted."""
    source = _source(sg, reference)
    if isinstance(source, tuple):
        if source[0] and not (reference.source == "node" and slot.path.startswith("outputs.")):  # S8 has those
            yield sg.finding("D1", slot.path, *source)
        return
    what = f"{reference.source}.{reference.name}" if reference.source != "node" else reference.name
    if source is None:
        yield sg.finding("D3", slot.path, f"{what} gives nothing to read", "Read the node that makes the value.")
        return
    try:
        given = walk_type(source, reference.fields, what)
    except NoSuchFieldError as error:
        yield sg.finding("D3", slot.path, error.message, error.hint)
        return
    yield from _types(sg, slot, str(reference), given)


def _source(sg: SubgraphContext, reference: Reference) -> StaticType | tuple[str, str] | None:
    """What the head of a reference is: None for nothing, (message, hint) where there is none ('': said elsewhere)."""
    name = reference.name
    if reference.source == "in":
        if name == STREAM:
            return StaticType(TypeRef("Observation"))
        return sg.inputs.get(name) or ("", "")  # S12 has it
    if reference.source == "param":
        known = sg.contract.parameters if sg.contract is not None else {}
        if name not in known and sg.contract is not None:
            hint = did_you_mean(name, known) if known else "It has none."
            return f"{sg.definition.skill} has no parameter {name!r}", hint
        return parameter_type(known[name]) if name in known else StaticType(ANY)
    if name not in sg.nodes:
        return f"there is no node {name!r}", did_you_mean(name, sg.nodes)
    return sg.outputs[name]


def _types(sg: SubgraphContext, slot: InputSlot, what: str, given: StaticType) -> Iterator[Finding]:
    wanted = slot.type
    if given.type is None:
        if wanted.name != "any":
            fits = [n for n, t in given.fields.items() if wanted.accepts(t)]
            hint = f"Write Ref({f'{what}.{(fits or [*given.fields])[0]}'!r})."
            message = f"wants {wanted}, and {what} is several results: {', '.join(given.fields)}"
            yield sg.finding("D4", slot.path, message, hint)
        return
    if not wanted.accepts(given.type):
        yield sg.finding(*_mismatch(slot, what, wanted, given.type))
    if slot.unit and given.unit and slot.unit != given.unit:
        message = f"is in {slot.unit} by its name, and {what} is in {given.unit}"
        yield sg.finding("D10", slot.path, message, "Convert it in a script.")


def _mismatch(slot: InputSlot, what: str, wanted: TypeRef, given: TypeRef) -> tuple[str, str, str, str]:
    message = f"wants {wanted}, and {what} is {given}"
    same = wanted.name == given.name and wanted.is_list == given.is_list
    if same and given.optional and not wanted.optional:
        return "D4", slot.path, f"{message}: it may be absent", "Check it in a script that raises where it is."
    if same:
        hint = "Transform it first (geometry_svc.TransformPoints for clouds)."
        return "D5", slot.path, message, hint
    if given.is_list and not wanted.is_list and wanted.name == given.name:
        return "D4", slot.path, message, f"Pick one: Ref({what + '.0'!r})."
    return "D4", slot.path, message, ""


def _shown(value: Any) -> str:
    text = repr(dict(value)) if isinstance(value, Mapping) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


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
    output = callee.output
    if output not in (TypeRef("string"), SENDS):
        message = f"{callee.what} does not return the name of a node"
        hint = "Make it run(ctx, ...) -> str and return the name; or -> list[dict] of {to, inputs} to start several."
        yield sg.finding("D9", path, message, hint)
    elif output != SENDS:
        routed = {*routes.mapping, *routes.mapping.values()}
        yield from _routed_words(sg, path, callee.choices.get("", ()), routed, routes)


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
        yield from _routed_words(sg, path, words, set(routes.mapping), routes)


def _routed_words(
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


RULES = (d_inputs, d_outputs, d9_routing_values)
