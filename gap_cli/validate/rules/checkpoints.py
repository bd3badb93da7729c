"""K8-K12: checkpoints promise something, few of them, about things that exist, judged on ground truth."""

from __future__ import annotations

from collections.abc import Iterator

from gap_cli.analysis.context import SubgraphContext
from gap_runtime.contracts.predicates import Checked, check_expression
from gap_runtime.errors import Finding, did_you_mean
from gap_runtime.graph.checkpoints import MAX_CHECKPOINTS, Checkpoint


def k8_k9_number(sg: SubgraphContext) -> Iterator[Finding]:
    """K8: at least one checkpoint with validate=True and a rationale. K9: at most six in all."""
    points = _points(sg)
    if points is None:
        return
    problem = sg.catalog.problems.get(f"checkpoints/{sg.name}.py")
    if problem is not None:
        yield sg.finding("K10", "checkpoints", problem)
        return
    promised = [p for p in points if p.validate]
    if not promised:
        hint = 'Add sg.add_checkpoint("name", \'w.body("id")...\', rationale="why", validate=True).'
        yield sg.finding("K8", "checkpoints", "promises nothing: no checkpoint with validate=True", hint)
    for point in promised:
        if not point.rationale.strip():
            hint = "Say in a sentence why this shows that the subgraph did its work."
            yield sg.finding("K8", f"checkpoints.{point.name}", "has no rationale", hint)
    if len(points) > MAX_CHECKPOINTS:
        message = f"{len(points)} checkpoints; at most {MAX_CHECKPOINTS} are kept"
        yield sg.finding("K9", "checkpoints", message, "Keep the postcondition and the few probes that explain it.")


def k10_k12_expressions(sg: SubgraphContext) -> Iterator[Finding]:
    """K10: not an expression. K11: names what the task does not have. K12: asks what the cameras saw."""
    for point in _points(sg) or ():
        path = f"checkpoints.{point.name}"
        predicate = check_expression(point.predicate)
        yield from _expression(sg, path, predicate)
        if not predicate.problems and predicate.kind not in ("truth", "?"):
            message = f"is a {predicate.kind}, not a condition"
            yield sg.finding("K10", path, message, "Compare it: ... > 0.05.")
        for name, text in point.diagnostics.items():
            yield from _expression(sg, f"{path}.diagnostics.{name}", check_expression(text))


def _points(sg: SubgraphContext) -> tuple[Checkpoint, ...] | None:
    given = sg.catalog.checkpoints
    return None if given is None else given.get(sg.name, ())


def _expression(sg: SubgraphContext, path: str, checked: Checked) -> Iterator[Finding]:
    for problem in checked.problems:
        yield sg.finding("K12" if problem.camera else "K10", path, problem.message, problem.hint)
    for kind, names, known in (
        ("body", checked.bodies, sg.catalog.objects),
        ("joint", checked.joints, sg.catalog.joints),
    ):
        for name in dict.fromkeys(names):
            if known is not None and name not in known:
                hint = did_you_mean(name, known) if known else "It has none."
                yield sg.finding("K11", path, f"the task has no {kind} {name!r}", hint)


RULES = (k8_k9_number, k10_k12_expressions)
