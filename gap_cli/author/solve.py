"""From goals to layers of steps: each goal is regressed from where the last one leaves the world."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from gap_cli.author.goals import Goal
from gap_cli.author.parallelize import layers
from gap_cli.author.regress import State, regress
from gap_cli.author.steps import Repertoire, Step
from gap_cli.skills.facts import Fact, parse_fact

INITIALLY = frozenset({Fact("hand_empty")})  # an episode starts with the arm at home and nothing held


def solve(goals: Sequence[Goal], repertoire: Repertoire) -> list[list[list[Step]]]:
    """For each goal, in order, its layers of steps; the members of one layer may run at the same time.

    Goals are not interleaved: what is seen for one goal is seen right before it, not before the arm has moved
    through the scene for another. No step undoes a goal already reached.
    Raises `InstructionError` when the skills cannot do it.
    """
    objects = list(dict.fromkeys(name for goal in goals for name in (goal.target, goal.container)))
    state, reached = State(INITIALLY), frozenset[Fact]()
    found: list[list[list[Step]]] = []
    for goal in goals:
        fact, _ = parse_fact(goal.fact)
        steps = regress(fact, state, repertoire, objects, keep=reached)
        rank = partial(_rank, [goal.target, goal.container, *objects])
        found.append([sorted((steps[i] for i in layer), key=rank) for layer in layers(steps)])
        state, reached = state.after(steps), reached | {fact}
    return found


def _rank(objects: Sequence[str], step: Step) -> list[int]:
    """The goal's own objects first, then others as the instruction names them."""
    return [objects.index(name) for _, name in step.binding]
