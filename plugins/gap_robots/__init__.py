"""First-party robots. Importing this loads no simulator; each spec is built when it is asked for."""

from __future__ import annotations

from gap_cli.hookspecs import Register, hookimpl


@hookimpl
def gap_register_robots(register: Register) -> None:
    from gap_robots.panda import panda
    from gap_robots.ur5e import ur5e

    register("panda", panda)
    register("ur5e", ur5e)
