"""What older graphs wrote, and exactly what to write instead."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

RETIRED = ("service", "skill", "policy")


def flat_name(service: str, method: str) -> str:
    """`gripper.v1.Gripper` and `Open` as the flat tool name `gripper.Open`."""
    return f"{service.partition('.')[0]}.{method}"


def migration(kind: str, keys: Mapping[str, Any]) -> str:
    """What replaces a node of a retired type: the exact keys, as builder code."""
    if kind == "service":
        service, method = keys.get("service"), keys.get("method")
        known = isinstance(service, str) and isinstance(method, str)
        tool = flat_name(str(service), str(method)) if known else "<service>.<Method>"
        drop = "service and method"
    else:
        tool = next((v for k in (kind, "name", "tool") if isinstance(v := keys.get(k), str)), f"<{kind} name>")
        drop = kind
    return f'Write type="tool", tool="{tool}" and keep inputs; drop {drop}.'
