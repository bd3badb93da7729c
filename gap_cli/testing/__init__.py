"""Shipped fakes of the toolchain: what a validator of fake graphs judges against."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gap_cli.analysis.catalog import Catalog
from gap_runtime.contracts.tool import Tool
from gap_runtime.graph.scripts import ScriptSpec
from gap_runtime.testing import fake_skill, fake_tools

__all__ = ["make_catalog"]


def make_catalog(*more: Tool, scripts: Mapping[str, ScriptSpec] | None = None, **skill: Any) -> Catalog:
    """What the validator judges such a workflow against: the fake tools, `more`, and the skill `fake`."""
    specs = {name: tool.spec for name, tool in fake_tools(*more).items()}
    return Catalog(specs, {"fake": fake_skill([t.spec.name for t in more], **skill)}, scripts or {})
