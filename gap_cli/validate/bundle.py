"""Judges a whole bundle: the rules over its workflow, and the scripts in it that are not an installed skill's own."""

from __future__ import annotations

from collections.abc import Mapping

from gap_cli.analysis.catalog import read_catalog
from gap_cli.sandbox.script_check import check_scripts
from gap_cli.validate.validator import validate
from gap_cli.workspace.inventory import Inventory
from gap_runtime.bundle.bundle import GraphBundle
from gap_runtime.contracts.documents import read_text
from gap_runtime.errors import Finding

SCRIPT_RULE = "K3"


def check_bundle(
    bundle: GraphBundle, inventory: Inventory, lines: Mapping[str, tuple[str, int]] | None = None, folder: str = ""
) -> list[Finding]:
    """Every finding, sorted by path. Names of objects are checked where `inventory` is for a task.

    `lines` is as in `validate`; `folder` (with its slash) is put before the names of scripts. A script that is, byte
    for byte, an installed skill's is trusted; any other is compiled, linted and loaded in the jail, nothing of it
    called. Raises what reading the installed skills and the task raises.
    """
    task = inventory.task if inventory.config.task else None
    objects = {*task.objects, *(model.label for model in task.objects.values())} if task else None
    joints = task.joints if task else None
    library = inventory.library
    catalog = read_catalog(
        bundle, inventory.tools, library.contracts, objects, joints=joints, descriptions=library.descriptions
    )
    findings = validate(bundle.workflow, catalog, lines)
    return sorted([*findings, *_script_findings(bundle, inventory, folder)], key=lambda f: (f.path, f.code, f.message))


def edited_scripts(bundle: GraphBundle, inventory: Inventory) -> dict[str, str]:
    """The bundle's scripts that are not an installed skill's own, which therefore run in the jail."""
    canonical = inventory.library.canonical_scripts(bundle.workflow)
    trusted = {path for path, file in canonical.items() if bundle.files.get(path) == read_text(file)}
    return {path: text for path, text in bundle.scripts.items() if path not in trusted}


def _script_findings(bundle: GraphBundle, inventory: Inventory, folder: str) -> list[Finding]:
    nodes: dict[str, str] = {}
    for name, definition in bundle.workflow.subgraphs.items():
        for key, node in definition.nodes.items():
            if node.script:
                nodes.setdefault(node.script, f"subgraphs.{name}.nodes.{key}.script")
    return [
        Finding(nodes[p.file], SCRIPT_RULE, p.message, p.hint, file=folder + p.file, line=p.line)
        for p in check_scripts(edited_scripts(bundle, inventory))
    ]
