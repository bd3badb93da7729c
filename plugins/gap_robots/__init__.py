"""First-party robots. Importing this loads no simulator; each spec is built when it is asked for."""

from __future__ import annotations

from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.hookspecs import Register, hookimpl


def arms() -> tuple[RobotSpec, ...]:
    """One of each kind of arm shipped here: what benchmarks measure."""
    from gap_robots.panda import panda
    from gap_robots.ur5e import ur5e

    return (panda(), ur5e())


@hookimpl
def gap_register_robots(register: Register) -> None:
    from gap_robots.menagerie import register_all
    from gap_robots.panda import panda, panda_bimanual
    from gap_robots.ur5e import ur5e

    register("panda", panda)
    register("panda-bimanual", panda_bimanual)
    register("ur5e", ur5e)
    register_all(register)
