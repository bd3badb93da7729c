"""Names for segments and for the values between them, so that no name is produced twice on a path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from gap_cli.analysis.catalog import SLOT, substitute
from gap_cli.author.regress import supplier
from gap_cli.author.steps import SLOT_ROLE, Step, split_name
from gap_runtime.contracts.skill import SkillContract

VERBS = {"perceive": "perceive", "grasp": "grasp", "transport": "transport", "place": "place", "operate": "operate"}


@dataclass(frozen=True)
class Named:
    """A step with its names: of the segment, of each contract name as this segment spells it, and `names` for that."""

    segment: str
    names: dict[str, str]
    inputs: dict[str, str]
    outputs: dict[str, str]


def name_steps(steps: Sequence[Step], contracts: Mapping[str, SkillContract]) -> list[Named]:
    """Name every step. A value is called after the role its first consumer gives it: `target_obb`, `target_2_obb`."""
    taken: set[str] = set()
    spelled: dict[tuple[int, str], str] = {}  # (step, output in its contract) -> name
    segments: list[str] = []
    named: list[Named] = []
    for index, step in enumerate(steps):
        contract = contracts[step.skill]
        segments.append(_fresh(_segment(step, contract), set(segments)))
        outputs, roles = _outputs(index, steps, contracts, taken)
        taken |= set(outputs.values())
        spelled |= {(index, output): name for output, name in outputs.items()}
        inputs: dict[str, str] = {}
        for port in step.wants:
            given = supplier(port, steps[:index])
            if given is not None:
                inputs[port.name] = spelled[given[0], given[1].name]
        names = _names(contract, roles, {**inputs, **outputs})
        named.append(Named(segments[-1], names, inputs, outputs))
    return named


def _segment(step: Step, contract: SkillContract) -> str:
    verb = VERBS.get(contract.stage or "", step.skill.replace("-", "_"))
    subject = step.binding[0][1] if step.binding else ""
    return f"{verb}_{subject}" if subject else verb


def _fresh(name: str, taken: set[str]) -> str:
    count = 2
    found = name
    while found in taken:
        found, count = f"{name}_{count}", count + 1
    return found


def _outputs(
    index: int, steps: Sequence[Step], contracts: Mapping[str, SkillContract], taken: set[str]
) -> tuple[dict[str, str], dict[str, str]]:
    """The step's outputs under fresh names, and the role names that spell them."""
    step, contract = steps[index], contracts[steps[index].skill]
    outputs: dict[str, str] = {}
    roles: dict[str, str] = {}
    for role in dict.fromkeys(split_name(contract, port.name)[0] for port in step.gives):
        ports = [p for p in step.gives if split_name(contract, p.name)[0] == role]
        base = _consumer_role(index, steps, contracts, role) if role == SLOT_ROLE else role
        count = 1
        while True:
            spelled = base if count == 1 else f"{base}_{count}"
            names = {p.name: _spell(p.name, role, spelled, count) for p in ports}
            if not taken & set(names.values()):
                break
            count += 1
        outputs |= names
        roles[role] = spelled
    return outputs, roles


def _spell(name: str, role: str, spelled: str, count: int) -> str:
    if role == SLOT_ROLE:
        return substitute(name, {SLOT: spelled})
    if role and name.startswith(f"{role}_"):
        return substitute(name, {role: spelled})
    return name if count == 1 else f"{name}_{count}"


def _consumer_role(index: int, steps: Sequence[Step], contracts: Mapping[str, SkillContract], role: str) -> str:
    """What the first consumer of this step's values calls their object; the object's own id when nobody reads them."""
    for later in range(index + 1, len(steps)):
        for port in steps[later].wants:
            given = supplier(port, steps[:later])
            if given is not None and given[0] == index:
                consumer = split_name(contracts[steps[later].skill], port.name)[0]
                if consumer and port.name.startswith(f"{consumer}_"):
                    return consumer
    return steps[index].roles.get(role, role)


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
