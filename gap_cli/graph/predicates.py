"""The expressions checkpoints are written in; they live with the contracts, so that a world can judge its own task."""

from __future__ import annotations

from gap_cli.contracts.predicates import CAMERA_WORDS, Checked, Problem, check_expression, evaluate

__all__ = ["CAMERA_WORDS", "Checked", "Problem", "check_expression", "evaluate"]
