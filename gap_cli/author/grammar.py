"""From an instruction to goals: a recursive-descent parser that consumes every word or refuses the sentence.

    instruction  clause { separator clause }
    clause       PUT [things] [source] [goal] | TAKE things [source] [goal] | FILL container WITH things
                 | goal PUT things | things GOES goal | things [goal]
    things       thing { (AND | COMMA) thing } | IT | THEM
    goal         IN container | IN IT | THERE

A TAKE or PUT without a goal leaves its things in hand: a later clause must say where they go.
"""

from __future__ import annotations

from typing import NoReturn

from gap_cli.author.goals import Goal, check_goals, refuse
from gap_cli.author.lexicon import Kind
from gap_cli.author.vocabulary import Lexeme, Vocabulary
from gap_runtime.contracts.task import Task

_SEPARATORS = {Kind.AND, Kind.THEN, Kind.COMMA, Kind.STOP, Kind.FILLER}
_VERBS = {Kind.PUT, Kind.TAKE, Kind.FILL}
_THINGS = {Kind.THE, Kind.OBJECT, Kind.BOTH, Kind.IT, Kind.THEM}
_NO_THING = {Kind.UNKNOWN, Kind.COUNT, Kind.ALL, Kind.NOT}
_GOAL = {Kind.IN, Kind.THERE}
_END = Lexeme(Kind.STOP, "the end")


def parse_instruction(task: Task, instruction: str) -> tuple[Goal, ...]:
    """The goals of the sentence, in its order. Raises `InstructionError` saying what was not understood."""
    goals = _Parser(task, instruction).parse()
    check_goals(task, goals)
    return goals


