"""Who proposes changes: swap a skill, tune parameters, look at a part, add a retry or drop a segment; with reasons."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import optuna

from gap_cli.author.plans import PlanData, Segment
from gap_cli.refine.diagnose import Mode
from gap_cli.refine.patches import Drop, Patch, Rephrase, Retry, Swap, Tune, find
from gap_runtime.contracts.skill import Parameter, SkillContract
from gap_runtime.contracts.task import ObjectModel

SUBPART = "perception-subpart"
VISITS = 3
TUNED_AT_ONCE = 4  # parameters of one trial: more would leave no telling which of them mattered
optuna.logging.set_verbosity(optuna.logging.ERROR)


@dataclass
class Situation:
    """What proposers look at: the incumbent `plan`, its failure `modes`, the installed skills and the task's objects.

    `trials` are the tuned values tried so far with their score; `tried` are patches that were raced already.
    """

    plan: PlanData
    modes: Sequence[Mode]
    skills: Mapping[str, SkillContract]
    objects: Mapping[str, ObjectModel]
    seed: int
    trials: Sequence[tuple[Mapping[str, Mapping[str, Any]], float]] = ()
    tried: Sequence[Patch] = field(default=())

    def blamed(self) -> Iterator[tuple[Segment, Mode | None]]:
        """The segments most worth changing: where most episodes failed, what feeds those, then the rest."""
        seen: set[str] = set()
        for mode in self.modes:
            if not any(s.name == mode.stage for s in self.plan.segments):
                continue
            at = find(self.plan, mode.stage)
            feeding = [s for s in self.plan.segments if s.outputs.keys() & at.inputs.keys()]
            for segment in [at, *reversed(feeding)]:
                if segment.name not in seen:
                    seen.add(segment.name)
                    yield segment, mode
        yield from ((s, None) for s in reversed(self.plan.segments) if s.name not in seen)


Proposer = Callable[[Situation], Iterator[Patch]]


def swap(situation: Situation) -> Iterator[Patch]:
    """Skills that a blamed segment's own declares as swaps, for the same roles."""
    for segment, mode in situation.blamed():
        contract = situation.skills[segment.skill]
        for name in contract.swaps:
            other = situation.skills.get(name)
            if mode is not None and other is not None and set(other.literals) <= set(segment.literals):
                yield _patch(
                    "swap", Swap(segment=segment.name, skill=name), mode, f"{name} is a swap of {segment.skill}"
                )


def look(situation: Situation) -> Iterator[Patch]:
    """Another part of the object that a blamed segment's box was taken of: its handle, its rim, a part its model
    declares, or the whole of it."""
    for segment, mode in situation.blamed():
        model = situation.objects.get(segment.roles.get("name", ""))
        if mode is None or model is None or segment.stage != "perceive":
            continue
        for part in part_names(model):
            literals = {"parent_prompt": model.label, "subpart_prompt": f"{part} of the {model.label}"}
            why = f"{mode.stage} may need the {part} of the {model.label} rather than all of it"
            if segment.skill == SUBPART:
                yield _patch("look", Rephrase(segment=segment.name, literals=literals), mode, why)
            elif SUBPART in situation.skills:
                yield _patch("look", Swap(segment=segment.name, skill=SUBPART, literals=literals), mode, why)


def part_names(model: ObjectModel) -> list[str]:
    """The parts an object has by its model: those declared, its handle, its rim."""
    shape = model.shape
    return [*(p.replace("_", " ") for p in model.parts), *["handle"] * bool(shape.handle), *["rim"] * bool(shape.wall)]


def structure(situation: Situation) -> Iterator[Patch]:
    """A retry of a blamed segment from the one that looks for what it needs, and segments that may not matter."""
    for segment, mode in situation.blamed():
        if mode is None or segment.after.get(segment.on_error):
            continue
        looks = [
            s for s in situation.plan.segments if s.stage == "perceive" and s.outputs.keys() & segment.inputs.keys()
        ]
        again = looks[-1].name if looks else segment.name
        why = f"{mode.count} episodes ended in {segment.name}, which gives up at once"
        yield _patch("structure", Retry(segment=segment.name, again=again, visits=VISITS), mode, why)
    read = {name for s in situation.plan.segments for name in s.inputs}
    for segment in situation.plan.segments:
        if segment.stage != "perceive" or segment.outputs.keys() & read:
            continue
        yield Patch(
            change=Drop(segment=segment.name), proposer="structure", reason=f"nobody reads what {segment.name} gives"
        )


def tune(situation: Situation) -> Iterator[Patch]:
    """Values of the blamed segments' declared parameters, by multivariate TPE over the trials so far; the parameters
    that mattered first (J. Bergstra et al., NeurIPS 2011; optuna)."""
    space = _space(situation)
    if not space:
        return
    chosen = dict(islice(space.items(), TUNED_AT_ONCE))
    sampler = optuna.samplers.TPESampler(seed=situation.seed, multivariate=True, n_startup_trials=4)
    study = optuna.create_study(direction="maximize", sampler=sampler)
    distributions = {key: _distribution(parameter) for key, parameter in chosen.items()}
    for values, score in situation.trials:
        flat = {f"{s}.{n}": v for s, named in values.items() for n, v in named.items()}
        if flat.keys() >= distributions.keys():
            given = {key: flat[key] for key in distributions}
            study.add_trial(optuna.trial.create_trial(params=given, distributions=distributions, value=score))
    while True:
        trial = study.ask(distributions)
        found: dict[str, dict[str, Any]] = {}
        for key, value in trial.params.items():
            segment, _, name = key.rpartition(".")
            found.setdefault(segment, {})[name] = round(value, 6) if isinstance(value, float) else value
        mode = situation.modes[0] if situation.modes else None
        yield _patch("tune", Tune(values=found), mode, "sampled within the declared ranges")


def _space(situation: Situation) -> dict[str, Parameter]:
    """Declared numbers and words of the blamed segments with bounds, those of the most blamed first."""
    found: dict[str, Parameter] = {}
    for segment, _ in situation.blamed():
        for name, parameter in situation.skills[segment.skill].parameters.items():
            if parameter.range is not None or parameter.choices:
                found[f"{segment.name}.{name}"] = parameter
    return found


def _distribution(parameter: Parameter) -> optuna.distributions.BaseDistribution:
    if parameter.choices:
        return optuna.distributions.CategoricalDistribution(parameter.choices)
    assert parameter.range is not None
    low, high = parameter.range
    if parameter.type == "int":
        return optuna.distributions.IntDistribution(int(low), int(high))
    return optuna.distributions.FloatDistribution(low, high)


def _patch(proposer: str, change: Any, mode: Mode | None, reason: str) -> Patch:
    evidence = (
        {}
        if mode is None
        else {"stage": mode.stage, "cause": mode.cause, "count": mode.count, "seeds": list(mode.seeds)}
    )
    return Patch(change=change, proposer=proposer, reason=reason, evidence=evidence)


PROPOSERS: dict[str, Proposer] = {"swap": swap, "look": look, "structure": structure, "tune": tune}


def propose(situation: Situation, names: Sequence[str], count: int) -> list[Patch]:
    """At most `count` patches that were not tried, by turns from the named proposers."""
    tried = {patch.change.model_dump_json() for patch in situation.tried}
    sources = [PROPOSERS[name](situation) for name in names]
    found: list[Patch] = []
    while sources and len(found) < count:
        for source in list(sources):
            patch = next((p for p in source if p.change.model_dump_json() not in tried), None)
            if patch is None:
                sources.remove(source)
            elif len(found) < count:
                tried.add(patch.change.model_dump_json())
                found.append(patch)
    return found
