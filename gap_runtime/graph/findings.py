"""What the validator has to say: findings as data, all of them at once."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal


@dataclass(frozen=True, order=True)
class Finding:
    """One problem. `path` is where in the workflow (`subgraphs.grasp_sg.nodes.close.inputs.arm_id`); `line` is the
    line of builder code that wrote it, where there is one. An `error` stops the workflow; a `note` does not."""

    path: str
    code: str
    message: str
    hint: str = ""
    severity: Literal["error", "note"] = "error"
    line: int | None = None

    def as_dict(self) -> dict[str, Any]:
        """Plain data, None left out."""
        return {k: v for k, v in asdict(self).items() if v not in (None, "")}
