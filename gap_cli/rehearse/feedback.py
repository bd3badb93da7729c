"""feedback.md, in the form of the paper's sample feedback: node table, representative failures, what to revise.

Everything in it is computed from the episodes; nothing is judged by a model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gap_cli.rehearse.rows import VOID
from gap_cli.rehearse.summary import Row, last_visit, rate_of

REPRESENTATIVE = 3  # failure groups shown in full
SHOWN_SEEDS = 12


def feedback_text(summary: Mapping[str, Any], rows: Sequence[Row], rationales: Mapping[str, Mapping[str, str]]) -> str:
    """The page. `rationales` maps a subgraph to checkpoint name -> why it was asked for."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    env = Environment(
        loader=PackageLoader("gap_cli.rehearse", "templates"), undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True, autoescape=False,
    )  # fmt: skip
    return env.get_template("feedback.md.j2").render(
        summary=summary,
        rate=str(rate_of(summary)),
        opening=_opening(summary),
        table=[_table_row(sg, rationales.get(sg["ref"], {})) for sg in summary["subgraphs"]],
        cases=[_case(group, rows) for group in summary["failures"][:REPRESENTATIVE]],
        more=summary["failures"][REPRESENTATIVE:],
        signal=_signal(summary),
    )


def _opening(summary: Mapping[str, Any]) -> str:
    fine = [s["node"] for s in summary["subgraphs"] if s["validation"]["passed"] == s["validation"]["of"]]
    bad = [f"`{s['node']}` ({s['validation']['passed']}/{s['validation']['of']})" for s in summary["subgraphs"]
           if s["validation"]["passed"] < s["validation"]["of"]]  # fmt: skip
    if not bad:
        return "Every subgraph keeps its promises in every sampled instance."
    start = f"{_listing(f'`{n}`' for n in fine)} hold in every sampled instance, while" if fine else "In this rehearsal"
    return f"{start} failures show at {_listing(bad)}."


def _table_row(subgraph: Mapping[str, Any], rationales: Mapping[str, str]) -> dict[str, str]:
    rate = subgraph["validation"]
    notes = []
    for name, tally in subgraph["checkpoints"].items():
        why = rationales.get(name, "")
        missed = tally["of"] - tally["passed"]
        notes.append(f"{why or name}" + (f" **{name}: not so in {missed} of {tally['of']}.**" if missed else ""))
    exits = ", ".join(f"{k} {n}" for k, n in subgraph["exits"].items()) or "never reached"
    notes.append(f"Reached {subgraph['reached']}; exits: {exits}.")
    text = f"{rate['rate']:.2f} ({rate['passed']}/{rate['of']})"
    return {"node": subgraph["node"], "validation": text, "feedback": _cell(" ".join(notes))}


def _case(group: Mapping[str, Any], rows: Sequence[Row]) -> dict[str, Any]:
    """The first episode of a failure group, with its numbers."""
    row = next(r for r in rows if r["seed"] == group["seeds"][0])
    shown = group["seeds"][:SHOWN_SEEDS]
    seeds = ", ".join(map(str, shown)) + (", ..." if len(group["seeds"]) > len(shown) else "")
    return {**group, "seed": row["seed"], "seed_list": seeds, "numbers": _numbers(row, group["stage"]),
            "transitions": _transitions(row, group["stage"]), "lost": row["status"] in VOID}  # fmt: skip


def _numbers(row: Row, stage: str) -> list[str]:
    visit = last_visit(row, stage)
    if visit is None:
        return [f"{name} = {value}" for name, value in row.get("judged", {}).items()]
    found = [f"exit = {visit['exit']}", f"elapsed = {visit['motion_s']:.3f} s"]
    for name, point in visit["checkpoints"].items():
        found.append(f"{name} = {point['passed']}")
        found += [f"{key} = {_number(value)}" for key, value in point["values"].items()]
    for thing, value in visit["state"].items():
        if isinstance(value, dict):
            found.append(f"{thing} at {_number(value['position'])}, contacts {_number(value['contacts'])}")
        else:
            found.append(f"{thing} = {_number(value)}")
    return found


def _transitions(row: Row, stage: str) -> list[str]:
    """What the last nodes of the failing subgraph did to the world, one line each."""
    nodes = [n for n in row.get("nodes", ()) if n["node"].partition("/")[0] == stage]
    lines = []
    for node in nodes[-4:]:
        parts = [f"{thing}: {_change(change)}" for thing, change in node["changes"].items()]
        parts += [] if node["ok"] else [f"failed: {node['error']}"]
        lines.append(f"`{node['node']}` " + ("; ".join(parts) or "changed nothing"))
    return lines


def _change(change: Mapping[str, Any]) -> str:
    parts = []
    for key, value in change.items():
        if key in ("gripper", "position"):
            parts.append(f"{key} {_number(value[0])} -> {_number(value[1])}")
        else:
            parts.append(f"{key} {_number(value)}")
    return ", ".join(parts)


def _signal(summary: Mapping[str, Any]) -> list[str]:
    """What the next graph should change: where most episodes are lost, and what that skill allows."""
    lost = sum(summary["void"].values())
    lines = [f"{lost} episodes are void ({_void(summary)}): mend the simulation before the graph."] if lost else []
    by_stage: dict[str, int] = {}
    for group in summary["failures"]:
        if group["status"] not in VOID:
            by_stage[group["stage"]] = by_stage.get(group["stage"], 0) + group["count"]
    about = {s["node"]: s for s in summary["subgraphs"]}
    for stage, count in sorted(by_stage.items(), key=lambda item: (-item[1], item[0])):
        causes = _listing(sorted({g["cause"] for g in summary["failures"] if g["stage"] == stage}))
        line = f"Revise `{stage}`: {count} of {summary['episodes']} episodes are lost there ({causes})."
        sg = about.get(stage, {})
        options = [f"swap `{sg['skill']}` for {_listing(f'`{s}`' for s in sg['swaps'])}"] if sg.get("swaps") else []
        options += [f"tune {_listing(f'`{p}`' for p in sg['parameters'])}"] if sg.get("parameters") else []
        lines.append(line + (f" Its contract allows to {' or to '.join(options)}." if options else ""))
    false = summary["disagreements"]["claimed_but_not"]
    if false:
        lines.append(f"On seeds {_listing(map(str, false))} the graph claimed success and had none: it needs a check.")
    return lines or ["Nothing failed. Shorten the motion, or widen the variant."]


def _void(summary: Mapping[str, Any]) -> str:
    return ", ".join(f"{n} {status}" for status, n in summary["void"].items())


def _number(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.3f}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_number(v) for v in value) + "]"
    return str(value)


def _listing(items: Any) -> str:
    words = list(items)
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1] if words else ""


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
