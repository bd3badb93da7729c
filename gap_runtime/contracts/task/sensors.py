"""How real a task's cameras are: noise models by name, and which camera has which. None, unless the task says so."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated

from pydantic import Field, model_validator

from gap_runtime.contracts.failures import DocumentError, did_you_mean
from gap_runtime.contracts.models import Document, ProblemsError, unknown
from gap_runtime.contracts.names import Name

_FINITE = {"strict": True, "allow_inf_nan": False}
Amount = Annotated[float, Field(ge=0, **_FINITE)]
Positive = Annotated[float, Field(gt=0, **_FINITE)]


class StereoDepth(Document):
    """Depth as an active stereo camera measures it: noise of the disparity, so that of depth grows with its square.

    At depth z [m] its standard deviation is z² · `subpixel` / (`focal` · `baseline`) (Grunnet-Jepsen, Sweetser and
    Woodfill, "Tuning depth cameras for best performance", Intel RealSense, section "theoretical limit").

    - `baseline` [m] between the imagers; what only the first one sees has no depth.
    - `focal` length [px] of the imagers that depth is computed from, whatever the picture's resolution.
    - `subpixel` [px]: standard deviation of the disparity.
    - `grain` [px]: matching compares windows, so neighbours err alike; standard deviation of the smoothing.
    - `jitter` [px]: standard deviation of where a pixel's depth is taken from; frays edges (lateral noise of Nguyen,
      Izadi and Lovell, "Modeling Kinect sensor noise", 3DIMPVT 2012; shifts of Handa et al., ICRA 2014).
    - `dropout`: share of the pixels without depth, in specks of the size of the grain.
    - `unit` [m]: depth comes in whole multiples of it; 0 for any.
    """

    baseline: Positive
    focal: Positive
    subpixel: Amount
    grain: Annotated[float, Field(ge=0, le=20, **_FINITE)] = 0.0
    jitter: Annotated[float, Field(ge=0, le=20, **_FINITE)] = 0.0
    dropout: Annotated[float, Field(ge=0, lt=1, **_FINITE)] = 0.0
    unit: Amount = 0.0

    def deviation(self, z: float) -> float:
        """Standard deviation of a depth of `z` [m], in m."""
        return z * z * self.subpixel / (self.focal * self.baseline)


class CameraNoise(Document):
    """What separates a camera from a perfect one; all of it zero unless given.

    `depth` and `colour` are drawn for every frame, the rest once per episode.

    - `colour` [levels of 255]: standard deviation in every channel.
    - `light`: the largest relative change, up or down, of all lights together and of each on its own.
    - `shift` [m] and `turn` [deg]: root mean square length and angle by which the camera is not where it is said to be.
    """

    depth: StereoDepth | None = None
    colour: Annotated[float, Field(ge=0, le=255, **_FINITE)] = 0.0
    light: Annotated[float, Field(ge=0, lt=1, **_FINITE)] = 0.0
    shift: Amount = 0.0
    turn: Annotated[float, Field(ge=0, le=45, **_FINITE)] = 0.0


class Sensors(Document):
    """Noise models by name; `use` names the one all cameras have, or one per camera, robot-mounted ones included.

    Lights are shared: where cameras differ in `light`, the largest holds.
    """

    models: dict[Name, CameraNoise] = {}
    use: str | dict[str, str] = {}

    @model_validator(mode="after")
    def _known(self) -> Sensors:
        named = {"use": self.use} if isinstance(self.use, str) else {f"use.{c}": n for c, n in self.use.items()}
        ProblemsError.raise_any(unknown(named.items(), self.models, "in sensors.models"))
        return self

    def by_camera(self, cameras: Iterable[str], where: str) -> Mapping[str, CameraNoise]:
        """The model of each noisy camera. Raises `DocumentError` about `where` when `use` names none of `cameras`."""
        known = list(cameras)
        if isinstance(self.use, str):
            return dict.fromkeys(known, self.models[self.use])
        for name in self.use:
            if name not in known:
                raise DocumentError(where, f"sensors.use.{name}: is not a camera", hint=did_you_mean(name, known))
        return {name: self.models[model] for name, model in self.use.items()}
