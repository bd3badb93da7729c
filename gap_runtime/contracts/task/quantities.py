"""The quantities a task is made of, with their bounds."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

Triple = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0)]
