"""S13 and W11-W13: what flows between subgraphs, by name."""

from __future__ import annotations

from collections.abc import Iterator

from gap_cli.contracts.skill import NAME_SLOT
from gap_cli.contracts.typeref import TypeRef
from gap_cli.errors import did_you_mean
from gap_cli.graph.findings import Finding
from gap_cli.graph.names import SLOT
from gap_cli.graph.scope import Scope, Whole


def w11_contract(scope: Scope) -> Iterator[Finding]:
    """W11: inputs are the skill's, outputs among the skill's, after substitution, type by type."""
    contract, d = scope.contract, scope.definition
    if contract is None:
        return
    yield from _substitutions(scope)
    inputs, outputs = scope.contract_types
    for name, type_ in inputs.items():
        if name not in d.inputs and not type_.optional:
            hint = f'Declare it: inputs={{"{name}": "{type_.name}"}}.'
            yield scope.find("W11", "inputs", f"{d.skill} needs {name!r} ({type_})", hint)
    for name, text in d.inputs.items():
        if name not in inputs:
            yield scope.find("W11", f"inputs.{name}", f"{d.skill} takes no {name!r}", _known(name, inputs))
        else:
            yield from _type(scope, f"inputs.{name}", text, inputs[name])
    for name in d.outputs:
        if name not in outputs:
            yield scope.find("W11", f"outputs.{name}", f"{d.skill} gives no {name!r}", _known(name, outputs))


def _known(name: str, names: dict[str, TypeRef]) -> str:
    return did_you_mean(name, names) if names else "It has none."


def _substitutions(scope: Scope) -> Iterator[Finding]:
    contract, d = scope.contract, scope.definition
    assert contract is not None
    known = {*contract.inputs, *contract.outputs, *contract.roles, SLOT}
    for key in d.names:
        if key not in known:
            message = f"{key!r} is neither a name nor a role of {d.skill}"
            yield scope.find("W11", f"names.{key}", message, did_you_mean(key, known))
    for part, contracted in (("inputs", contract.inputs), ("outputs", contract.outputs)):
        spelled = scope.contract_types[0 if part == "inputs" else 1]
        if any(n.startswith(NAME_SLOT) for n in spelled):
            hint = 'Write names={"name": "target"}.'
            yield scope.find("W11", part, f"nothing says what {NAME_SLOT} is", hint)
        elif len(spelled) < len(contracted):
            yield scope.find("W11", "names", f"two {part} of {d.skill} would have one name")


def _type(scope: Scope, path: str, text: str, wanted: TypeRef) -> Iterator[Finding]:
    try:
        declared = TypeRef.parse(text)
    except ValueError as error:
        yield scope.find("W11", path, str(error))
        return
    if not wanted.accepts(declared):
        yield scope.find("W11", path, f"is declared {declared}, and the skill takes {wanted}")


def producers(whole: Whole) -> Iterator[Finding]:
    """S13, W12, W13: every input is produced, on every path, by one subgraph of that path."""
    names = sorted({n for s in whole.scopes.values() for n in [*s.definition.inputs, *s.definition.outputs]})
    bit = {name: 1 << i for i, name in enumerate(names)}
    sure, may = _available(whole, bit)
    for node, scope in whole.subgraph_nodes():
        at = whole.flow.index[node]
        if at not in whole.flow.rank:
            continue
        optional = {n for n, t in scope.contract_types[0].items() if t.optional}
        for name in scope.definition.inputs:
            path = f"{scope.path}.inputs.{name}"
            if not any(n == name for n, _ in may[at]) and name not in optional:
                yield Finding(
                    path, "S13", f"no subgraph before {node!r} produces {name!r}", _nearest(name, whole, node)
                )
            elif not sure[at] & bit[name] and name not in optional:
                without = _way_without(whole, at, bit, bit[name], sure)
                yield Finding(path, "W12", f"{name!r} is not produced on every way to {node!r}{without}")
        yield from _twice(node, scope, may[at])
        yield from _flowing_types(whole, node, scope, may[at])


def _available(whole: Whole, bit: dict[str, int]) -> tuple[dict[int, int], dict[int, set[tuple[str, str]]]]:
    """Per node: names surely produced before it, and every (name, producing node) that may have been."""
    flow = whole.flow
    sure = dict.fromkeys(flow.order, -1)
    sure[0] = 0
    may: dict[int, set[tuple[str, str]]] = {node: set() for node in flow.order}
    changed = True
    while changed:
        changed = False
        for node in flow.order[1:]:
            mask, seen = -1, set()
            for number in flow.into[node]:
                arc = flow.arcs[number]
                if arc.source in sure:
                    given = _given(whole, arc.source, arc.value)
                    mask &= sure[arc.source] | sum(bit[n] for n in given)
                    name = flow.names[arc.source]
                    seen |= may[arc.source] | {(n, name) for n in given}
            if mask != sure[node] or seen != may[node]:
                sure[node], may[node], changed = mask, seen, True
    return sure, may


def _given(whole: Whole, source: int, value: str | None) -> frozenset[str]:
    scope = whole.scope_of(whole.flow.names[source]) if source else None
    return scope.gives(value) if scope is not None and value is not None else frozenset()


def _nearest(name: str, whole: Whole, node: str) -> str:
    """Which subgraph gives it too late or under a similar name."""
    outputs = {n: other for other, s in whole.subgraph_nodes() for n in s.definition.outputs}
    if name in outputs and outputs[name] != node:
        return f"{outputs[name]!r} produces it; lead from there to {node!r}."
    return did_you_mean(name, outputs) if outputs else "No subgraph has outputs."


def _way_without(whole: Whole, at: int, bit: dict[str, int], wanted: int, sure: dict[int, int]) -> str:
    flow = whole.flow
    for number in flow.into[at]:
        arc = flow.arcs[number]
        given = sum(bit[n] for n in _given(whole, arc.source, arc.value))
        if arc.source in sure and not (sure[arc.source] | given) & wanted:
            by = f" by its exit {arc.value!r}" if arc.value is not None else ""
            return f": not when it comes from {flow.names[arc.source]!r}{by}"
    return ""


def _twice(node: str, scope: Scope, before: set[tuple[str, str]]) -> Iterator[Finding]:
    for name in scope.definition.outputs:
        others = sorted(p for n, p in before if n == name and p != node)
        if others:
            message = f"{others[0]!r} has produced {name!r} already on a way to {node!r}"
            slot = scope.contract is not None and any(n.startswith(NAME_SLOT) for n in scope.contract.outputs)
            hint = f'Give it a name of its own: names={{"{SLOT if slot else name}": ...}}.'
            yield Finding(f"{scope.path}.outputs.{name}", "W13", message, hint)


def _flowing_types(whole: Whole, node: str, scope: Scope, before: set[tuple[str, str]]) -> Iterator[Finding]:
    """D4 and D5 between subgraphs: the producer's contract against the consumer's."""
    for name, wanted in scope.inputs.items():
        for other in sorted({p for n, p in before if n == name}):
            producer = whole.scope_of(other)
            given = producer.contract_types[1].get(name) if producer is not None else None
            if given is None or wanted.type is None or wanted.type.accepts(given):
                continue
            code = "D5" if wanted.type.name == given.name and wanted.type.is_list == given.is_list else "D4"
            message = f"{node!r} takes {wanted.type} and {other!r} gives {given}"
            yield Finding(f"{scope.path}.inputs.{name}", code, message)


RULES = (w11_contract,)
TOP_RULES = (producers,)
