"""First-party robots: the Franka Panda. Importing this loads no simulator; each spec is built when it is asked for."""

from __future__ import annotations

from gap_cli.hookspecs import Register, hookimpl


@hookimpl
def gap_register_robots(register: Register) -> None:
    from gap_robots.panda import panda

    register("panda", panda)
