"""The symbolic author: from a sentence to a plan, by grammar and by regression. No key, no network, no guess."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gap_cli.analysis.catalog import contract_names
from gap_cli.author.goals import Goal, refuse
from gap_cli.author.grammar import parse_instruction
from gap_cli.author.naming import Named, name_steps
from gap_cli.author.plans import ABORT, DONE, Plan, PlanData, PlannedGoal, Segment
from gap_cli.author.solve import solve
from gap_cli.author.steps import Repertoire, Step, literal_source
from gap_cli.skills import SkillLibrary
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.tool import ToolSpec

RECOVERY = ("gripper.Open", "robot_control.GoHome")  # let go, then get out of the way
_SAY = {"perceive": "Locate", "grasp": "Grasp", "transport": "Carry", "place": "Place", "operate": "Operate"}


def plan_symbolically(task: Task, instruction: str, library: SkillLibrary, tools: Mapping[str, ToolSpec]) -> Plan:
    """Plan the instruction. Raises `InstructionError` where the words, the scene or the skills do not suffice."""
    goals = parse_instruction(task, instruction)
    scene = choose_scene(task, goals)
    solved = solve(goals, Repertoire.of(library, tools))
    steps = [step for layers in solved for layer in layers for step in layer]
    counts = [(goals, nth) for nth, layers in enumerate(solved) for layer in layers for _ in layer]
    layer_of = [n for n, layer in enumerate(layer for layers in solved for layer in layers) for _ in layer]
    named = name_steps(steps, library.contracts)
    segments = [
        _segment(task, library, step, names, layer, _literals(task, library, step, *count))
        for step, names, layer, count in zip(steps, named, layer_of, counts, strict=True)
    ]
    content = PlanData(
        task=task.name,
        variant=task.variant,
        instruction=instruction,
        author="symbolic",
        scene=scene,
        goals=[PlannedGoal(fact=g.fact, target=g.target, container=g.container) for g in goals],
        segments=segments,
        recovery=[name for name in RECOVERY if name in tools],
    )
    return Plan.of(content)


def choose_scene(task: Task, goals: Sequence[Goal]) -> str:
    """The scene that holds every object named, by preference the one about the first target.

    Raises `InstructionError` when no scene holds them all.
    """
    named = list(dict.fromkeys([g.target for g in goals] + [g.container for g in goals]))
    fitting = [scene for scene, members in task.scenes.items() if all(name in members for name in named)]
    for name in named:
        if name in fitting:
            return name
    if fitting:
        return fitting[0]
    absent = [name for name in named if not any(name in members for members in task.scenes.values())]
    labels = [task.objects[name].label for name in absent or named]
    where = "in any scene" if absent else "together in any scene"
    raise refuse(task, f"{_listed(labels)} {'is' if len(labels) == 1 else 'are'} not {where} of task {task.name!r}.")


def _literals(task: Task, library: SkillLibrary, step: Step, goals: Sequence[Goal], nth: int) -> dict[str, Any]:
    """The literals of a step that serves goal number `nth`."""
    contract = library.contracts[step.skill]
    found: dict[str, Any] = {}
    for literal in contract.literals:
        role, what = literal_source(contract, literal) or ("", "")
        name = step.roles[role]
        shared = [i for i, g in enumerate(goals) if name in (g.target, g.container)]
        found[literal] = {
            "name": task.objects[name].label,
            "nth": sum(i < nth for i in shared),
            "total": len(shared),
        }[what]
    return found


def _segment(
    task: Task, library: SkillLibrary, step: Step, named: Named, layer: int, literals: dict[str, Any]
) -> Segment:
    contract = library.contracts[step.skill]
    inputs, outputs = contract_names(contract, named.names)
    return Segment(
        name=_clear_of_ends(named.segment),
        skill=step.skill,
        description=_describe(task, contract.stage, step),
        stage=contract.stage,
        layer=layer,
        roles=step.roles,
        names=named.names,
        literals=literals,
        inputs={name: str(inputs[name]) for name in named.inputs.values()},
        outputs={name: str(type_) for name, type_ in outputs.items()},
        exits=list(contract.exits.success),
        on_error=contract.exits.failure,
    )


def _clear_of_ends(name: str) -> str:
    return f"{name}_segment" if name in (DONE, ABORT) else name


def _describe(task: Task, stage: str | None, step: Step) -> str:
    """'Place the milk (container: basket)'."""
    labels = {role: task.objects[name].label for role, name in step.binding}
    if not labels:
        return step.skill
    first, *rest = labels.items()
    more = f" ({', '.join(f'{role}: {label}' for role, label in rest)})" if rest else ""
    return f"{_SAY.get(stage or '', step.skill)} the {first[1]}{more}"


def _listed(labels: Sequence[str]) -> str:
    text = " and ".join(f"the {label}" for label in labels)
    return text[0].upper() + text[1:]
