"""The digest of a bundle: a hash of every part, one hash over all, and what differs between two of them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from gap_runtime.contracts.models import Document


class BundleDigest(Document):
    """Hashes by name. `files` are sha256 of texts; `parameters` of each subgraph's resolved parameters; `tools` are
    schema hashes of the contracts, `skills` digests of the skill folders, that the graph was checked against."""

    files: dict[str, str]
    parameters: dict[str, str] = {}
    tools: dict[str, str] = {}
    skills: dict[str, str] = {}

    @property
    def sha256(self) -> str:
        """One hash over all of it."""
        return data_sha256(self.model_dump())

    def changes(self, now: BundleDigest, folder: str = "") -> list[str]:
        """What is different in `now`, each part by name: 'scripts/main/grip.py changed', 'skill grasp-moe is gone'.
        `folder` (with its slash) is put before the names of files."""
        files = differences(self.files, now.files, folder)
        skills = differences(self.skills, now.skills, "skill ")
        # A skill that changed explains its parameters, a file that changed explains the rest.
        parameters = [] if files or skills else differences(self.parameters, now.parameters, "parameters of ")
        return [*files, *differences(self.tools, now.tools, "the contract of tool "), *skills, *parameters]


def differences(before: Mapping[str, Any], now: Mapping[str, Any], what: str = "") -> list[str]:
    """'<what><name> changed', 'is new' or 'is gone' for every name whose value is not the same in both, sorted."""
    found = []
    for name in sorted({*before, *now}):
        if before.get(name) != now.get(name):
            verb = "is new" if name not in before else "is gone" if name not in now else "changed"
            found.append(f"{what}{name} {verb}")
    return found


def text_sha256(text: str) -> str:
    """sha256 of the text as UTF-8, in hex."""
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def data_sha256(data: Any) -> str:
    """sha256 of plain data, whatever the order of its keys, in hex."""
    return text_sha256(json.dumps(data, sort_keys=True, ensure_ascii=False))
