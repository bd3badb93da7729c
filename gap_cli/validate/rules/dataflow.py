"""S13 and W11-W13: what flows between subgraphs, by name."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from gap_cli.analysis.scope import Scope, Whole
from gap_runtime.contracts.skill import NAME_SLOT
from gap_runtime.contracts.types.typeref import TypeRef
from gap_runtime.errors import did_you_mean
from gap_runtime.graph.findings import Finding
from gap_runtime.graph.names import SLOT


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
    made = _made(whole)
    names = sorted({n for s in whole.scopes.values() for n in s.definition.inputs} | set(made))
    bit = {name: 1 << i for i, name in enumerate(names)}
    sure, may = _available(whole, bit)
    for node, scope in whole.subgraph_nodes():
        at = whole.ways.flow.index[node]
        if at not in whole.ways.flow.rank:
            continue
        optional = {n for n, t in scope.contract_types[0].items() if t.optional}
        for name in scope.definition.inputs:
            path, ways = f"{scope.path}.inputs.{name}", made.get(name, [])
            if name in optional:
                yield from _beside(whole, node, path, name, ways)
            elif not any(n == name for n, _ in may[at]):
                message = f"no subgraph before {node!r} produces {name!r}"
                yield Finding(path, "S13", message, _nearest(name, whole, node))
            elif not sure[at] & bit[name] and not _brought_by_a_branch(whole, node, ways):
                without = _way_without(whole, at, bit[name], sure)
                yield Finding(path, "W12", f"{name!r} is not produced on every way to {node!r}{without}")
        yield from _twice(node, scope, may[at])
        yield from _flowing_types(whole, node, scope, may[at])
    yield from _twice_at_once(whole, made)


def _made(whole: Whole) -> dict[str, list[str]]:
    """For each name the exits (nodes of `whole.ways`) that give it."""
    found: dict[str, list[str]] = {}
    for way in whole.ways.exits:
        for name in sorted(_given(whole, way)):
            found.setdefault(name, []).append(way)
    return found


def _brought_by_a_branch(whole: Whole, node: str, ways: list[str]) -> bool:
    """True where branches join in this node, and one of them always brings what these exits give."""
    return whole.ways.forks and whole.ways.flow.one_surely_before(node, ways)


def _available(whole: Whole, bit: dict[str, int]) -> tuple[dict[int, int], dict[int, set[tuple[str, str]]]]:
    """Per node: names produced on every single path to it, and every (name, producing node) on any."""
    flow = whole.ways.flow
    sure = dict.fromkeys(flow.order, -1)
    sure[0] = 0
    may: dict[int, set[tuple[str, str]]] = {node: set() for node in flow.order}
    given = {flow.index[way]: _given(whole, way) for way in whole.ways.exits}
    changed = True
    while changed:
        changed = False
        for node in flow.order[1:]:
            sources = [s for number in flow.into[node] if (s := flow.arcs[number].source) in sure]
            mask, seen = -1, set[tuple[str, str]]()
            for source in sources:
                mask &= sure[source]
                seen |= may[source]
            if node in given:
                mask |= sum(bit[n] for n in given[node])
                seen |= {(n, whole.ways.exits[flow.names[node]][0]) for n in given[node]}
            if mask != sure[node] or seen != may[node]:
                sure[node], may[node], changed = mask, seen, True
    return sure, may


def _given(whole: Whole, way: str) -> frozenset[str]:
    """Names that are always there after an exit."""
    node, value = whole.ways.exits[way]
    scope = whole.scope_of(node)
    return scope.gives(value) if scope is not None else frozenset()


def _beside(whole: Whole, node: str, path: str, name: str, ways: list[str]) -> Iterator[Finding]:
    """W12 for an input that need not be there, but that a branch beside this one may produce."""
    for way in ways if whole.ways.forks else ():
        other = whole.ways.exits[way][0]
        if other != node and whole.ways.beside.may_overlap(node, other):
            message = f"{other!r} produces {name!r} beside {node!r}, not before it"
            yield Finding(path, "W12", message, f"Lead from {other!r} to {node!r}.")
            return


def _nearest(name: str, whole: Whole, node: str) -> str:
    """Which subgraph gives it too late or under a similar name."""
    outputs = {n: other for other, s in whole.subgraph_nodes() for n in s.definition.outputs}
    if name in outputs and outputs[name] != node:
        return f"{outputs[name]!r} produces it; lead from there to {node!r}."
    return did_you_mean(name, outputs) if outputs else "No subgraph has outputs."


def _way_without(whole: Whole, at: int, wanted: int, sure: dict[int, int]) -> str:
    flow, exits = whole.ways.flow, whole.ways.exits
    for number in flow.into[at]:
        source = flow.arcs[number].source
        if source in sure and not sure[source] & wanted:
            node, value = exits.get(flow.names[source], (flow.names[source], ""))
            return f": not when it comes from {node!r}" + (f" by its exit {value!r}" if value else "")
    return ""


def _twice(node: str, scope: Scope, before: set[tuple[str, str]]) -> Iterator[Finding]:
    for name in scope.definition.outputs:
        others = sorted(p for n, p in before if n == name and p != node)
        if others:
            message = f"{others[0]!r} has produced {name!r} already on a way to {node!r}"
            yield Finding(f"{scope.path}.outputs.{name}", "W13", message, _own_name(scope, name))


def _own_name(scope: Scope | None, name: str) -> str:
    contract = scope.contract if scope is not None else None
    slot = contract is not None and any(n.startswith(NAME_SLOT) for n in contract.outputs)
    return f'Give it a name of its own: names={{"{SLOT if slot else name}": ...}}.'


def _twice_at_once(whole: Whole, made: dict[str, list[str]]) -> Iterator[Finding]:
    """W13 for branches that run side by side."""
    for name, ways in made.items() if whole.ways.forks else ():
        seen = set()
        for one, other in combinations(ways, 2):
            pair = (whole.ways.exits[one][0], whole.ways.exits[other][0])
            if pair[0] != pair[1] and pair not in seen and whole.ways.both_taken(one, other):
                seen.add(pair)
                scope = whole.scope_of(pair[1])
                path = f"{scope.path}.outputs.{name}" if scope is not None else f"nodes.{pair[1]}"
                message = f"{pair[0]!r} and {pair[1]!r} can both produce {name!r} in one pass"
                yield Finding(path, "W13", message, _own_name(scope, name))


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
