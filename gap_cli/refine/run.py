"""`gap refine` without its command line: the refinement of a run, written down as it goes, resumed where it was."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from gap_cli.author.plans import Plan
from gap_cli.refine.candidates import Candidates
from gap_cli.refine.history import FOLDER, MEMORY, clear, write_history, write_iteration
from gap_cli.refine.loop import Iteration, Refinement, Settings, refine
from gap_cli.refine.proposers import PROPOSERS
from gap_cli.rehearse.evaluate import make_engine
from gap_cli.sandbox import level
from gap_cli.workspace.inventory import Inventory
from gap_cli.workspace.metadata import record_stage
from gap_cli.workspace.run import Run
from gap_cli.workspace.stages import product
from gap_cli.workspace.validation import require_valid
from gap_runtime.bundle.bundle import GOALS
from gap_runtime.contracts.documents import read_json
from gap_runtime.contracts.engine import EpisodeResult
from gap_runtime.errors import UnknownNameError


@dataclass(frozen=True)
class Done:
    """A refinement and the number of episodes it is based on, those of an interrupted try included."""

    history: Refinement
    episodes: int


def settings_of(run: Run, seed: int | None, *, proposers: str, **more: Any) -> Settings:
    """The settings, with the run's own seed where none is given. Raises `UnknownNameError` for a proposer."""
    names = tuple(name.strip() for name in proposers.split(",") if name.strip())
    for name in names:
        if name not in PROPOSERS:
            raise UnknownNameError("proposer", name, PROPOSERS)
    return Settings(seed=run.config.seed if seed is None else seed, proposers=names, **more)


def refine_run(
    run: Run,
    settings: Settings,
    workers: int,
    progress: Callable[[EpisodeResult], None],
    report: Callable[[Iteration], None],
) -> Done:
    """Refine a validated run that is held. Finished episodes are read back, so that a run that was killed goes on and
    ends with the same files. Raises `RunError` where the run is not what was validated, and what `refine` raises."""
    started = time.monotonic()
    inventory = Inventory.of(run.config)
    bundle = require_valid(run, inventory, inventory.lock(level()))
    file = product(run, "plan")
    plan = Plan.load(read_json(file), str(file)).content
    candidates = Candidates(
        inventory, make_engine(inventory, workers=workers), run.folder(MEMORY), bundle.files[GOALS], progress
    )

    def written(iteration: Iteration) -> None:
        write_iteration(run, iteration)
        report(iteration)

    clear(run)
    history = refine(plan, candidates, settings, written)
    episodes = candidates.used
    write_history(run, history, episodes)
    record_stage(run, FOLDER, started, workers=workers)
    return Done(history, episodes)
