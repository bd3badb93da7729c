"""B of a task: the distributions that instances are sampled from."""

from __future__ import annotations

from pydantic import Field, model_validator

from gap_runtime.contracts.models import Document
from gap_runtime.contracts.task.quantities import Positive


class Distribution(Document):
    """B: one dm_control composer variation: exactly one of the keys."""

    constant: float | list[float] | None = None
    uniform: tuple[float | list[float], float | list[float]] | None = None
    normal: tuple[float | list[float], float | list[float]] | None = None
    choice: list[float] | None = None

    @model_validator(mode="after")
    def _one(self) -> Distribution:
        given = [k for k in ("constant", "uniform", "normal", "choice") if getattr(self, k) is not None]
        if len(given) != 1:
            raise ValueError(
                f"give exactly one of constant, uniform, normal, choice (got {', '.join(given) or 'none'})"
            )
        return self


class Placement(Document):
    """B: where an object starts: xy distribution relative to `center` [m], yaw distribution [deg], and the support."""

    center: tuple[float, float]
    offset: Distribution = Distribution(constant=[0.0, 0.0])
    yaw_deg: Distribution = Distribution(constant=0.0)
    support: str


class Belief(Document):
    """B: `regions` are named placements; a scene says which object starts in which. `clearance` [m] is the Minkowski
    margin kept between objects; `attempts` bounds rejection sampling."""

    regions: dict[str, Placement]
    clearance: Positive = 0.01
    attempts: int = Field(default=200, ge=1, le=100_000)
