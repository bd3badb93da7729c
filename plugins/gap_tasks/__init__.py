"""First-party tasks: registers the `tasks/` folder, beside the checkout's root or inside the wheel."""

from __future__ import annotations

from pathlib import Path

from gap_runtime.hookspecs import Register, hookimpl


def tasks_folder() -> Path:
    """`tasks/` of the checkout, or the copy the wheel carries beside this file."""
    bundled = Path(__file__).parent / "tasks"
    return bundled if bundled.is_dir() else Path(__file__).parents[2] / "tasks"


@hookimpl
def gap_register_tasks(register: Register) -> None:
    register(tasks_folder())
