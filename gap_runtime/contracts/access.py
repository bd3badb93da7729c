"""What each method of an arm, a gripper or a cell does: its effect and what it commands. The run's guard obeys it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any, Literal, TypeVar

Effect = Literal["pure", "sense", "actuate"]
F = TypeVar("F", bound=Callable[..., Any])
_MARK = "__access__"


@dataclass(frozen=True)
class Access:
    """`resources` must be leased by the node that calls. A `{name}` in them is an argument of the call (one resource
    for each of its keys or items, where it has several), or `{arm_id}`, the arm's own. A `privileged` method is out of
    reach of every node. One that is `always` allowed may be called by a node that was told to stop."""

    effect: Effect
    resources: tuple[str, ...] = ()
    privileged: bool = False
    always: bool = False


def access(effect: Effect, *resources: str, privileged: bool = False, always: bool = False) -> Callable[[F], F]:
    """Declare a method, or a property's getter, of a contract, or one that a plugin's class adds to it.

    `pure` reads a constant, `sense` a sensor, `actuate` commands. What is not declared cannot be called by a node.
    """

    def mark(method: F) -> F:
        setattr(method, _MARK, Access(effect, resources, privileged, always))
        return method

    return mark


@cache
def declared(cls: type) -> Mapping[str, Access]:
    """Every declared member of a class or Protocol, by name, its bases' included."""
    found: dict[str, Access] = {}
    for base in reversed(cls.__mro__):
        for name, member in vars(base).items():
            marked = getattr(member.fget if isinstance(member, property) else member, _MARK, None)
            if isinstance(marked, Access):
                found[name] = marked
    return MappingProxyType(found)
