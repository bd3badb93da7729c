"""B of a task: the distributions that instances are sampled from."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field, field_validator, model_validator

from gap_runtime.contracts.models import Document, ProblemsError, shown
from gap_runtime.contracts.names import Identifier
from gap_runtime.contracts.task.quantities import Number, Point2

Sample = Number | list[Number]  # a number, or one per axis
Clearance = Annotated[float, Field(gt=0, le=1, strict=True, allow_inf_nan=False)]  # m


class Distribution(Document):
    """B: one dm_control composer variation: exactly one of the keys.

    uniform     the lowest and the highest value; normal: the mean and the standard deviation; choice: any of these.
    """

    constant: Sample | None = None
    uniform: tuple[Sample, Sample] | None = None
    normal: tuple[Sample, Sample] | None = None
    choice: Annotated[list[Sample], Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _one(self) -> Distribution:
        given = [k for k in ("constant", "uniform", "normal", "choice") if getattr(self, k) is not None]
        if len(given) != 1:
            raise ValueError(
                f"should be exactly one of constant, uniform, normal, choice, not {' and '.join(given) or 'none'}"
            )
        ProblemsError.raise_any(self._disordered())
        return self

    @property
    def samples(self) -> list[tuple[str, Sample]]:
        """Every value it is given by, with its key."""
        if self.constant is not None:
            return [("constant", self.constant)]
        given = self.uniform or self.normal or self.choice or ()
        key = "uniform" if self.uniform else "normal" if self.normal else "choice"
        return [(f"{key}.{i}", value) for i, value in enumerate(given)]

    def _disordered(self) -> Iterator[tuple[str, str]]:
        """Where low is above high, or a standard deviation is below zero."""
        if self.uniform is not None and any(a > b for a, b in zip(*map(_axes, self.uniform), strict=False)):
            yield "uniform", f"{self.uniform[0]} should be at most {self.uniform[1]} along every axis"
        if self.normal is not None and min(_axes(self.normal[1]), default=0) < 0:
            yield "normal.1", f"{self.normal[1]} should be at least 0: it is the standard deviation"


def _axes(sample: Sample) -> list[float]:
    return sample if isinstance(sample, list) else [sample]


class Placement(Document):
    """B: where an object starts: xy distribution relative to `center` [m], yaw distribution [deg], and the support."""

    center: Point2
    offset: Distribution = Distribution(constant=[0.0, 0.0])
    yaw_deg: Distribution = Distribution(constant=0.0)
    support: str

    @field_validator("offset")
    @classmethod
    def _planar(cls, offset: Distribution) -> Distribution:
        ProblemsError.raise_any(
            (key, f"{shown(value)} should be 2 numbers, along x and y")
            for key, value in offset.samples
            if not isinstance(value, list) or len(value) != 2
        )
        return offset

    @field_validator("yaw_deg")
    @classmethod
    def _single(cls, yaw: Distribution) -> Distribution:
        ProblemsError.raise_any(
            (key, f"{shown(value)} should be a number") for key, value in yaw.samples if isinstance(value, list)
        )
        return yaw


class Belief(Document):
    """B: `regions` are named placements; a scene says which object starts in which. `clearance` [m] is the Minkowski
    margin kept between objects; `attempts` bounds rejection sampling."""

    regions: Annotated[dict[Identifier, Placement], Field(min_length=1)]
    clearance: Clearance = 0.01
    attempts: int = Field(default=200, ge=1, le=100_000, strict=True)
