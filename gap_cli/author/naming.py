"""Names for segments and for the values between them, so that no name is produced twice on a way through the graph."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count

from gap_cli.analysis.catalog import SLOT, substitute
from gap_cli.author.operators import SLOT_ROLE, producer_of, split_name
from gap_cli.author.topology import Use
from gap_runtime.contracts.skill import SkillContract


@dataclass(frozen=True)
class Named:
    """A use with its names: of the segment, of each contract name as this segment spells it, and `names` for that."""

    segment: str
    names: dict[str, str]
    inputs: dict[str, str]
    outputs: dict[str, str]


def name_uses(uses: Sequence[Use], contracts: Mapping[str, SkillContract]) -> list[Named]:
    """Name every use, those on the way on which nothing fails first. A value is called after the role its first
    consumer gives it: `target_obb`, `target_2_obb`."""
    produced = _producers(uses)
    roles: dict[int, dict[str, str]] = {}
    outputs: dict[int, dict[str, str]] = {}
    segments: dict[int, str] = {}
    for index in sorted(range(len(uses)), key=lambda i: (uses[i].layer is None, i)):
        use = uses[index]
        segments[index] = _segment(use, contracts[use.step.skill], {"done", "abort", *segments.values()})
        taken = {name for given in outputs.values() for name in given.values()}
        given, spelled = _outputs(index, uses, produced, contracts, taken)
        if use.twin is not None:
            given = {n: outputs[use.twin].get(n, w) for n, w in given.items()}
            spelled = roles[use.twin]
        outputs[index], roles[index] = given, spelled
    named = []
    for index, use in enumerate(uses):
        inputs = {port: outputs[source][name] for (at, port), (source, name) in produced.items() if at == index}
        names = _names(contracts[use.step.skill], roles[index], {**inputs, **outputs[index]})
        named.append(Named(segments[index], names, inputs, outputs[index]))
    return named


def _producers(uses: Sequence[Use]) -> dict[tuple[int, str], tuple[int, str]]:
    """For each use and input that has a producer, that use and its output, by their names in the contracts."""
    found = {}
    for index, use in enumerate(uses):
        before = {number: uses[number].step for number in use.before}
        for port in use.step.inputs:
            given = producer_of(port, before)
            if given is not None:
                found[index, port.name] = (given[0], given[1].name)
    return found


def _segment(use: Use, contract: SkillContract, taken: set[str]) -> str:
    name = contract.stage or use.step.skill.replace("-", "_")
    base = f"{name}_{use.step.binding[0][1]}" if use.step.binding else name
    return next(n for n in (base if i == 1 else f"{base}_{i}" for i in count(1)) if n not in taken)


def _outputs(
    index: int,
    uses: Sequence[Use],
    produced: Mapping[tuple[int, str], tuple[int, str]],
    contracts: Mapping[str, SkillContract],
    taken: set[str],
) -> tuple[dict[str, str], dict[str, str]]:
    """A use's outputs under fresh names, and the role names that spell them."""
    contract, ports = contracts[uses[index].step.skill], [port.name for port in uses[index].step.outputs]
    outputs: dict[str, str] = {}
    spelled: dict[str, str] = {}
    for role in dict.fromkeys(split_name(contract, name)[0] for name in ports):
        own = [name for name in ports if split_name(contract, name)[0] == role]
        base = _consumer_role(index, uses, produced, contracts, role) if role == SLOT_ROLE else role
        for number in count(1):
            word = base if number == 1 else f"{base}_{number}"
            names = {name: _spell(name, role, word, number) for name in own}
            if not taken & set(names.values()):
                break
        outputs |= names
        spelled[role] = word
    return outputs, spelled


def _spell(name: str, role: str, word: str, number: int) -> str:
    if role == SLOT_ROLE and name.startswith("<"):
        return substitute(name, {SLOT: word})
    if role and name.startswith(f"{role}_"):
        return substitute(name, {role: word})
    return name if number == 1 else f"{name}_{number}"


def _consumer_role(
    index: int,
    uses: Sequence[Use],
    produced: Mapping[tuple[int, str], tuple[int, str]],
    contracts: Mapping[str, SkillContract],
    role: str,
) -> str:
    """What the first consumer of this use's values calls their object; the object's own id when nobody reads them."""
    for (consumer, port), (source, name) in produced.items():
        called = split_name(contracts[uses[consumer].step.skill], port)[0]
        if source == index and name.startswith("<") and called and port.startswith(f"{called}_"):
            return called
    return uses[index].step.roles.get(role, role)


def _names(contract: SkillContract, roles: Mapping[str, str], wanted: Mapping[str, str]) -> dict[str, str]:
    """The shortest `names` under which the contract's names are spelled as wanted: roles first, exceptions after."""
    names = {SLOT: roles[SLOT_ROLE]} if SLOT_ROLE in roles else {}
    for role in contract.roles:
        endings = [(n.removeprefix(role), w) for n, w in wanted.items() if n.startswith(f"{role}_")]
        spelled = {w.removesuffix(end) for end, w in endings if w.endswith(end)}
        if len(spelled) == 1 and spelled != {role}:
            names[role] = spelled.pop()
    exact = {n: w for n, w in wanted.items() if substitute(n, names) != w}
    return {**names, **exact}
