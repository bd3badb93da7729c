"""The symbolic author: from a sentence to a plan, by grammar and by regression. No key, no network, no guess."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gap_cli.analysis.catalog import contract_names
from gap_cli.author.naming import Named, name_uses
from gap_cli.author.noun_phrases import describe
from gap_cli.author.operators import OperatorLibrary, literal_source
from gap_cli.author.plans import Plan, PlanData, Segment
from gap_cli.author.scene import Scene
from gap_cli.author.things import Things
from gap_cli.author.topology import Topology, Use
from gap_cli.author.understand import understand
from gap_cli.skills import SkillLibrary
from gap_cli.skills.facts import Fact
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.task.goals import ForEach, Goals
from gap_runtime.contracts.tool import ToolSpec
from gap_runtime.errors import InstructionError

RECOVERY = ("gripper.Open", "robot_control.GoHome")  # let go, then get out of the way
_SAY = {"perceive": "Locate", "grasp": "Grasp", "transport": "Carry", "place": "Place", "operate": "Operate"}


def plan_symbolically(task: Task, instruction: str, library: SkillLibrary, tools: Mapping[str, ToolSpec]) -> Plan:
    """Plan the instruction. Raises `InstructionError` where the words, the scene or the skills do not suffice."""
    goals = understand(task, instruction)
    uses = Topology(OperatorLibrary.of(library, tools), known_facts(task)).build(goals)
    named = name_uses(uses, library.contracts)
    writer = _Writer(task, goals, library, [name.segment for name in named])
    content = PlanData(
        task=task.name,
        variant=task.variant,
        instruction=instruction,
        author="symbolic",
        scene=goals.scene,
        goals=goals,
        segments=[writer.segment(use, names) for use, names in zip(uses, named, strict=True)],
        recovery=[name for name in RECOVERY if name in tools],
    )
    return Plan.of(content)


def known_facts(task: Task) -> frozenset[Fact]:
    """What is true of the task's objects whatever is done: `solid` ones have no cavity, wall or handle."""
    return frozenset(Fact("solid", (name,)) for name, m in task.objects.items() if m.shape.kind in ("box", "cylinder"))


class _Writer:
    """Writes uses as the segments of a plan."""

    def __init__(self, task: Task, goals: Goals, library: SkillLibrary, names: list[str]) -> None:
        self.task, self.goals, self.library, self.names = task, goals, library, names
        self.vocabulary, self.scene = Things(task), Scene(task, goals.scene)

    def segment(self, use: Use, named: Named) -> Segment:
        """One segment."""
        contract = self.library.contracts[use.step.skill]
        inputs, outputs = contract_names(contract, named.names)
        exits = [*contract.exits.success, contract.exits.failure]
        return Segment(
            name=named.segment,
            skill=use.step.skill,
            description=self.describe(use, contract.stage),
            stage=contract.stage,
            layer=use.layer,
            roles=use.step.roles,
            names=named.names,
            literals={
                name: self.literal(use, *(literal_source(contract, name) or ("", ""))) for name in contract.literals
            },
            inputs={name: str(inputs[name]) for name in inputs if name in named.inputs.values()},
            outputs={name: str(type_) for name, type_ in outputs.items()},
            exits=list(contract.exits.success),
            on_error=contract.exits.failure,
            after={exit_: [t if isinstance(t, str) else self.names[t] for t in use.after[exit_]] for exit_ in exits},
            each=list(use.each),
            max_visits=use.max_visits,
            why=use.why,
        )

    def literal(self, use: Use, role: str, what: str) -> Any:
        """What fills a literal: names by which the cameras find an object, or its number among the goals that share
        it."""
        name = use.step.roles[role]
        if what == "names":
            return list(dict.fromkeys(self.task.objects[thing].label for thing in use.each))
        if what == "name":
            return self.phrase(name)
        parts = [part.chosen() if isinstance(part, ForEach) else [part] for part in self.goals.parts()]
        shared = [(i, p) for i, part in enumerate(parts) for p in part if name in p.roles.values()]
        target = use.step.binding[0][1]
        mine = [n for n, (i, p) in enumerate(shared) if i == use.part and target in p.roles.values()]
        return len(shared) if what == "total" else mine[0] if mine else -1  # in a loop it is not known

    def phrase(self, name: str) -> str:
        """What an object is called, so that it cannot be taken for another one of the scene."""
        text = describe(self.vocabulary, self.scene, self.vocabulary.all[name])
        if text is None:
            alike = [t.id for t in self.vocabulary.all.values() if t.label == self.vocabulary.all[name].label]
            raise InstructionError(
                f"The cameras cannot tell {name} from {' and '.join(a for a in alike if a != name)}: they look alike, "
                "and where they stand differs from instance to instance.",
                hint="Ask for all of them, or give them labels or colours of their own in the task.",
            )
        return text

    def describe(self, use: Use, stage: str | None) -> str:
        """'Place the milk (container: basket)'."""
        things = self.vocabulary.all
        labels = {role: things[name].label if name in things else name for role, name in use.step.binding}
        if not labels:
            return use.step.skill
        first, *rest = labels.items()
        more = f" ({', '.join(f'{role}: {label}' for role, label in rest)})" if rest else ""
        return f"{_SAY.get(stage or '', use.step.skill)} the {first[1]}{more}"
