"""P1-P3: a policy sees what its robot would; nothing of it may reach simulator ground truth."""

from __future__ import annotations

from collections.abc import Iterator

from gap_cli.analysis.context import SubgraphContext, WorkflowContext
from gap_runtime.errors import Finding

HINT = "A policy sees cameras, joint states, gripper width and forces; checkpoints read ground truth."


def p1_p2_nodes(sg: SubgraphContext) -> Iterator[Finding]:
    """P1: a node calls a privileged tool. P2: a script may call one."""
    for name in sg.nodes:
        callee = sg.callees[name]
        if callee is None:
            continue
        for spec in callee.tools:
            if spec.privileged and callee.what.startswith("tool "):
                yield sg.finding("P1", f"nodes.{name}.tool", f"{spec.name} reads simulator ground truth", HINT)
            elif spec.privileged:
                message = f"{callee.what} may call {spec.name}, which reads simulator ground truth"
                yield sg.finding("P2", f"nodes.{name}", message, HINT)


def p3_recoveries(context: WorkflowContext) -> Iterator[Finding]:
    """P3: a recovery calls a privileged tool."""
    for name, node in context.workflow.nodes.items():
        for i, call in enumerate(node.recovery):
            spec = context.catalog.tools.get(call.tool)
            if spec is not None and spec.privileged:
                path = f"nodes.{name}.recovery.{i}.tool"
                yield Finding(path, "P3", f"{spec.name} reads simulator ground truth", HINT)


RULES = (p1_p2_nodes,)
TOP_RULES = (p3_recoveries,)
