"""The software protective stop: every arm told to stop, each on its own, none able to hold up another.

It is not an emergency stop and not safety-rated.
"""

from __future__ import annotations

import threading
from collections.abc import Collection, Sequence

from gap_runtime.contracts.arm import Arm
from gap_runtime.contracts.cell import Cell

CONFIRM_S = 2.0


def stop_arms(cell: Cell | None, spared: Collection[int] = ()) -> list[str]:
    """Stop every arm, apart from those `spared` by arm_id; returns what is known to have gone wrong (an arm that
    raised, or did not answer in time)."""
    if cell is None:
        return []
    try:
        arms: Sequence[Arm] = tuple(cell.arms)
    except Exception as error:
        return [f"the arms cannot be reached ({error})"]
    problems: list[str] = []
    threads = {}
    for i, arm in enumerate(arms):
        if i not in spared:
            threads[i] = threading.Thread(target=_stop, args=(i, arm, problems), name="gap-stop", daemon=True)
            threads[i].start()
    for i, thread in threads.items():
        thread.join(CONFIRM_S)
        if thread.is_alive():
            problems.append(f"arm {i} did not confirm its stop within {CONFIRM_S:g} s")
    return problems


def _stop(index: int, arm: Arm, problems: list[str]) -> None:
    try:
        arm.stop()
    except BaseException as error:
        problems.append(f"arm {index} could not be stopped ({error})")
