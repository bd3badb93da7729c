"""S7-S12: what a subgraph gives, takes and ends in."""

from __future__ import annotations

from collections.abc import Iterator

from gap_cli.analysis.context import SubgraphContext
from gap_cli.analysis.value_types import NoSuchFieldError, walk_type
from gap_runtime.errors import Finding, did_you_mean
from gap_runtime.graph.references import STREAM, Reference, references_in


def s7_there_is_a_success_exit(sg: SubgraphContext) -> Iterator[Finding]:
    """S7: no success exit."""
    if not sg.definition.exit.success_values:
        yield sg.finding("S7", "exit.success_values", "is empty", 'Add one: sg.add_exit("done").')


def s8_outputs_name_nodes(sg: SubgraphContext) -> Iterator[Finding]:
    """S8: an output is bound to a node that is not there, or to an end node."""
    for name, value in sg.definition.outputs.items():
        for path, reference in references_in(value, f"outputs.{name}"):
            if reference is None or reference.source != "node":
                continue
            if reference.name not in sg.nodes:
                hint = did_you_mean(reference.name, sg.nodes)
                yield sg.finding("S8", path, f"there is no node {reference.name!r}", hint)
            elif sg.nodes[reference.name].type == "end":
                yield sg.finding("S8", path, f"{reference.name!r} is an end node and gives nothing")


def s9_on_error_is_not_a_node(sg: SubgraphContext) -> Iterator[Finding]:
    """S9: the failure exit is also a node."""
    value = sg.on_error
    if value in sg.nodes:
        hint = "A failure is raised, not routed to: drop the node, or rename it."
        yield sg.finding("S9", f"nodes.{value}", f"has the name of on_error ({value!r})", hint)


def s10_on_error_is_not_a_target(sg: SubgraphContext) -> Iterator[Finding]:
    """S10: conditional edges lead to the failure exit."""
    d = sg.definition
    for source, routes in d.conditional_edges.items():
        for value, target in routes.mapping.items():
            if target == sg.on_error:
                path = f"conditional_edges.{source}.mapping.{value}"
                hint = "Lead to a script that raises; on_error catches it."
                yield sg.finding("S10", path, f"leads to on_error ({target!r}), which is no place to go", hint)


def s11_exits_can_be_reached(sg: SubgraphContext) -> Iterator[Finding]:
    """S11: a success value no terminal node can give, or a terminal node that means no exit."""
    d = sg.definition
    if d.exit.router_field is None:
        yield from _named_exits(sg)
        return
    for value in d.exit.success_values:
        if value in d.nodes:
            message = f"{value!r} is a value of {d.exit.router_field!r} and also a node"
            yield sg.finding("S11", "exit.success_values", message, "Rename the node.")
    yield from _valued_exits(sg, d.exit.router_field)


def _named_exits(sg: SubgraphContext) -> Iterator[Finding]:
    d = sg.definition
    for value in d.exit.success_values:
        node = d.nodes.get(value)
        if node is None:
            hint = f'Add it: sg.add_exit("{value}").'
            yield sg.finding("S11", "exit.success_values", f"no node is named {value!r}", hint)
        elif node.type != "noop":
            hint = f'Exits are noops: sg.add_exit("{value}") and an edge to it.'
            yield sg.finding("S11", "exit.success_values", f"{value!r} is a {node.type}, not a noop", hint)
        elif value not in sg.terminals:
            hint = f'Write sg.add_edge("{value}", END).'
            yield sg.finding("S11", "exit.success_values", f"exit {value!r} does not lead to END", hint)
    for name in sg.terminals:
        if name not in d.exit.success_values and name != sg.on_error:
            hint = f"Lead to one of {', '.join(d.exit.success_values) or 'its exits'} instead."
            yield sg.finding("S11", f"nodes.{name}", "leads to END and is not an exit", hint)


def _valued_exits(sg: SubgraphContext, field: str) -> Iterator[Finding]:
    """With a routing field: every terminal node has the field, and its known words are the success values."""
    values = sg.definition.exit.success_values
    words: set[str] = set()
    open_ended = not sg.terminals
    for name in sg.terminals:
        found = sg.outputs[name]
        try:
            if found is None:
                raise NoSuchFieldError(f"{name} gives nothing")
            found = walk_type(found, tuple(field.split(".")), name)
        except NoSuchFieldError as error:
            yield sg.finding("S11", "exit.router_field", f"{error.message}, so the exit cannot be read", error.hint)
            open_ended = True
            continue
        known = found.words or (("true", "false") if found.type is not None and found.type.name == "bool" else ())
        words |= set(known)
        open_ended |= not known
        for word in known:
            if values and word not in values:
                hint = f"Exits: {', '.join(values)}. Raise instead, or declare it."
                yield sg.finding("S11", f"nodes.{name}", f"may end in {word!r}, which is not an exit", hint)
    for value in values:
        if not open_ended and value not in words:
            hint = f"It can give {', '.join(sorted(words))}."
            yield sg.finding("S11", "exit.success_values", f"nothing ends in {value!r}", hint)


def s12_inputs_are_declared(sg: SubgraphContext) -> Iterator[Finding]:
    """S12: `in.<name>` that the subgraph does not declare."""
    declared = sg.definition.inputs
    places = [(f"nodes.{n}.inputs.{i}", v) for n, node in sg.nodes.items() for i, v in node.inputs.items()]
    places += [(f"outputs.{n}", v) for n, v in sg.definition.outputs.items()]
    for path, value in places:
        for where, reference in references_in(value, path):
            if _undeclared(reference, declared):
                assert reference is not None
                hint = did_you_mean(reference.name, [*declared, STREAM])
                yield sg.finding("S12", where, f"input {reference.name!r} is not declared", hint)


def _undeclared(reference: Reference | None, declared: dict[str, str]) -> bool:
    known = reference is None or reference.source != "in" or reference.name == STREAM
    return not known and reference is not None and reference.name not in declared


RULES = (
    s7_there_is_a_success_exit,
    s8_outputs_name_nodes,
    s9_on_error_is_not_a_node,
    s10_on_error_is_not_a_target,
    s11_exits_can_be_reached,
    s12_inputs_are_declared,
)
