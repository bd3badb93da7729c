"""Skills as planning steps: a skill's contract with its roles bound to objects, and which skills may be used at all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations

from gap_cli.skills import SkillLibrary
from gap_cli.skills.facts import Fact, Meaning, meaning
from gap_runtime.contracts.skill import NAME_SLOT, SkillContract
from gap_runtime.contracts.tool import ToolSpec
from gap_runtime.contracts.types.typeref import TypeRef

SLOT_ROLE = "name"  # the role whose name is spelled out in `<name>_obb`


@dataclass(frozen=True, order=True)
class Value:
    """What travels between skills: `obb` of `milk`. A name without a role belongs to the skill's first role."""

    name: str
    of: str


@dataclass(frozen=True)
class Port:
    """One input or output of a step: its name in the contract, what value it is, and of which type."""

    name: str
    value: Value
    type: TypeRef


@dataclass(frozen=True)
class Step:
    """One use of a skill. `binding` maps roles to object ids; `acts` is False when it only looks and computes."""

    skill: str
    binding: tuple[tuple[str, str], ...]
    needs: frozenset[Fact]
    adds: frozenset[Fact]
    deletes: frozenset[Fact]
    wants: tuple[Port, ...]
    gives: tuple[Port, ...]
    cost: float
    acts: bool

    @property
    def roles(self) -> dict[str, str]:
        """Role to object id."""
        return dict(self.binding)

    @property
    def required(self) -> tuple[Port, ...]:
        """Inputs that must have a value."""
        return tuple(port for port in self.wants if not port.type.optional)


@dataclass(frozen=True)
class Entry:
    """A usable skill, read once."""

    name: str
    contract: SkillContract
    meaning: Meaning
    wants: Mapping[str, TypeRef]
    gives: Mapping[str, TypeRef]
    acts: bool


@dataclass
class Repertoire:
    """The skills the symbolic author may use, and why each of the others was left out."""

    entries: list[Entry] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, library: SkillLibrary, tools: Mapping[str, ToolSpec]) -> Repertoire:
        """Sort the library's skills into usable and not."""
        found = cls()
        for name, contract in library.contracts.items():
            reason = _unusable(contract, tools)
            if reason:
                found.left_out[name] = reason
                continue
            acts = any(tools[t].effect == "actuate" for t in contract.tools)
            wants = {n: TypeRef.parse(t) for n, t in contract.inputs.items()}
            gives = {n: TypeRef.parse(t) for n, t in contract.outputs.items()}
            found.entries.append(Entry(name, contract, meaning(contract), wants, gives, acts))
        return found

    def achieving(self, fact: Fact, objects: Sequence[str]) -> Iterator[Step]:
        """Every step whose effects include the fact."""
        for entry in self.entries:
            for effect in sorted(entry.meaning.adds):
                partial = effect.unify(fact)
                if partial is not None:
                    yield from _groundings(entry, partial, objects)

    def producing(self, value: Value, type_: TypeRef, objects: Sequence[str]) -> Iterator[Step]:
        """Every step that gives the value in a type that may flow into `type_`."""
        for entry in self.entries:
            for name, given in entry.gives.items():
                role, short = split_name(entry.contract, name)
                if short == value.name and type_.accepts(given) and bool(role) == bool(value.of):
                    yield from _groundings(entry, {role: value.of} if role else {}, objects)


def split_name(contract: SkillContract, name: str) -> tuple[str, str]:
    """A contract name as (role it belongs to, name without the role): `target_obb` is ("target", "obb")."""
    if name.startswith(NAME_SLOT):
        return SLOT_ROLE, name.removeprefix(f"{NAME_SLOT}_")
    prefixes = [role for role in contract.roles if name.startswith(f"{role}_")]
    if prefixes:
        role = max(prefixes, key=len)
        return role, name.removeprefix(f"{role}_")
    return (contract.roles[0] if contract.roles else ""), name


def literal_source(contract: SkillContract, literal: str) -> tuple[str, str] | None:
    """Which role fills a literal, and with what: its `name`, or for goals that share its object the `nth`, `total`.

    `object_name` is the first role's name; others are `<role>_name`, `<role>_nth` (counted from 0), `<role>_total`.
    """
    if literal == "object_name" and contract.roles:
        return contract.roles[0], "name"
    role, _, what = literal.rpartition("_")
    return (role, what) if role in contract.roles and what in ("name", "nth", "total") else None


def _unusable(contract: SkillContract, tools: Mapping[str, ToolSpec]) -> str:
    """Why the symbolic author cannot place this skill in a graph, or ''."""
    if contract.kind != "composite" or contract.streaming:
        return "it is not a subgraph of its own"
    missing = [t for t in contract.tools if t not in tools]
    if missing:
        return f"no plugin serves its tool {missing[0]}"
    if any(tools[t].privileged for t in contract.tools):
        return "it reads ground truth"
    unknown = [n for n in contract.literals if literal_source(contract, n) is None]
    if unknown:
        return f"nothing in an instruction fills its {unknown[0]}"
    named = [n for n in (*contract.inputs, *contract.outputs) if n.startswith(NAME_SLOT)]
    if named and SLOT_ROLE not in contract.roles:
        return f"it has {named[0]} and no role {SLOT_ROLE!r}"
    return ""


def _groundings(entry: Entry, partial: Mapping[str, str], objects: Sequence[str]) -> Iterator[Step]:
    """The entry with its remaining roles bound to objects in every way; two roles never share an object."""
    free = [role for role in entry.contract.roles if role not in partial]
    rest = [name for name in objects if name not in partial.values()]
    for choice in permutations(rest, len(free)):
        yield _ground(entry, {**partial, **dict(zip(free, choice, strict=True))})


def _ground(entry: Entry, binding: Mapping[str, str]) -> Step:
    def port(name: str, type_: TypeRef) -> Port:
        role, short = split_name(entry.contract, name)
        return Port(name, Value(short, binding.get(role, "")), type_)

    facts = entry.meaning
    return Step(
        entry.name,
        tuple((role, binding[role]) for role in entry.contract.roles),
        needs=frozenset(f.bound(binding) for f in facts.needs),
        adds=frozenset(f.bound(binding) for f in facts.adds),
        deletes=frozenset(f.bound(binding) for f in facts.deletes),
        wants=tuple(port(n, t) for n, t in entry.wants.items()),
        gives=tuple(port(n, t) for n, t in entry.gives.items()),
        cost=entry.contract.cost,
        acts=entry.acts,
    )
