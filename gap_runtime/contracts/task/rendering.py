"""Pictures of a task's object models, for providers that learn from the models what to look for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from gap_runtime.contracts.failures import ToolError
from gap_runtime.contracts.task.objects import ObjectModel
from gap_runtime.contracts.types import CameraObservation, Mask


@dataclass(frozen=True)
class ObjectView:
    """One picture of one model, which stands alone at the world's origin turned by `yaw_deg` about z.

    The camera is `elevation_deg` above the horizon (90: straight down), on the -x side, at `distance` [m]. Where the
    model does not show, the picture is black and its depth 0; `mask` is where it does.
    """

    name: str
    yaw_deg: float
    elevation_deg: float
    distance: float
    observation: CameraObservation
    mask: Mask


def require_renderer(renderer: ObjectRenderer | None) -> ObjectRenderer:
    """The renderer. Raises `ToolError` code `no_renderer` for none."""
    if renderer is None:
        raise ToolError("no_renderer", "No plugin here renders object models.", hint="Install one: gap_mujoco does.")
    return renderer


class ObjectRenderer(Protocol):
    """Renders object models; it knows no scene and no poses."""

    def __call__(
        self,
        objects: Mapping[str, ObjectModel],
        *,
        yaws_deg: Sequence[float],
        elevations_deg: Sequence[float],
        distance: float | None = None,
        resolution: tuple[int, int] = (160, 160),
    ) -> list[ObjectView]:
        """Each model from each direction, in a fixed order: by object, elevation, yaw.

        `distance` [m] is from camera to object centre; None fits each object to the picture of `resolution`
        (width, height). Raises `GapError` where nothing can be drawn here, `DocumentError`.
        """
