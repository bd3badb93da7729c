"""Writes a refinement down: a folder per iteration that git can diff, and history.json over all of them."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from typing import Any

from gap_cli.refine.loop import Iteration, Refinement
from gap_cli.rehearse.summary import rate_dict
from gap_cli.workspace.canonical import json_text, write_json
from gap_cli.workspace.run import Run
from gap_cli.workspace.stages import write_stage

FOLDER, MEMORY = "refine", "refine/memory"
DECISION, HISTORY = "gap/decision/v1", "gap/refinement/v1"


def write_iteration(run: Run, iteration: Iteration) -> None:
    """Write `refine/NN`: the bundle it ended with, patch.json where a change was kept, and decision.json."""
    files: dict[str, str] = {f"bundle/{name}": text for name, text in iteration.bundle.files.items()}
    files["plan.json"] = json_text(iteration.plan.model_dump(mode="json", by_alias=True))
    files["decision.json"] = json_text({
        "schema": DECISION, "iteration": iteration.number, "success": rate_dict(iteration.rate),
        "objective": iteration.objective, "modes": [mode.data for mode in iteration.modes],
        "candidates": [trial.data for trial in iteration.trials],
    })  # fmt: skip
    if iteration.accepted is not None:
        files["patch.json"] = json_text(iteration.accepted.model_dump(mode="json", by_alias=True))
    write_stage(run, f"{FOLDER}/{iteration.number:02d}", files)


def clear(run: Run) -> None:
    """Remove the iterations of an earlier refinement; what was rolled out before is kept."""
    for folder in run.folder(FOLDER).glob("[0-9][0-9]"):
        shutil.rmtree(folder)
    (run.folder(FOLDER) / "history.json").unlink(missing_ok=True)


def history_data(history: Refinement, rolled_out: int) -> Mapping[str, Any]:
    """The content of history.json: the learning curve, why it ended, the judgement, and what an accepted point cost."""
    first, last = history.iterations[0], history.iterations[-1]
    points = 100 * (last.rate.value - first.rate.value)
    return {
        "schema": HISTORY, "seed": history.settings.seed, "n": history.settings.n, "alpha": history.settings.alpha,
        "iterations": [
            {
                "iteration": i.number, "success": rate_dict(i.rate), "objective": i.objective,
                "accepted": None if i.accepted is None else i.accepted.title,
                "class": None if i.accepted is None else i.accepted.proposer,
            }
            for i in history.iterations
        ],
        "stopped": history.stopped, "changed": history.changed, "held_out": rate_dict(history.judged),
        "longest_run": history.longest_run, "episodes": rolled_out,
        "episodes_per_point": rolled_out / points if points > 0 else None,
    }  # fmt: skip


def write_history(run: Run, history: Refinement, episodes: int) -> None:
    """Write `refine/history.json`."""
    write_json(run.folder(FOLDER) / "history.json", history_data(history, episodes))
