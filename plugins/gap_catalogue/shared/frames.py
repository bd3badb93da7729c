"""The observations of an episode, found again by the pixels of an image: tools given an image need its depth too."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from dataclasses import dataclass, field
from threading import Lock, RLock
from typing import Any, NamedTuple

import numpy as np

from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import OBSERVED, ToolContext
from gap_runtime.contracts.types import CameraObservation, Image, Observation

KEEP = 6  # observations; a node looks at the latest, a comparison at the one before
_KEY, _STREAMED = "frames", "frames.streamed"  # in `ToolContext.state`


@dataclass
class SeenObservation:
    """One remembered observation and what has been worked out from it so far, under its lock."""

    observation: Observation
    digests: tuple[str, ...]
    derived: dict[str, Any] = field(default_factory=dict)
    lock: Any = field(default_factory=RLock, repr=False)


class FoundFrame(NamedTuple):
    """Where an image came from: the scene, the camera's index, and the top left pixel (x, y) when it is a crop."""

    scene: SeenObservation
    camera_index: int
    offset: tuple[int, int]

    @property
    def camera(self) -> CameraObservation:
        """The calibrated frame the image belongs to."""
        return self.scene.observation.cameras[self.camera_index]


@dataclass
class FrameMemory:
    """The latest observations of one episode, oldest first, by the digests of their images."""

    scenes: OrderedDict[tuple[str, ...], SeenObservation] = field(default_factory=OrderedDict)
    lock: Any = field(default_factory=Lock, repr=False)


def digest(image: Image) -> str:
    """Content digest of an image's pixels and shape."""
    hashed = hashlib.sha256(repr(image.data.shape).encode())  # processors have instructions for it
    hashed.update(np.ascontiguousarray(image.data).data)
    return hashed.hexdigest()


def remember(state: dict[str, Any], observation: Observation) -> SeenObservation:
    """Keep an observation for this episode; the same pixels seen twice are one scene."""
    return _keep(state.setdefault(_KEY, FrameMemory()), observation)


def _keep(memory: FrameMemory, observation: Observation) -> SeenObservation:
    key = tuple(digest(c.rgb) for c in observation.cameras)
    with memory.lock:
        known = memory.scenes.get(key)
        if known is not None and known.observation == observation:
            memory.scenes.move_to_end(key)
            return known
        scene = SeenObservation(observation, key)
        memory.scenes[key] = scene
        memory.scenes.move_to_end(key)
        while len(memory.scenes) > KEEP:
            memory.scenes.popitem(last=False)
        return scene


def latest(state: dict[str, Any]) -> SeenObservation | None:
    """The observation made last in this episode, if any."""
    memory: FrameMemory | None = state.get(_KEY)
    if memory is None:
        return None
    with memory.lock:
        return next(reversed(memory.scenes.values()), None)


def find(state: dict[str, Any], image: Image) -> FoundFrame | None:
    """The frame this very image was taken from, or cut out of; None for an image never observed in this episode."""
    scenes, key = [*_scenes(state.get(_KEY)), *_streamed(state)], digest(image)
    for scene in scenes:
        if key in scene.digests:
            return FoundFrame(scene, scene.digests.index(key), (0, 0))
    for scene in scenes:
        for index, camera in enumerate(scene.observation.cameras):
            offset = _crop_offset(image, camera.rgb)
            if offset is not None:
                return FoundFrame(scene, index, offset)
    return None


def images_meant(ctx: ToolContext, image: Image | None, every_camera: bool = False) -> list[Image]:
    """The images a request is about: the given one, else the latest observation's first camera; or all its cameras'.

    Raises `BadRequestError` (`no_image`) when none was given and nothing was observed yet in this episode.
    """
    if image is not None and not every_camera:
        return [image]
    found = None if image is None else find(ctx.state, image)
    if image is not None and found is None:
        return [image]
    seen = found.scene if found else latest(ctx.state)
    if seen is None or not seen.observation.cameras:
        raise BadRequestError(
            "no_image", "There is no image: none was given and nothing was observed yet.",
            hint="Call observation.GetObservation first, or pass an image.",
        )  # fmt: skip
    images = [camera.rgb for camera in seen.observation.cameras]
    return images if every_camera else images[:1]


def _streamed(state: dict[str, Any]) -> list[SeenObservation]:
    """What nodes took from the observation stream, newest first; kept apart, so that it displaces no other frame."""
    observed = tuple(state.get(OBSERVED, ()))
    if not observed:
        return []
    memory: FrameMemory = state.setdefault(_STREAMED, FrameMemory())
    known = _scenes(memory)
    for observation in observed:
        if all(scene.observation is not observation for scene in known):
            _keep(memory, observation)
    return _scenes(memory)


def _scenes(memory: FrameMemory | None) -> list[SeenObservation]:
    """Newest first."""
    if memory is None:
        return []
    with memory.lock:
        return list(reversed(memory.scenes.values()))


def _crop_offset(image: Image, frame: Image) -> tuple[int, int] | None:
    """Where `image` lies in `frame` pixel for pixel, as (x, y), or None. Flat images match anywhere and are refused."""
    (rows, columns, _), (frame_rows, frame_columns, _) = image.data.shape, frame.data.shape
    if not (0 < rows <= frame_rows and 0 < columns <= frame_columns) or (rows, columns) == (frame_rows, frame_columns):
        return None
    if image.data.min() == image.data.max():
        return None
    # Search for the row with the most contrast: a plain floor row would match in thousands of places.
    row = int(image.data.reshape(rows, -1).std(axis=1).argmax())
    needle, haystack = image.data[row].tobytes(), frame.data.tobytes()
    at = haystack.find(needle)
    while at >= 0:
        if at % 3 == 0:
            y, x = divmod(at // 3, frame_columns)
            y -= row
            inside = 0 <= y <= frame_rows - rows and x <= frame_columns - columns
            if inside and (frame.data[y : y + rows, x : x + columns] == image.data).all():
                return x, y
        at = haystack.find(needle, at + 1)
    return None
