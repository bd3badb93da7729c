"""From a parse tree to goals: what each part of an instruction asks for, and in which order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

from lark import Token, Tree

from gap_cli.author.goals import refuse
from gap_cli.author.lexicon import lexicon
from gap_cli.author.noun_phrases import Chosen, NounPhrases, listed, marks_of, subtrees
from gap_cli.author.things import Thing
from gap_runtime.contracts.task.goals import EACH, ForEach, Goals, Group, Predicate
from gap_runtime.errors import InstructionError

UNRANKED = 1000.0  # the rank of what no ordinal speaks of: after "first", before "last"
SOON = 1e-3  # between parts that follow one another
STATES = {"OPEN": "open", "CLOSE": "closed", "UPON": "turned_on", "AWAY": "turned_off"}


class IncompleteError(InstructionError):
    """A reading that leaves something open; another one may not."""


@dataclass
class Ask:
    """What one part of an instruction asks for, and its rank among the parts; equal ranks are in any order."""

    goals: list[Predicate | ForEach]
    rank: float
    ordinal: bool = False


@dataclass
class Reading(NounPhrases):
    """One reading of an instruction. `act` is what was said last, which bare things share; `there` is what "it" means
    after a preposition. Raises `InstructionError` where it makes no sense."""

    asks: list[Ask] = field(default_factory=list)
    there: Chosen | None = None
    act: Callable[[list[Chosen]], None] | None = None
    now: float = UNRANKED
    held_ordinal: float | None = None

    def goals(self, tree: Tree[Token]) -> Goals:
        """The goals of the whole instruction."""
        self.visit(tree)
        if self.held:
            problem = f"The instruction does not say where {listed(self.held)} should go."
            raise refuse(self.scene.task, problem, kind=IncompleteError)
        given = sorted(ask.rank for ask in self.asks if ask.ordinal and ask.rank < UNRANKED)
        if given != [float(n) for n in range(1, len(given) + 1)]:
            self.fail("The instruction must say once each what is first, second and so on.")
        ranks = sorted({ask.rank for ask in self.asks})
        groups = [[goal for ask in self.asks if ask.rank == rank for goal in ask.goals] for rank in ranks]
        if len(groups) == 1:
            return Goals(scene=self.scene.name, goals=[*groups[0]])
        parts = [group[0] if len(group) == 1 else Group(goals=[*group]) for group in groups]
        return Goals(scene=self.scene.name, order="sequence", goals=[*parts])

    def start(self, tree: Tree[Token]) -> None:
        """Parts that follow one another."""
        for part in tree.children:
            if isinstance(part, Tree):
                self.visit(part)
            elif part == "THEN":
                self.now += SOON

    def around(self, tree: Tree[Token]) -> None:
        """A chain, and what is to be done right before or after it."""
        parts = [child for child in tree.children if isinstance(child, Tree)]
        main, other = parts if isinstance(tree.children[0], Tree) else parts[::-1]
        sign = -1 if "AFTER" in marks_of(tree) else 1
        rank, start = self.now, len(self.asks)
        leads = tree.children[0] is not main and other.data != "bare"  # bare things lean on what the chain says
        for part in (other, main) if leads else (main, other):
            self.now = rank if part is main else rank + sign * SOON / 10
            self.visit(part)
        self.now = rank + SOON / 5
        if any(ask.ordinal for ask in self.asks[start:]):
            self.fail("The instruction gives one thing two places in the order.")

    def ranked(self, tree: Tree[Token]) -> None:
        """A part with its ordinal; that of picking up is that of putting down."""
        start, held = len(self.asks), len(self.held)
        for child in tree.children:
            if isinstance(child, Tree):
                self.visit(child)
        word = marks_of(tree)["ORDINAL"]
        rank = float(lexicon().meaning[word])
        if len(self.held) > held:
            self.held_ordinal = rank
        elif len(self.asks) == start:
            self.fail(f"It is not clear what is to be {word}.")
        for ask in self.asks[start:]:
            ask.rank, ask.ordinal = rank, True

    def sorted(self, tree: Tree[Token]) -> None:
        """Goals of numbered things, by their numbers."""
        start = len(self.asks)
        self.visit_children(tree)
        sign = int(lexicon().meaning[marks_of(tree)["SORTED"]])
        spread: list[tuple[int, Predicate]] = []
        for goal in (goal for ask in self.asks[start:] for goal in ask.goals):
            for one in goal.chosen() if isinstance(goal, ForEach) else [goal]:
                varying = goal.each if isinstance(goal, ForEach) else list(one.roles.values())
                numbers = [t.number for t in map(self.vocabulary.all.get, one.roles.values()) if t and t.id in varying]
                if not numbers or numbers[-1] is None:
                    self.fail(f"Of {one.fact}, nothing is numbered, so its order is not known.")
                spread.append((sign * numbers[-1], one))
        ranked = sorted(spread, key=lambda item: item[0])
        rank = self.asks[start].rank
        self.asks[start:] = [Ask([goal], rank + n * SOON / 1000) for n, (_, goal) in enumerate(ranked)]

    def put(self, tree: Tree[Token]) -> None:
        """Things shall be somewhere. Without things, those in hand."""
        things: list[Chosen] = []
        place: tuple[str, Chosen] | None = None
        for child in tree.children:
            if isinstance(child, Tree) and child.data == "things":
                things = self.visit(child)
            elif isinstance(child, Tree) and child.data == "goal":
                place = self.visit(child)
        assert place is not None
        if subtrees(tree, "exclusion"):
            things = [Chosen(self.without([t for c in things for t in c.things], tree))]
        if not (things or self.held):
            self.fail("The instruction does not say what to put there.")
        self.deliver(*place, things or list(self.held))

    def goal(self, tree: Tree[Token]) -> tuple[str, Chosen]:
        """The relation that shall hold, and to what."""
        marks = marks_of(tree)
        below = [child for child in tree.children if isinstance(child, Tree)]
        if not below or marks_of(below[0]).keys() & {"IT"}:
            if self.there is None:
                self.fail(
                    f"{' '.join(map(str, tree.scan_values(lambda _: True)))!r} refers to no place mentioned before."
                )
            where = self.there
        else:
            found = self.visit(below[0])
            if len(found) != 1:
                self.fail(f"{listed(found)} cannot be one place.")
            where = found[0]
        if "RELATION" in marks:
            return str(lexicon().meaning[marks["RELATION"]]), where
        if "TO" in marks and not all(self.holds(thing) for thing in where.things):
            self.fail(f"'to' does not say whether in or on {listed([where])}.")
        return "on" if "UPON" in marks else "in", where

    def holds(self, thing: Thing) -> bool:
        """Whether things can be put into it."""
        model = self.scene.task.objects.get(thing.id)
        return model is not None and model.is_container

    def deliver(self, predicate: str, where: Chosen, things: list[Chosen]) -> None:
        """Ask for the things to be there."""
        goals: list[Predicate | ForEach] = []
        for chosen in things:
            moved = [t.id for t in chosen.things if len(chosen.things) == 1 or t not in where.things]
            if any(self.vocabulary.all[thing].kind != "object" for thing in moved):
                self.fail(f"{listed([chosen])} cannot be moved.".capitalize())
            goals.append(self.over(predicate, moved, [t.id for t in where.things], chosen.count or where.count))
        ordinal = self.held_ordinal if any(chosen in self.held for chosen in things) else None
        self.asks.append(Ask(goals, self.now if ordinal is None else ordinal, ordinal is not None))
        self.held = [chosen for chosen in self.held if chosen not in things]
        self.held_ordinal = self.held_ordinal if self.held else None
        self.last, self.there, self.act = things, where, partial(self.deliver, predicate, where)

    def over(self, predicate: str, first: list[str], second: list[str], count: int | None) -> Predicate | ForEach:
        """The predicate of one thing and another, for each of the several that one of the two are."""
        roles = lexicon().roles[predicate]
        if len(first) == 1 and len(second) == 1:
            return Predicate(predicate=predicate, roles=dict(zip(roles, (first[0], second[0]), strict=True)))
        if len(first) > 1 and len(second) > 1:
            self.fail("Several things cannot be put in several places at once.")
        pair = (EACH, second[0]) if len(first) > 1 else (first[0], EACH)
        goal = Predicate(predicate=predicate, roles=dict(zip(roles, pair, strict=True)))
        return ForEach(each=first if len(first) > 1 else second, count=count, goal=goal)

    def hold(self, tree: Tree[Token]) -> None:
        """Things are picked up; where they go is said later."""
        self.take(self.visit(subtrees(tree, "things")[0]))

    def take(self, things: list[Chosen]) -> None:
        """The things are in hand."""
        self.held += [chosen for chosen in things if chosen not in self.held]
        self.act = self.take

    def fill(self, tree: Tree[Token]) -> None:
        """A container shall hold things."""
        found = self.visit(subtrees(tree, "np")[0])
        if len(found) != 1 or len(found[0].things) != 1:
            self.fail(f"{listed(found)} cannot be one place.")
        self.deliver("in", found[0], self.visit(subtrees(tree, "things")[0]))

    def operate(self, tree: Tree[Token]) -> None:
        """Things shall be open, closed, on or off."""
        state = next(STATES[mark] for mark in STATES if mark in marks_of(tree))
        self.bring(state, self.visit(subtrees(tree, "things")[0]))

    def bring(self, state: str, things: list[Chosen]) -> None:
        """Ask for the things to be in the state."""
        role = lexicon().roles[state][0]
        goals: list[Predicate | ForEach] = []
        for chosen in things:
            parts = [self.part(thing) for thing in chosen.things]
            one = Predicate(predicate=state, roles={role: parts[0] if len(parts) == 1 else EACH})
            goals.append(one if len(parts) == 1 else ForEach(each=parts, count=chosen.count, goal=one))
        self.asks.append(Ask(goals, self.now))
        self.last, self.act = things, partial(self.bring, state)
        self.there = things[0] if len(things) == 1 else None

    def part(self, thing: Thing) -> str:
        """What of a thing is opened or turned: its only joint, where it has one."""
        joints = [t.id for t in self.vocabulary.all.values() if t.kind == "joint" and t.id.startswith(f"{thing.id}_")]
        return joints[0] if thing.kind == "object" and len(joints) == 1 else thing.id

    def same(self, tree: Tree[Token]) -> None:
        """What was said last holds of these things too."""
        things = self.visit(subtrees(tree, "things")[0])
        if self.act is None:
            raise refuse(self.scene.task, f"The instruction does not say what to do with {listed(things)}.",
                         kind=IncompleteError)  # fmt: skip
        self.act(things)

    bare = same
