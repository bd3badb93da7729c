"""Symbolic facts as contracts write them: `hand_empty`, `holding(target)`, `-located(target)`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from gap_runtime.contracts.skill import SkillContract

_FACT = re.compile(r"^(?P<minus>-?)(?P<name>[a-z][a-z0-9_]*)(\((?P<args>[^()]*)\))?$")


@dataclass(frozen=True, order=True)
class Fact:
    """A statement about the world; its arguments are roles in a contract and object ids in a plan."""

    name: str
    args: tuple[str, ...] = ()

    def bound(self, binding: Mapping[str, str]) -> Fact:
        """This fact with its roles replaced by objects."""
        return Fact(self.name, tuple(binding[a] for a in self.args))

    def unify(self, ground: Fact) -> dict[str, str] | None:
        """The roles' objects that make this fact the ground one, or None."""
        if self.name != ground.name or len(self.args) != len(ground.args):
            return None
        binding: dict[str, str] = {}
        for role, value in zip(self.args, ground.args, strict=True):
            if binding.setdefault(role, value) != value:
                return None
        return binding

    def __str__(self) -> str:
        return f"{self.name}({', '.join(self.args)})" if self.args else self.name


def parse_fact(text: str) -> tuple[Fact, bool]:
    """The fact and whether it holds (False for `-fact`). Raises ValueError."""
    match = _FACT.match(text.strip())
    if match is None:
        raise ValueError(f"{text!r} is not a fact; write name, name(role), or -name(role)")
    args = tuple(a.strip() for a in match["args"].split(",")) if match["args"] else ()
    if not all(a.isidentifier() for a in args):
        raise ValueError(f"{text!r}: arguments must be names")
    return Fact(match["name"], args), not match["minus"]


@dataclass(frozen=True)
class PreconditionsEffects:
    """What a contract says symbolically: facts it needs, brings about, and ends. Arguments are its roles."""

    needs: frozenset[Fact]
    adds: frozenset[Fact]
    deletes: frozenset[Fact]


def preconditions_effects(contract: SkillContract) -> PreconditionsEffects:
    """Read needs and effects. Raises ValueError for a malformed fact or an argument that is no role."""
    needs = [parse_fact(text) for text in contract.needs]
    effects = [parse_fact(text) for text in contract.effects]
    for text, (_, holds) in zip(contract.needs, needs, strict=True):
        if not holds:
            raise ValueError(f"needs: {text!r}: only facts that hold can be needed")
    _check_roles(contract, [fact for fact, _ in [*needs, *effects]])
    return PreconditionsEffects(
        needs=frozenset(fact for fact, _ in needs),
        adds=frozenset(fact for fact, holds in effects if holds),
        deletes=frozenset(fact for fact, holds in effects if not holds),
    )


def _check_roles(contract: SkillContract, facts: Iterable[Fact]) -> None:
    for fact in facts:
        for role in fact.args:
            if role not in contract.roles:
                known = ", ".join(contract.roles) or "none"
                raise ValueError(f"{fact}: {role!r} is not a role (roles: {known})")
