"""How a subgraph spells its skill's names: `<name>_obb` as `target_obb`, and `target_obb` as `target_2_obb`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache

from gap_runtime.contracts.skill import NAME_SLOT, SkillContract
from gap_runtime.contracts.types.typeref import TypeRef

SLOT = "name"  # the key of `names` that fills NAME_SLOT
parse_type = lru_cache(maxsize=1024)(TypeRef.parse)


def contract_names(contract: SkillContract, names: Mapping[str, str]) -> tuple[dict[str, TypeRef], dict[str, TypeRef]]:
    """The contract's inputs and outputs with their types, spelled as `names` says."""
    return (
        {substitute(n, names): parse_type(t) for n, t in contract.inputs.items()},
        {substitute(n, names): parse_type(t) for n, t in contract.outputs.items()},
    )


def substitute(name: str, names: Mapping[str, str]) -> str:
    """One contract name as the subgraph spells it: exact name first, then `<name>`, then the longest role prefix.

    With `{target: target_2}`, `target_obb` becomes `target_2_obb`; with `{name: basket}`, `<name>_obb` becomes
    `basket_obb`.
    """
    if name in names and name != SLOT:
        return names[name]
    if name.startswith(NAME_SLOT):
        return names.get(SLOT, NAME_SLOT) + name.removeprefix(NAME_SLOT)
    roles = [r for r in names if r != SLOT and name.startswith(r + "_")]
    role = max(roles, key=len, default=None)
    return name if role is None else names[role] + name[len(role) :]


def infer_names(contract: SkillContract, names: Mapping[str, str], declared: Iterable[str]) -> dict[str, str]:
    """`names`, with the slot filled from the declared input and output names where only one filling explains them.

    A graph written to the paper's format declares `target_obb, target_mask` and says nothing of `<name> = target`.
    """
    suffixes = [n.removeprefix(NAME_SLOT) for n in [*contract.inputs, *contract.outputs] if n.startswith(NAME_SLOT)]
    if not suffixes or SLOT in names:
        return dict(names)
    fillings = {d.removesuffix(s) for d in declared for s in suffixes if d.endswith(s) and d != s}
    return {**names, SLOT: fillings.pop()} if len(fillings) == 1 else dict(names)
