"""From goals to the graph's topology: steps in order, what follows each exit, another way where a step fails, loops."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from gap_cli.author.operators import Operator, OperatorLibrary, Step, producer_of
from gap_cli.author.plans import ABORT, DONE
from gap_cli.author.regress import State, regress
from gap_cli.skills.facts import Fact, parse_fact
from gap_runtime.contracts.task.goals import EACH, ForEach, Group, Predicate
from gap_runtime.errors import InstructionError

INITIALLY = frozenset({Fact("hand_empty"), Fact("view_clear")})  # the arm is home, nothing is held
IN_DOUBT = "in_doubt"  # of an object on which a step failed: where it is, and whether it is held, is not known
ITEM = "item"  # the object that one pass of a loop is about
VISITS = 3  # of a loop's head per object: to fetch it, to fetch it once more, and one to spare
Target = int | str


@dataclass
class Use:
    """One use of a skill in the graph: a step and the part of the goals it serves, the uses before it whose values it
    may read, and what follows each exit: uses, or ends.

    A `twin` gives what another use gives on another way. `layer` counts along the way on which nothing fails; the uses
    of one layer run side by side. `each` are the objects that `ITEM` stands for.
    """

    step: Step
    part: int
    before: list[int]
    after: dict[str, list[Target]]
    layer: int | None = None
    twin: int | None = None
    each: Sequence[str] = ()
    max_visits: int | None = None
    why: str = ""


@dataclass
class Topology:
    """Builds the uses of a graph, goal by goal.

    Goals are not interleaved: what is seen for one is seen right before it, not before the arm has moved through the
    scene for another. No step undoes a goal already reached. `facts` hold of the task's things whatever is done.
    """

    operators: OperatorLibrary
    facts: frozenset[Fact]
    uses: list[Use] = field(default_factory=list)
    reached: frozenset[Fact] = frozenset()
    state: State = field(init=False)
    readable: list[int] = field(default_factory=list)  # uses on the way so far
    open: list[tuple[int, str]] = field(default_factory=list)  # exits that lead to whatever comes next
    layer: int = 0

    def __post_init__(self) -> None:
        self.state = State(self.facts | INITIALLY)

    def build(self, goals: Group) -> list[Use]:
        """The uses for all goals. Raises `InstructionError` when the skills cannot do it."""
        objects = list(dict.fromkeys(name for p in goals.predicates() for name in p.roles.values()))
        for number, part in enumerate(goals.parts()):
            chosen = [part] if isinstance(part, Predicate) else part.chosen()
            if isinstance(part, ForEach) and len(chosen) == len(part.each) > 1 and self.loop(part, number):
                continue
            for one in chosen:
                self.goal(one, number, objects)
        self.link([DONE])
        return self.uses

    def goal(self, goal: Predicate, number: int, objects: Sequence[str]) -> None:
        """One fact, and another way to it where an acting step fails."""
        fact, _ = parse_fact(goal.fact)
        objects = list(dict.fromkeys([*goal.roles.values(), *objects]))
        steps = regress(fact, self.state, self.operators, objects, keep=self.reached)
        if steps:
            forked = all(self.one_success(use) for use, _ in self.open)
            rows = self.chain(steps, number, self.readable, objects, forked=forked)
            self.link(rows[0])
            for row in rows:
                for use in row:
                    self.uses[use].layer = self.layer
                self.layer += 1
            self.open = [(use, exit_) for use in rows[-1] for exit_ in self.successes(use)]
            self.readable += [use for row in rows for use in row]
            self.state = self.state.after(steps)
            retried = self.retry(fact, rows, objects)
            if retried is not None:
                self.state, self.readable = State(self.state.facts & retried.facts), []
        self.reached |= {fact}

    def retry(self, fact: Fact, rows: Sequence[Sequence[int]], objects: Sequence[str]) -> State | None:
        """Lead the failures of acting steps to another way to the fact, by a swap of the first skill that has some; and
        where that fails, to its other swaps, and to the skill itself once more. None where there is no other way."""
        acting = [use for row in rows for use in row if self.uses[use].step.acts]
        first = next((use for use in acting if self.operators.swaps(self.uses[use].step.skill)), None)
        if first is None:
            return None
        step, number = self.uses[first].step, self.uses[first].part
        failed = State(self.facts | self.reached | {Fact(IN_DOUBT, (step.binding[0][1],))})
        swaps = self.operators.swaps(step.skill)
        for tried, operator in enumerate(swaps):
            try:
                steps = regress(fact, failed, self.operators.only(operator.name), objects, keep=self.reached)
            except InstructionError:
                continue
            again = self.chain(steps, number, [], objects)
            self.uses[again[0][0]].before = list(self.uses[first].before)
            for use in acting[acting.index(first) :]:
                self.lead(use, again[0], failure=True)
            swap = next(use for row in again for use in row if self.uses[use].step.skill == operator.name)
            self.uses[swap].why = f"a swap of {step.skill}"
            for other in [*swaps[tried + 1 :], self.operators.operators[step.skill]]:
                self.alternative(swap, other)
            self.open += [(use, exit_) for use in again[-1] for exit_ in self.successes(use)]
            return failed.after(steps)
        return None

    def alternative(self, swap: int, operator: Operator) -> None:
        """Another skill in the place of a use, to be tried where all that were tried before have failed."""
        given = self.uses[swap]
        step = operator.ground(given.step.roles)
        before = {use: self.uses[use].step for use in given.before}
        if all(producer_of(port, before) for port in step.required) and not step.needs - given.step.needs - self.facts:
            use = self.add(step, given.part, given.before, twin=swap)
            self.uses[use].why = given.why
            last = max((u for u in range(use) if u == swap or self.uses[u].twin == swap), default=swap)
            self.lead(last, [use], failure=True)
            self.lead(use, given.after[self.successes(swap)[0]])

    def loop(self, part: ForEach, number: int) -> bool:
        """A loop over the objects: the next one, what brings it to its goal, and again. One on which a step failed is
        fetched once more and then left; at the end that counts as a failure. False where no skill heads such a loop."""
        other = next((name for name in part.goal.roles.values() if name != EACH), "")
        for operator in self.operators.heads:
            binding = dict(zip(operator.contract.roles, (ITEM, other), strict=False))
            head = operator.ground(binding) if len(binding) == len(operator.contract.roles) else None
            if head is None or not head.needs <= self.state.facts:
                continue
            facts = frozenset(f for f in self.facts if not set(f.args) & set(part.each))
            of_all = [frozenset(f.name for f in self.facts if f.args == (name,)) for name in part.each]
            facts |= {Fact(name, (ITEM,)) for name in frozenset.intersection(*of_all)}
            start, near = State(facts | self.reached | INITIALLY), [ITEM, other]
            fact, _ = parse_fact(part.goal.of(ITEM).fact)
            try:
                body = regress(fact, start.after([head]), self.operators, near, keep=self.reached)
                recovery = regress(min(INITIALLY), State(facts | {Fact(IN_DOUBT, (ITEM,))}), self.operators, near)
            except InstructionError:
                continue
            first = self.add(head, number, [])
            rows, back = self.chain(body, number, [first], near), self.chain(recovery, number, [first], near)
            self.close(part, first, rows, back)
            self.reached |= {parse_fact(one.fact)[0] for one in part.chosen()}
            self.state, self.readable = State(self.facts | self.reached | INITIALLY), []
            return True
        return False

    def close(self, part: ForEach, head: int, rows: list[list[int]], back: list[list[int]]) -> None:
        """Join the head of a loop, its body and what follows a failure in it."""
        exits = self.operators.operators[self.uses[head].step.skill].contract.exits
        found = next(name for name in exits.success if name != exits.exhausted)
        self.link([head])
        self.uses[head].after[found] = [*rows[0]]
        self.uses[head].before = [use for row in back for use in row]
        self.uses[head].max_visits = VISITS * len(part.each) + 1
        self.uses[head].layer, self.layer = self.layer, self.layer + 1
        self.open = [(head, str(exits.exhausted))]
        for use in [*rows[-1], *back[-1]]:
            self.lead(use, [head])
        for use in (use for row in rows for use in row if self.uses[use].step.acts):
            self.lead(use, back[0], failure=True)
        for use in [head, *(use for row in [*rows, *back] for use in row)]:
            self.uses[use].each = part.each

    def chain(
        self, steps: Sequence[Step], number: int, before: Sequence[int], near: Sequence[str], *, forked: bool = True
    ) -> list[list[int]]:
        """Uses for steps, row after row; those of one row run side by side. Where the last row leads is left open."""
        rows: list[list[int]] = []
        for layer in layers(steps):
            ranked = sorted(layer, key=lambda i: [near.index(name) for _, name in steps[i].binding])
            read = [*before, *(use for row in rows for use in row)]
            made = [self.add(steps[i], number, read) for i in ranked]
            rows += [made] if forked else [[use] for use in made]
        for row, following in pairwise(rows):
            for use in row:
                self.lead(use, following)
        return rows

    def add(self, step: Step, number: int, before: Sequence[int], twin: int | None = None) -> int:
        """A use of a step whose failure leads to the end."""
        after: dict[str, list[Target]] = {self.operators.operators[step.skill].contract.exits.failure: [ABORT]}
        why = self.operators.reason(step, self.facts)
        self.uses.append(Use(step, number, list(before), after, twin=twin, why=why))
        return len(self.uses) - 1

    def lead(self, use: int, targets: Iterable[Target], *, failure: bool = False) -> None:
        """What follows the success exits of a use, or its failure."""
        contract = self.operators.operators[self.uses[use].step.skill].contract
        for exit_ in [contract.exits.failure] if failure else contract.exits.success:
            self.uses[use].after[exit_] = [*targets]

    def link(self, targets: Iterable[Target]) -> None:
        """What the exits left open lead to."""
        for use, exit_ in self.open:
            self.uses[use].after[exit_] = [*targets]
        self.open = []

    def successes(self, use: int) -> list[str]:
        """Success exits of a use."""
        return list(self.operators.operators[self.uses[use].step.skill].contract.exits.success)

    def one_success(self, use: int) -> bool:
        """Whether whatever follows success may be several uses at once: all success exits lead there."""
        return self.uses[use].max_visits is None


def layers(steps: Sequence[Step]) -> list[list[int]]:
    """Numbers of the steps by layer; the members of one layer may run at the same time.

    A layer is one acting step, or every step that only looks and whose predecessors are done: looking comes as early as
    it may.
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
    earlier = dict(enumerate(steps[:index]))
    given = (producer_of(port, earlier) for port in steps[index].inputs)
    return {i for i in earlier if _ordered(steps[i], steps[index])} | {made[0] for made in given if made is not None}


def _ordered(first: Step, second: Step) -> bool:
    """True when swapping the two would change what either finds: actions, causes, threats."""
    causes = first.adds & second.needs
    threatens = second.deletes & (first.needs | first.adds)
    restores = first.deletes & (second.needs | second.adds)
    return bool((first.acts and second.acts) or causes or threatens or restores)