class _Parser:
    def __init__(self, task: Task, instruction: str) -> None:
        self.task = task
        self.words = Vocabulary(task)
        self.lexemes = self.words.lex(instruction)
        self.at = 0
        self.goals: list[Goal] = []
        self.pending: list[str] = []  # picked up or mentioned, and not yet told where to go
        self.last: list[str] = []  # what "it" and "them" mean when nothing is pending
        self.container: str | None = None

    def parse(self) -> tuple[Goal, ...]:
        self.skip(_SEPARATORS | {Kind.WANT})
        if self.done:
            raise refuse(self.task, "The instruction says nothing to do.")
        while not self.done:
            self.clause()
            self.skip(_SEPARATORS)
        if self.pending:
            what = self.listed(self.pending)
            raise refuse(self.task, f"The instruction does not say which container the {what} should go into.")
        return tuple(self.goals)

    def clause(self) -> None:
        kind = self.next.kind
        if kind in _VERBS:
            self.verb_clause()
        elif kind in _GOAL:
            container = self.goal()
            self.skip({Kind.COMMA})
            self.take(Kind.PUT, Kind.TAKE)
            self.place(self.things(), container)
        elif kind in _THINGS:
            self.bare_clause()
        else:
            self.fail("the action")

    def verb_clause(self) -> None:
        verb = self.take(*_VERBS)
        self.skip({Kind.UP})
        if verb.kind is Kind.TAKE and self.next.kind is Kind.AND and self.peek(1).kind is Kind.PUT:
            self.at += 1  # "pick and place the milk": one action
            return self.verb_clause()
        if verb.kind is Kind.FILL and self.fills():
            container = self.container_name()
            self.take(Kind.WITH)
            return self.place(self.things(), container)
        things = self.things() if self.next.kind in _THINGS else []
        if not things and self.next.kind in _NO_THING:
            self.fail("the object")
        self.skip({Kind.UP})
        source = self.source()
        if self.next.kind in _GOAL:
            return self.place(things or self.in_hand(verb), self.goal())
        if source and verb.kind is not Kind.TAKE:
            raise refuse(self.task, f"Things can be put into containers, not {source!r}.")
        self.pending += [t for t in things or self.in_hand(verb) if t not in self.pending]
        return None

    def bare_clause(self) -> None:
        """Things without a verb: 'the milk goes in the basket', or the end of '..., and the ketchup too'."""
        things = self.things()
        self.source()
        stated = self.next.kind is Kind.GOES
        self.skip({Kind.GOES})
        if self.next.kind in _GOAL:
            return self.place(things, self.goal())
        if stated or self.container is None or self.pending:
            what = self.listed(things)
            raise refuse(self.task, f"The instruction does not say what to do with the {what}.")
        return self.place(things, self.container)

    def place(self, things: list[str], container: str) -> None:
        self.goals += [Goal(thing, container) for thing in things]
        self.pending = [p for p in self.pending if p not in things]
        self.last, self.container = things, container

    def things(self) -> list[str]:
        """One or more objects, or a pronoun for them."""
        if self.next.kind is Kind.BOTH and self.peek(1).kind not in {Kind.THE, Kind.OBJECT}:
            return self.pronoun(several=True, exactly=2)
        if self.next.kind in {Kind.IT, Kind.THEM}:
            return self.pronoun(several=self.next.kind is Kind.THEM)
        both = self.next.kind is Kind.BOTH
        self.skip({Kind.BOTH})
        found = [self.thing()]
        while self.another():
            self.skip(_SEPARATORS)
            found.append(self.thing())
        if both and len(found) != 2:
            raise refuse(self.task, f"'both' is followed by {len(found)} object(s): {self.listed(found)}.")
        return found

    def another(self) -> bool:
        """A separator, then one more thing (known or not), and not a new clause."""
        ahead = 0
        while self.peek(ahead).kind in {Kind.AND, Kind.COMMA} or (ahead and self.peek(ahead).kind is Kind.THEN):
            ahead += 1
        return ahead > 0 and self.peek(ahead).kind in {Kind.THE, Kind.OBJECT}

    def thing(self) -> str:
        self.skip({Kind.THE})
        if self.next.kind is not Kind.OBJECT:
            self.fail("the object")
        lexeme = self.take(Kind.OBJECT)
        if len(lexeme.ids) > 1:
            names = " or ".join(f"the {self.words.label(i)}" for i in lexeme.ids)
            raise refuse(self.task, f"{lexeme.text!r} could be {names}.")
        return lexeme.ids[0]

    def pronoun(self, *, several: bool, exactly: int | None = None) -> list[str]:
        word = self.take(Kind.IT, Kind.THEM, Kind.BOTH).text
        meant = list(self.pending or self.last)
        if not meant:
            raise refuse(self.task, f"{word!r} refers to nothing mentioned before.")
        if (len(meant) > 1) != several or (exactly is not None and len(meant) != exactly):
            raise refuse(self.task, f"{word!r} does not fit the {self.listed(meant)} mentioned before.")
        return meant

    def in_hand(self, verb: Lexeme) -> list[str]:
        if not self.pending:
            raise refuse(self.task, f"The instruction does not say what to {verb.text}.")
        return list(self.pending)

    def source(self) -> str:
        """'from the floor', 'on the table': where the things are now; '' when not said."""
        start = self.at
        if self.next.kind is Kind.FROM or self.next.text == "on":
            self.at += 1
            self.skip({Kind.THE})
            if self.next.kind is Kind.SUPPORT:
                self.at += 1
                return " ".join(lexeme.text for lexeme in self.lexemes[start : self.at])
            self.at = start
            self.fail("the place")
        return ""

    def goal(self) -> str:
        if self.next.kind is Kind.THERE:
            return self.container_pronoun()
        self.take(Kind.IN)
        name = self.container_pronoun() if self.next.kind is Kind.IT else self.container_name()
        if self.next.text == "on":
            self.source()
        return name

    def container_name(self) -> str:
        self.skip({Kind.THE})
        if self.next.kind is not Kind.OBJECT:
            self.fail("the container")
        return self.thing()

    def container_pronoun(self) -> str:
        word = self.take(Kind.IT, Kind.THERE).text
        if self.container is None:
            raise refuse(self.task, f"{word!r} refers to no container mentioned before.")
        return self.container

    def fills(self) -> bool:
        """A container and 'with' come next."""
        ahead = 1 if self.next.kind is Kind.THE else 0
        return self.peek(ahead).kind is Kind.OBJECT and self.peek(ahead + 1).kind is Kind.WITH

    @property
    def done(self) -> bool:
        return self.at >= len(self.lexemes)

    @property
    def next(self) -> Lexeme:
        return self.peek(0)

    def peek(self, ahead: int) -> Lexeme:
        return self.lexemes[self.at + ahead] if self.at + ahead < len(self.lexemes) else _END

    def take(self, *kinds: Kind) -> Lexeme:
        if self.next.kind not in kinds:
            self.fail(kinds[0].value)
        self.at += 1
        return self.lexemes[self.at - 1]

    def skip(self, kinds: set[Kind]) -> None:
        while not self.done and self.next.kind in kinds:
            self.at += 1

    def listed(self, names: list[str]) -> str:
        return " and ".join(self.words.label(n) for n in names)

    def fail(self, expected: str) -> NoReturn:
        """Refuse at the next word, saying what kind of word stood in the way."""
        word = self.next
        if self.done:
            raise refuse(self.task, f"The instruction ends where {expected} should follow.")
        if word.kind is Kind.UNKNOWN:
            run = self.lexemes[self.at :]
            size = next((i for i, lexeme in enumerate(run) if lexeme.kind is not Kind.UNKNOWN), len(run))
            text = " ".join(lexeme.text for lexeme in run[:size])
            raise refuse(
                self.task, f"{expected.capitalize()} {text!r} is not known.", word=text, known=self.words.phrases
            )
        why = {
            Kind.COUNT: "there is one of each object; name them",
            Kind.ALL: "name the objects one by one",
            Kind.NOT: "say only what should be done",
            Kind.RELATION: "things can be put into containers",
        }.get(word.kind)
        raise refuse(self.task, f"{word.text!r} is not understood here" + (f": {why}." if why else "."))
