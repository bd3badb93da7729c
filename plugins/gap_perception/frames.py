"""The frames an episode has seen, found again by the pixels of an image: tools that receive an image need its depth."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from dataclasses import dataclass, field
from threading import Lock, RLock
from typing import Any, NamedTuple

import numpy as np

from gap_runtime.contracts.tool import OBSERVED
from gap_runtime.contracts.types import CameraObservation, Image, Observation

KEEP = 6  # observations; a node looks at the latest, a comparison at the one before
DEADLINE_S = 30.0  # of a tool that looks at frames: the first look in a process renders the object models
_KEY, _STREAMED = "gap_perception.frames", "gap_perception.streamed"


@dataclass
class Scene:
    """One remembered observation and what has been worked out from it so far, under its lock."""

    observation: Observation
    digests: tuple[str, ...]
    derived: dict[str, Any] = field(default_factory=dict)
    lock: Any = field(default_factory=RLock, repr=False)


class Found(NamedTuple):
    """Where an image came from: the scene, the camera's index, and the top left pixel (x, y) when it is a crop."""

    scene: Scene
    camera_index: int
    offset: tuple[int, int]

    @property
    def camera(self) -> CameraObservation:
        """The calibrated frame the image belongs to."""
        return self.scene.observation.cameras[self.camera_index]


@dataclass
class Memory:
    """The latest observations of one episode, oldest first, by the digests of their images."""

    scenes: OrderedDict[tuple[str, ...], Scene] = field(default_factory=OrderedDict)
    lock: Any = field(default_factory=Lock, repr=False)


def digest(image: Image) -> str:
    """Content digest of an image's pixels and shape."""
    hashed = hashlib.sha256(repr(image.data.shape).encode())  # processors have instructions for it
    hashed.update(np.ascontiguousarray(image.data).data)
    return hashed.hexdigest()


def remember(state: dict[str, Any], observation: Observation) -> Scene:
    """Keep an observation for this episode; the same pixels seen twice are one scene."""
    return _keep(state.setdefault(_KEY, Memory()), observation)


def _keep(memory: Memory, observation: Observation) -> Scene:
    key = tuple(digest(c.rgb) for c in observation.cameras)
    with memory.lock:
        known = memory.scenes.get(key)
        if known is not None and known.observation == observation:
            memory.scenes.move_to_end(key)
            return known
        scene = Scene(observation, key)
        memory.scenes[key] = scene
        memory.scenes.move_to_end(key)
        while len(memory.scenes) > KEEP:
            memory.scenes.popitem(last=False)
        return scene


def latest(state: dict[str, Any]) -> Scene | None:
    """The observation made last in this episode, if any."""
    memory: Memory | None = state.get(_KEY)
    if memory is None:
        return None
    with memory.lock:
        return next(reversed(memory.scenes.values()), None)


def find(state: dict[str, Any], image: Image) -> Found | None:
    """The frame this very image was taken from, or cut out of; None for an image never observed in this episode."""
    scenes, key = [*_scenes(state.get(_KEY)), *_streamed(state)], digest(image)
    for scene in scenes:
        if key in scene.digests:
            return Found(scene, scene.digests.index(key), (0, 0))
    for scene in scenes:
        for index, camera in enumerate(scene.observation.cameras):
            offset = _crop_offset(image, camera.rgb)
            if offset is not None:
                return Found(scene, index, offset)
    return None


def _streamed(state: dict[str, Any]) -> list[Scene]:
    """What nodes took from the observation stream, newest first; kept apart, so that it displaces no other frame."""
    observed = tuple(state.get(OBSERVED, ()))
    if not observed:
        return []
    memory: Memory = state.setdefault(_STREAMED, Memory())
    known = _scenes(memory)
    for observation in observed:
        if all(scene.observation is not observation for scene in known):
            _keep(memory, observation)
    return _scenes(memory)


def _scenes(memory: Memory | None) -> list[Scene]:
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
