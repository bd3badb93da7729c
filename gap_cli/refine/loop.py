"""The refinement loop: rehearse, diagnose, propose, race on the same instances, keep what is proven better, repeat."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from gap_cli.author.plans import PlanData
from gap_cli.refine.candidates import Candidates, leaks
from gap_cli.refine.diagnose import Mode, diagnose
from gap_cli.refine.patches import Patch, Tune
from gap_cli.refine.proposers import Situation, propose
from gap_cli.refine.race import Verdict, race
from gap_cli.refine.statistics import Level, Row
from gap_cli.rehearse.stats import Rate, wilson
from gap_runtime.bundle.bundle import GraphBundle
from gap_runtime.contracts.task import Reward
from gap_runtime.errors import GapError

HELD_OUT = 1_000_000  # held-out seeds start this far behind the tuning seeds
PLATEAU = 3  # iterations without an accepted change after which the loop ends


@dataclass(frozen=True)
class Settings:
    """How long and how hard to look. `n` tuning instances from `seed` on; `alpha` is the chance, over the whole run,
    that a change that is no better is accepted; `budget_s` [s] of wall time and `budget_episodes` end it early."""

    seed: int
    n: int = 30
    iterations: int = 10
    candidates: int = 4
    proposers: tuple[str, ...] = ("look", "swap", "structure", "tune")
    alpha: float = 0.05
    held_out: int = 100
    budget_s: float = float("inf")
    budget_episodes: float = float("inf")


@dataclass(frozen=True)
class Trial:
    """One candidate: its patch, and how its race ended, or why there was none (`refused`)."""

    patch: Patch
    verdict: Verdict | None
    refused: str = ""

    @property
    def data(self) -> dict[str, Any]:
        """As decision.json holds it."""
        about = {"title": self.patch.title, "patch": self.patch.model_dump(mode="json", by_alias=True)}
        if self.verdict is None:
            return {**about, "outcome": "refused", "reason": self.refused}
        paired = self.verdict.paired
        return {
            **about, "outcome": self.verdict.outcome, "reason": self.verdict.reason, "level": self.verdict.level,
            "gained": list(paired.gained), "lost": list(paired.lost), "time_ratio": paired.time_ratio,
            "episodes": len(self.verdict.rows),
        }  # fmt: skip


@dataclass(frozen=True)
class Iteration:
    """What one round found: the failure modes it started from, the candidates, and the incumbent it ended with."""

    number: int
    modes: Sequence[Mode]
    trials: Sequence[Trial]
    plan: PlanData
    bundle: GraphBundle
    rows: Mapping[int, Row]
    objective: float

    @property
    def accepted(self) -> Patch | None:
        """The change that was kept, if any."""
        return next((t.patch for t in self.trials if t.verdict is not None and t.verdict.accepted), None)

    @property
    def rate(self) -> Rate:
        """Success of the incumbent on the tuning instances."""
        return wilson(sum(bool(r["success"]) for r in self.rows.values()), len(self.rows))


@dataclass
class Refinement:
    """The whole history. `stopped` says why it ended; `held_out` are the rows of the final judgement."""

    settings: Settings
    iterations: list[Iteration] = field(default_factory=list)
    stopped: str = ""
    held_out: Mapping[int, Row] = field(default_factory=dict)

    @property
    def changed(self) -> bool:
        """True where at least one change was accepted."""
        return any(iteration.accepted for iteration in self.iterations)

    @property
    def judged(self) -> Rate:
        """Success on the held-out instances."""
        return wilson(sum(bool(r["success"]) for r in self.held_out.values()), len(self.held_out))

    @property
    def longest_run(self) -> int:
        """The most held-out successes in a row, in the order of their seeds."""
        best = now = 0
        for seed in sorted(self.held_out):
            now = now + 1 if self.held_out[seed]["success"] else 0
            best = max(best, now)
        return best


def objective(rows: Mapping[int, Row], reward: Reward) -> float:
    """J = w_s success + w_t throughput, throughput in successes per second of motion in the simulator."""
    won = [row["motion_s"] for row in rows.values() if row["success"]]
    success = len(won) / max(len(rows), 1)
    throughput = success / (sum(won) / len(won)) if won else 0.0
    return reward.success_weight * success + reward.throughput_weight * throughput


def refine(
    plan: PlanData, candidates: Candidates, settings: Settings, report: Callable[[Iteration], None]
) -> Refinement:
    """Refine the graph of `plan`; `report` is called after each iteration, number 0 being the graph as it came.

    The same plan, settings, task and providers give the same history, however often it was interrupted, unless
    `budget_s` cuts it short. Raises what the first rehearsal raises.
    """
    task, library = candidates.inventory.task, candidates.inventory.library
    started, level = time.monotonic(), Level(settings.alpha, settings.iterations * settings.candidates)
    seeds = range(settings.seed, settings.seed + settings.n)
    bundle = candidates.bundle(plan)
    rows: Mapping[int, Row] = candidates.rows(bundle, seeds)
    history, tried, idle = Refinement(settings), list[Patch](), 0
    history.iterations.append(
        Iteration(0, diagnose([*rows.values()]), (), plan, bundle, rows, objective(rows, task.reward))
    )
    report(history.iterations[0])
    scores: list[tuple[Mapping[str, Mapping[str, Any]], float]] = []
    for number in range(1, settings.iterations + 1):
        modes = diagnose([rows[s] for s in sorted(rows)])
        situation = Situation(plan, modes, library.contracts, task.objects, settings.seed + number, scores, tried)
        patches = propose(situation, settings.proposers, settings.candidates)
        if not patches:
            history.stopped = "nothing is left to propose"
            break
        trials: list[Trial] = []
        for patch in patches:
            if time.monotonic() - started > settings.budget_s or candidates.used >= settings.budget_episodes:
                history.stopped = "the budget is spent"
                break
            tried.append(patch)
            trial, changed, made = _try(patch, plan, bundle, candidates, seeds, rows, level)
            trials.append(trial)
            if trial.verdict is not None and isinstance(patch.change, Tune):
                scores.append((patch.change.values, objective(trial.verdict.rows, task.reward)))
            if trial.verdict is not None and trial.verdict.accepted:
                plan, bundle, rows = changed, made, trial.verdict.rows
                break
        history.iterations.append(Iteration(number, modes, trials, plan, bundle, rows, objective(rows, task.reward)))
        report(history.iterations[-1])
        idle = 0 if history.iterations[-1].accepted else idle + 1
        if history.stopped:
            break
        if idle == PLATEAU:
            history.stopped = f"a plateau: no change was accepted in {PLATEAU} iterations"
            break
    history.stopped = history.stopped or f"{settings.iterations} iterations are done"
    first = settings.seed + HELD_OUT
    history.held_out = candidates.rows(bundle, range(first, first + settings.held_out)) if settings.held_out else {}
    return history


def _try(
    patch: Patch, plan: PlanData, incumbent: GraphBundle, candidates: Candidates, seeds: Sequence[int],
    rows: Mapping[int, Row], level: Level,
) -> tuple[Trial, PlanData, GraphBundle]:  # fmt: skip
    """Generate, validate and race one candidate; one that the validator or the leak guard refuses costs no episode."""
    try:
        changed = patch.change.apply(plan)
        made = candidates.bundle(changed)
    except GapError as error:
        return Trial(patch, None, str(error)), plan, incumbent
    if made == incumbent:
        return Trial(patch, None, "It changes nothing."), plan, incumbent
    leaked = leaks(made, incumbent, rows.values())
    if leaked:
        return (
            Trial(patch, None, f"Constants at true positions of tuning instances: {', '.join(leaked)}."),
            plan,
            incumbent,
        )
    verdict = race(seeds, rows, lambda block: candidates.rows(made, block), level)
    return Trial(patch, verdict), changed, made
