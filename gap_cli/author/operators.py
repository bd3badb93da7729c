"""Skills as planning operators: a contract with its roles bound to objects, and which skills may be used at all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations

from gap_cli.skills import SkillLibrary
from gap_cli.skills.facts import Fact, PreconditionsEffects, preconditions_effects
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
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    cost: float
    acts: bool

    @property
    def roles(self) -> dict[str, str]:
        """Role to object id."""
        return dict(self.binding)

    @property
    def required(self) -> tuple[Port, ...]:
        """Inputs that must have a value."""
        return tuple(port for port in self.inputs if not port.type.optional)


@dataclass(frozen=True)
class Operator:
    """A usable skill, read once."""

    name: str
    contract: SkillContract
    facts: PreconditionsEffects
    inputs: Mapping[str, TypeRef]
    outputs: Mapping[str, TypeRef]
    acts: bool

    def ground(self, binding: Mapping[str, str]) -> Step:
        """The operator with its roles bound to objects."""

        def port(name: str, type_: TypeRef) -> Port:
            role, short = split_name(self.contract, name)
            return Port(name, Value(short, binding.get(role, "")), type_)

        return Step(
            self.name,
            tuple((role, binding[role]) for role in self.contract.roles),
            needs=frozenset(f.bound(binding) for f in self.facts.needs),
            adds=frozenset(f.bound(binding) for f in self.facts.adds),
            deletes=frozenset(f.bound(binding) for f in self.facts.deletes),
            inputs=tuple(port(n, t) for n, t in self.inputs.items()),
            outputs=tuple(port(n, t) for n, t in self.outputs.items()),
            cost=self.contract.cost,
            acts=self.acts,
        )

    def groundings(self, partial: Mapping[str, str], objects: Sequence[str]) -> Iterator[Step]:
        """Its remaining roles bound to objects in every way; two roles never share an object."""
        free = [role for role in self.contract.roles if role not in partial]
        rest = [name for name in objects if name not in partial.values()]
        for choice in permutations(rest, len(free)):
            yield self.ground({**partial, **dict(zip(free, choice, strict=True))})


@dataclass
class OperatorLibrary:
    """The skills the symbolic author may use, and why each of the others was left out. An operator with an exhausted
    exit, which gives one object after another, is the head of a loop and no step of a plan."""

    operators: dict[str, Operator] = field(default_factory=dict)
    left_out: dict[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, library: SkillLibrary, tools: Mapping[str, ToolSpec]) -> OperatorLibrary:
        """Sort the library's skills into usable and not."""
        found = cls()
        for name, contract in library.contracts.items():
            reason = _unusable(contract, tools)
            if reason:
                found.left_out[name] = reason
                continue
            acts = any(tools[t].effect == "actuate" for t in contract.tools)
            inputs = {n: TypeRef.parse(t) for n, t in contract.inputs.items()}
            outputs = {n: TypeRef.parse(t) for n, t in contract.outputs.items()}
            facts = preconditions_effects(contract)
            found.operators[name] = Operator(name, contract, facts, inputs, outputs, acts)
        return found

    @property
    def heads(self) -> list[Operator]:
        """Operators that give one object after another."""
        return [o for o in self.operators.values() if o.contract.exits.exhausted is not None]

    @property
    def steps(self) -> list[Operator]:
        """Operators a plan is made of."""
        return [o for o in self.operators.values() if o.contract.exits.exhausted is None]

    def swaps(self, skill: str) -> list[Operator]:
        """What the skill declares as its swaps, in its order."""
        names = [name.replace("_", "-") for name in self.operators[skill].contract.swaps]
        return [self.operators[name] for name in names if name in self.operators]

    def only(self, skill: str) -> OperatorLibrary:
        """The library in which nothing else brings about what this skill does."""
        adds = self.operators[skill].facts.adds
        kept = {n: o for n, o in self.operators.items() if n == skill or not adds <= o.facts.adds}
        return OperatorLibrary(kept, self.left_out)

    def achieving(self, fact: Fact, objects: Sequence[str]) -> Iterator[Step]:
        """Every step whose effects include the fact."""
        for operator in self.steps:
            for effect in sorted(operator.facts.adds):
                partial = effect.unify(fact)
                if partial is not None:
                    yield from operator.groundings(partial, objects)

    def producing(self, value: Value, type_: TypeRef, objects: Sequence[str]) -> Iterator[Step]:
        """Every step that gives the value in a type that may flow into `type_`."""
        for operator in self.steps:
            for name, given in operator.outputs.items():
                role, short = split_name(operator.contract, name)
                if short == value.name and type_.accepts(given) and bool(role) == bool(value.of):
                    yield from operator.groundings({role: value.of} if role else {}, objects)

    def reason(self, step: Step, facts: frozenset[Fact]) -> str:
        """Why this skill and no other of the same effects, where `facts` hold of the things themselves."""
        ours = self.operators[step.skill]
        others = [o for o in self.steps if o.name != step.skill and ours.facts.adds == o.facts.adds]
        told = []
        for other in sorted(others, key=lambda o: (o.contract.cost, o.name)):
            needs = [str(f) for f in sorted(other.ground(step.roles).needs - step.needs - facts)]
            told.append(f"{other.name} needs {', '.join(needs)}" if needs else f"{other.name} {other.contract.cost:g}")
        return f"cost {step.cost:g}; {', '.join(told)}" if told else "the only one"


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
    """Which role fills a literal, and with what: its `name`, for a loop the `names` of all it goes through, or for
    goals that share its object the `nth`, counted from 0, and `total`.

    `object_name` and `object_names` are the first role's; others are `<role>_name`, `<role>_nth`, `<role>_total`.
    """
    role, _, what = literal.rpartition("_")
    if role == "object" and contract.roles:
        role = contract.roles[0]
    return (role, what) if role in contract.roles and what in ("name", "names", "nth", "total") else None


def producer_of(port: Port, before: Mapping[int, Step]) -> tuple[int, Port] | None:
    """The last of the steps before that gives what `port` takes, by its number, and the output that does."""
    for number, step in reversed(list(before.items())):
        for given in step.outputs:
            if given.value == port.value and port.type.accepts(given.type):
                return number, given
    return None


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
