"""The schema of an episode's row, and the row of an episode that says nothing about the policy."""

from __future__ import annotations

from typing import Any

SCHEMA = "gap/episode/v1"
WORKER_LOST = ("crashed", "hung")  # chance or the machine, not physics
VOID = (*WORKER_LOST, "diverged", "infeasible")


def void_episode(seed: int, status: str, reason: str) -> dict[str, Any]:
    """An episode that says nothing about the policy: its worker died, its physics blew up, its instance does not
    exist. It counts against the rate, so that a broken simulation can never raise one."""
    return {"schema": SCHEMA, "seed": seed, "status": status, "success": False, "void": True, "reason": reason}
