"""The policy `hold`: stays where it is. What any learned policy must beat, and what runs where none is installed."""

from __future__ import annotations

import numpy as np

from gap_runtime.contracts.types import ActionChunk, Observation

RATE, STEPS = 20.0, 10  # Hz, targets: half a second


class HoldStill:
    """Answers every observation with the joints that the first arm has in it."""

    def reset(self) -> None:
        """It remembers nothing."""

    def act(self, observation: Observation, instruction: str) -> ActionChunk:
        """Half a second of the present configuration."""
        return ActionChunk(RATE, joints=np.repeat(observation.arm_states[0].joints.positions[None], STEPS, axis=0))
