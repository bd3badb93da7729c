"""S13 and W11-W13: what flows between subgraphs, by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import combinations

from gap_cli.analysis.catalog import SLOT
from gap_cli.analysis.context import SubgraphContext, WorkflowContext
from gap_runtime.contracts.skill import NAME_SLOT
from gap_runtime.contracts.types.typeref import TypeRef
from gap_runtime.errors import Finding, did_you_mean
from gap_runtime.graph.references import STREAM, STREAM_TYPES

Producer = tuple[str, str]  # a name, and the node that gives it
Given = Mapping[int, frozenset[str]]  # node of the exit flow -> names given there


def w11_contract(sg: SubgraphContext) -> Iterator[Finding]:
    """W11: inputs are the skill's, outputs among the skill's, after substitution, type by type."""
    contract, d = sg.contract, sg.definition
    if contract is None:
        return
    yield from _substitutions(sg)
    inputs, outputs = sg.contract_types
    for name, type_ in inputs.items():
        if name not in d.inputs and name != STREAM and not type_.optional:
            hint = f'Declare it: inputs={{"{name}": "{type_.name}"}}.'
            yield sg.finding("W11", "inputs", f"{d.skill} needs {name!r} ({type_})", hint)
    for name, text in d.inputs.items():
        if name == STREAM:
            if text not in STREAM_TYPES:
                yield sg.finding("W11", f"inputs.{name}", f"is an {STREAM_TYPES[0]}, not {text!r}")
        elif name not in inputs:
            yield sg.finding("W11", f"inputs.{name}", f"{d.skill} takes no {name!r}", _known(name, inputs))
        else:
            yield from _type(sg, f"inputs.{name}", text, inputs[name])
    for name in d.outputs:
        if name not in outputs:
            yield sg.finding("W11", f"outputs.{name}", f"{d.skill} gives no {name!r}", _known(name, outputs))


def _known(name: str, names: dict[str, TypeRef]) -> str:
    return did_you_mean(name, names) if names else "It has none."


def _substitutions(sg: SubgraphContext) -> Iterator[Finding]:
    contract, d = sg.contract, sg.definition
    assert contract is not None
    known = {*contract.inputs, *contract.outputs, *contract.roles, SLOT}
    for key in d.names:
        if key not in known:
            message = f"{key!r} is neither a name nor a role of {d.skill}"
            yield sg.finding("W11", f"names.{key}", message, did_you_mean(key, known))
    for part, contracted in (("inputs", contract.inputs), ("outputs", contract.outputs)):
        spelled = sg.contract_types[0 if part == "inputs" else 1]
        if any(n.startswith(NAME_SLOT) for n in spelled):
            hint = 'Write names={"name": "target"}.'
            yield sg.finding("W11", part, f"nothing says what {NAME_SLOT} is", hint)
        elif len(spelled) < len(contracted):
            yield sg.finding("W11", "names", f"two {part} of {d.skill} would have one name")


def _type(sg: SubgraphContext, path: str, text: str, wanted: TypeRef) -> Iterator[Finding]:
    try:
        declared = TypeRef.parse(text)
    except ValueError as error:
        yield sg.finding("W11", path, str(error))
        return
    if not wanted.accepts(declared):
        yield sg.finding("W11", path, f"is declared {declared}, and the skill takes {wanted}")


def producers(context: WorkflowContext) -> Iterator[Finding]:
    """S13, W12, W13: every input is produced, on every path, by one subgraph of that path."""
    flow = context.exit_flow.flow
    always, may = _given(context, SubgraphContext.gives), _given(context, SubgraphContext.may_give)
    always_there, possible = _available(context, always, may)
    for node, sg in context.subgraph_nodes():
        at = flow.index[node]
        if at not in flow.rank:
            continue
        optional = {n for n, t in sg.contract_types[0].items() if t.optional}
        for name in sg.definition.inputs.keys() - {STREAM}:
            path = f"{sg.path}.inputs.{name}"
            if name in optional:
                yield from _beside(context, node, path, name, _exits_with(context, name, may))
            elif not any(n == name for n, _ in possible[at]):
                message = f"no subgraph before {node!r} produces {name!r}"
                yield Finding(path, "S13", message, _nearest(name, context, node))
            elif name not in always_there[at] and not _brought_by_a_branch(
                context, node, _exits_with(context, name, always)
            ):
                without = _path_without(context, at, name, always_there)
                yield Finding(path, "W12", f"{name!r} is not produced on every way to {node!r}{without}")
        yield from _twice(node, sg, possible[at])
        yield from _flowing_types(context, node, sg, possible[at])
    for name in sorted({n for names in may.values() for n in names}) if context.exit_flow.forks else ():
        yield from _twice_at_once(context, name, _exits_with(context, name, may))


def _given(context: WorkflowContext, names: Callable[[SubgraphContext, str], frozenset[str]]) -> Given:
    flow = context.exit_flow
    subgraphs = {exit_: context.subgraph_of(node) for exit_, (node, _) in flow.exits.items()}
    return {flow.flow.index[e]: names(sg, flow.exits[e][1]) for e, sg in subgraphs.items() if sg is not None}


def _exits_with(context: WorkflowContext, name: str, given: Given) -> list[str]:
    """The exits (nodes of the exit flow) that give a name."""
    return [exit_ for exit_ in context.exit_flow.exits if name in given[context.exit_flow.flow.index[exit_]]]


def _brought_by_a_branch(context: WorkflowContext, node: str, exits: list[str]) -> bool:
    """True where branches join in this node, and one of them always brings what these exits give."""
    return context.exit_flow.forks and context.exit_flow.must.one_before(node, exits)


def _available(
    context: WorkflowContext, always: Given, may: Given
) -> tuple[dict[int, frozenset[str]], dict[int, frozenset[Producer]]]:
    """Per node: names produced on every single path to it, and every (name, producing node) on any."""
    flow, exits = context.exit_flow.flow, context.exit_flow.exits
    everything = frozenset(name for names in always.values() for name in names)
    always_there, possible = dict.fromkeys(flow.order, everything), dict.fromkeys(flow.order, frozenset[Producer]())
    always_there[0], changed = frozenset(), True
    while changed:
        changed = False
        for node in flow.order[1:]:
            sources = [s for number in flow.into[node] if (s := flow.arcs[number].source) in always_there]
            there = everything.intersection(*(always_there[s] for s in sources)) | always.get(node, frozenset())
            seen = frozenset[Producer]().union(*(possible[s] for s in sources))
            seen |= {(name, exits[flow.names[node]][0]) for name in may.get(node, ())}
            if (there, seen) != (always_there[node], possible[node]):
                always_there[node], possible[node], changed = there, seen, True
    return always_there, possible


def _beside(context: WorkflowContext, node: str, path: str, name: str, exits: list[str]) -> Iterator[Finding]:
    """W12 for an input that need not be there, but that a branch beside this one may produce."""
    for exit_ in exits if context.exit_flow.forks else ():
        other = context.exit_flow.exits[exit_][0]
        if other != node and context.exit_flow.parallel.may_overlap(node, other):
            message = f"{other!r} produces {name!r} beside {node!r}, not before it"
            yield Finding(path, "W12", message, f"Lead from {other!r} to {node!r}.")
            return


def _nearest(name: str, context: WorkflowContext, node: str) -> str:
    """Which subgraph gives it too late or under a similar name."""
    outputs = {n: other for other, s in context.subgraph_nodes() for n in s.definition.outputs}
    if name in outputs and outputs[name] != node:
        return f"{outputs[name]!r} produces it; lead from there to {node!r}."
    return did_you_mean(name, outputs) if outputs else "No subgraph has outputs."


def _path_without(context: WorkflowContext, at: int, name: str, always_there: dict[int, frozenset[str]]) -> str:
    flow, exits = context.exit_flow.flow, context.exit_flow.exits
    for number in flow.into[at]:
        source = flow.arcs[number].source
        if source in always_there and name not in always_there[source]:
            node, value = exits.get(flow.names[source], (flow.names[source], ""))
            return f": not when it comes from {node!r}" + (f" by its exit {value!r}" if value else "")
    return ""


def _twice(node: str, sg: SubgraphContext, before: frozenset[Producer]) -> Iterator[Finding]:
    for name in sg.definition.outputs:
        others = sorted(p for n, p in before if n == name and p != node)
        if others:
            message = f"{others[0]!r} may have produced {name!r} already on a way to {node!r}"
            yield Finding(f"{sg.path}.outputs.{name}", "W13", message, _own_name(sg, name))


def _own_name(sg: SubgraphContext | None, name: str) -> str:
    contract = sg.contract if sg is not None else None
    slot = contract is not None and any(n.startswith(NAME_SLOT) for n in contract.outputs)
    return f'Give it a name of its own: names={{"{SLOT if slot else name}": ...}}.'


def _twice_at_once(context: WorkflowContext, name: str, exits: list[str]) -> Iterator[Finding]:
    """W13 for branches that run side by side."""
    seen = set()
    for one, other in combinations(exits, 2):
        pair = (context.exit_flow.exits[one][0], context.exit_flow.exits[other][0])
        if pair[0] != pair[1] and pair not in seen and context.exit_flow.both_taken(one, other):
            seen.add(pair)
            sg = context.subgraph_of(pair[1])
            path = f"{sg.path}.outputs.{name}" if sg is not None else f"nodes.{pair[1]}"
            message = f"{pair[0]!r} and {pair[1]!r} can both produce {name!r} in one pass"
            yield Finding(path, "W13", message, _own_name(sg, name))


def _flowing_types(
    context: WorkflowContext, node: str, sg: SubgraphContext, before: frozenset[Producer]
) -> Iterator[Finding]:
    """D4 and D5 between subgraphs: the producer's contract against the consumer's."""
    for name, wanted in sg.inputs.items():
        for other in sorted({p for n, p in before if n == name}):
            producer = context.subgraph_of(other)
            given = producer.contract_types[1].get(name) if producer is not None else None
            if given is None or wanted.type is None or wanted.type.accepts(given):
                continue
            code = "D5" if wanted.type.name == given.name and wanted.type.is_list == given.is_list else "D4"
            message = f"{node!r} takes {wanted.type} and {other!r} gives {given}"
            yield Finding(f"{sg.path}.inputs.{name}", code, message)


RULES = (w11_contract,)
TOP_RULES = (producers,)
