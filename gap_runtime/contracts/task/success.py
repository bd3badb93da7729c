"""The success conditions of a task: expressions over the world whose slots an instruction's goals fill."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping

from gap_runtime.contracts.models import unknown
from gap_runtime.contracts.predicates import check_expression

SLOTS = ("target", "container")  # what a goal says
_SLOT = re.compile(r"\{([^{}]*)\}")


def slots(expression: str) -> list[str]:
    """The names in braces, in order, each once."""
    return list(dict.fromkeys(_SLOT.findall(expression)))


def fill(expression: str, values: Mapping[str, str]) -> str:
    """The expression with its slots filled. Raises `KeyError` with the slot that has no value."""
    return _SLOT.sub(lambda match: values[match[1]], expression)


def asks_about_something(expression: str) -> bool:
    """Whether it names an object, a joint or an arm; what cannot be read may."""
    checked = check_expression(expression)
    return bool(checked.bodies or checked.joints or checked.arms or checked.problems)


def condition_problems(
    conditions: Mapping[str, str], known: Mapping[str, Collection[str]], slots_given: Collection[str] = SLOTS
) -> Iterator[tuple[str, str]]:
    """What is wrong with conditions where these `bodies`, `joints`, `contacts` and `arms` (by number) are known."""
    filled = [f"{{{slot}}}" for slot in slots_given]
    for name, expression in conditions.items():
        unfilled = [slot for slot in slots(expression) if slot not in slots_given]
        if unfilled:
            given = f"goals fill {' and '.join(filled)}" if filled else "name the object"
            yield name, f"{expression!r}: no goal says what {{{unfilled[0]}}} is; {given}"
            continue
        checked = check_expression(expression)
        for problem in checked.problems:
            yield name, f"{expression!r}: {problem.message}. {problem.hint}".rstrip()
        if checked.kind not in ("truth", "?"):
            yield name, f"{expression!r} is a {checked.kind}, not a condition. Compare it: ... > 0.05."
        elif not checked.problems and not checked.asks:
            yield name, f"{expression!r} asks nothing of the world"
        asked = {
            "bodies": checked.bodies, "joints": checked.joints, "arms": map(str, checked.arms),
            "contacts": (text.partition(":")[0] for text in checked.touched),
        }  # fmt: skip
        for kind, names in asked.items():
            wanted = [(name, one) for one in names if one not in filled and kind in known]
            for _, text in unknown(wanted, known.get(kind, ()), f"one of the task's {kind}"):
                yield name, f"{expression!r}: {text}"
