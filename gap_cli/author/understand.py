"""From an instruction to goals: every reading of its words, in every scene of the task, of which one must be left."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from math import prod
from pathlib import Path
from typing import Any, NoReturn

from lark import Lark, Token, Tree
from lark.exceptions import UnexpectedEOF, UnexpectedToken
from lark.lexer import Lexer
from lark.visitors import CollapseAmbiguities

from gap_cli.author.goals import check_goals, refuse
from gap_cli.author.interpret import IncompleteError, Reading
from gap_cli.author.lexicon import SEPARATORS, lexicon
from gap_cli.author.scene import Scene
from gap_cli.author.things import Things
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.task.goals import Goals, same_goals
from gap_runtime.errors import InstructionError

MAX_TOKENS = 200  # a sentence of a hundred things; parsing takes a fraction of a second
MAX_READINGS = 200
PLACES = {"IN", "INSIDE", "TO", "UPON", "RELATION", "WITH"}


def understand(task: Task, instruction: str) -> Goals:
    """The goals of an instruction, in the scene that suits it: the one named after its first object where there is
    such a scene, else the first that holds everything it names.

    Raises `InstructionError` saying what was not understood, or that it can be read in several ways.
    """
    things = Things(task)
    trees = _parse(task, things, instruction)
    found: dict[str, Goals] = {}
    refused: list[InstructionError] = []
    for name in task.scenes:
        try:
            found[name] = _only_reading(task, things, Scene(task, name), trees)
        except InstructionError as error:
            refused.append(error)
    if not found:
        raise min(refused, key=lambda error: isinstance(error, AbsentError))
    first = next(iter(found.values()))
    named = [name for predicate in first.predicates() for name in predicate.roles.values()]
    return next((found[name] for name in named if name in found), first)


class AbsentError(InstructionError):
    """A scene that does not hold what is named; another one may."""


def _only_reading(task: Task, things: Things, scene: Scene, trees: list[Tree[Token]]) -> Goals:
    readings: list[Goals] = []
    refused: list[InstructionError] = []
    for tree in trees:
        try:
            goals = Reading(things, scene).goals(tree)
            check_goals(task, goals)
            _check_present(scene, things, goals)
        except InstructionError as error:
            refused.append(error)
        else:
            readings += [goals] if not any(same_goals(goals, other) for other in readings) else []
    if not readings:
        raise min(refused, key=lambda error: isinstance(error, IncompleteError))
    if len(readings) > 1:
        ways = "; or ".join(", ".join(p.fact for p in goals.predicates()) for goals in readings[:3])
        raise refuse(task, f"The instruction can be read in several ways: {ways}.")
    return readings[0]


def _check_present(scene: Scene, things: Things, goals: Goals) -> None:
    named = dict.fromkeys(name for p in goals.predicates() for name in p.roles.values())
    absent = [things.all[name] for name in named if not scene.has(things.all[name])]
    if absent:
        task = scene.task
        nowhere = [t for t in absent if not any(t.id in members for members in task.scenes.values())]
        labels = " and ".join(f"the {t.label}" for t in nowhere or (things.all[name] for name in named))
        where = "not in any scene" if nowhere else "not together in any scene"
        verb = "is" if len(nowhere or named) == 1 else "are"
        problem = f"{labels[0].upper()}{labels[1:]} {verb} {where} of task {task.name!r}."
        raise refuse(task, problem, kind=AbsentError)


class _Given(Lexer):
    """Hands on tokens that exist already."""

    def __init__(self, conf: Any) -> None: ...

    def lex(self, lexer_state: Any, parser_state: Any = None) -> Iterator[Token]:
        yield from lexer_state


@cache
def _parser() -> Lark:
    grammar = Path(__file__).with_name("grammar.lark").read_text(encoding="utf-8")
    terminals = sorted({*lexicon().terminals.values(), "WORD", "_LINK", "BREAK"})
    declared = f"{grammar}\n%declare {' '.join(terminals)}\n"
    return Lark(declared, parser="earley", lexer=_Given, ambiguity="explicit", maybe_placeholders=False)


def _parse(task: Task, things: Things, instruction: str) -> list[Tree[Token]]:
    """Every way to read the words, without what they mean."""
    words = lexicon().lex(instruction, things.names, things.known)
    if not words:
        raise refuse(task, "The instruction says nothing to do.")
    if len(words) > MAX_TOKENS:
        raise refuse(task, f"The instruction has {len(words)} words; at most {MAX_TOKENS} are read at once.")
    bad = next((token for token in words if token.type == "REFUSED"), None)
    if bad is not None:
        raise refuse(task, f"{str(bad)!r} is not served: {lexicon().reasons[bad]}.")
    try:
        forest = _parser().parse(words)
    except UnexpectedEOF:
        raise refuse(task, f"The instruction ends after {' '.join(words)!r}, where more should follow.") from None
    except UnexpectedToken as error:
        _fail_at(task, things, words, error)
    count = prod(len(tree.children) for tree in forest.find_data("_ambig"))
    if count > MAX_READINGS:
        raise refuse(task, "The instruction can be read in too many ways; give it in shorter sentences.")
    return list(CollapseAmbiguities().transform(forest))


def _fail_at(task: Task, things: Things, words: list[Token], error: UnexpectedToken) -> NoReturn:
    """Refuse at the token the parser could not go on from, saying what should stand there."""
    at = next(i for i, token in enumerate(words) if token is error.token)
    before = words[at - 1].type if at else "BREAK"
    expected = (
        "place" if before in PLACES or (before == "THE" and at > 1 and words[at - 2].type in PLACES) else "object"
    )
    expected = "action" if before in SEPARATORS.values() and "PUT" in error.expected else expected
    token = words[at]
    if token.type != "UNKNOWN":
        raise refuse(task, f"{str(token)!r} is not understood after {' '.join(words[:at]).lower() or 'nothing'!r}.")
    size = next((i for i, later in enumerate(words[at:]) if later.type != "UNKNOWN"), len(words) - at)
    text = " ".join(words[at : at + size])
    raise refuse(task, f"The {expected} {text!r} is not known.", word=text, known=things.phrases)
