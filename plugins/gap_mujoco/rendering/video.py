"""Films one camera while world time passes, and writes the film to disk."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2

from gap_runtime.contracts.cell import Cell, CellFrame
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import Array

FPS = 20
MAX_FRAMES = 6000  # five minutes, some 300 MB of 640x480 JPEG: memory is finite


class Reel:
    """Frames of one camera, as JPEG in memory until saved."""

    def __init__(self, camera: str) -> None:
        self._camera, self._frames, self._size = camera, list[Array](), (0, 0)
        self._unsubscribe: Callable[[], None] | None = None

    def __len__(self) -> int:
        return len(self._frames)

    def start(self, world: Cell) -> None:
        """Film from now on."""
        if self._unsubscribe is None:
            self._unsubscribe = world.subscribe(self._add, FPS, (self._camera,))

    def stop(self) -> None:
        """Film no more."""
        if self._unsubscribe is not None:
            self._unsubscribe()
            self._unsubscribe = None

    def clear(self) -> None:
        """Forget what was filmed."""
        self._frames.clear()

    def save(self, path: str, fps: int) -> int:
        """Write an .mp4 and return the number of frames. Raises `BadRequestError` when it cannot be written."""
        if not 1 <= fps <= 240 or Path(path).suffix != ".mp4":
            raise BadRequestError("video", f"Cannot write {path!r} at {fps} fps; give an .mp4 file and 1 to 240 fps.")
        writer = cv2.VideoWriter(path, cv2.VideoWriter.fourcc(*"mp4v"), fps, self._size)
        if not writer.isOpened():
            raise BadRequestError("video", f"Cannot write a video to {path!r}.", hint="Does its folder exist?")
        for frame in self._frames:
            writer.write(cv2.imdecode(frame, cv2.IMREAD_COLOR))
        writer.release()
        return len(self._frames)

    def _add(self, frame: CellFrame) -> None:
        if len(self._frames) < MAX_FRAMES:
            bgr = frame.observation.cameras[0].rgb.data[:, :, ::-1]
            self._size = (bgr.shape[1], bgr.shape[0])
            self._frames.append(cv2.imencode(".jpg", bgr, (cv2.IMWRITE_JPEG_QUALITY, 95))[1])
