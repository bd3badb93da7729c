"""From a sequence of steps to layers: looking comes as early as it may, and independent looks run side by side."""

from __future__ import annotations

from collections.abc import Sequence

from gap_cli.author.regress import supplier
from gap_cli.author.steps import Step


def layers(steps: Sequence[Step]) -> list[list[int]]:
    """Indices of the steps by layer; the members of one layer may run at the same time.

    A layer is one acting step, or every step that only looks and whose predecessors are done.
    """
    before = [_predecessors(steps, i) for i in range(len(steps))]
    done: set[int] = set()
    found: list[list[int]] = []
    while len(done) < len(steps):
        ready = [i for i in range(len(steps)) if i not in done and before[i] <= done]
        looks = [i for i in ready if not steps[i].acts]
        layer = looks or ready[:1]
        found.append(layer)
        done.update(layer)
    return found


def _predecessors(steps: Sequence[Step], index: int) -> set[int]:
    """The earlier steps that must be done before this one starts."""
    step = steps[index]
    found = {i for i in range(index) if _ordered(steps[i], step)}
    for port in step.wants:
        given = supplier(port, steps[:index])
        if given is not None:
            found.add(given[0])
    return found


def _ordered(first: Step, second: Step) -> bool:
    """True when swapping the two would change what either finds: actions, causes, threats."""
    causes = first.adds & second.needs
    threatens = second.deletes & (first.needs | first.adds)
    restores = first.deletes & (second.needs | second.adds)
    return bool((first.acts and second.acts) or causes or threatens or restores)
