"""Pictures of an episode for people: its first and last frame, or a WebM in world time; nothing reads them back."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from gap_cli.workspace.atomic import replace_files
from gap_cli.workspace.metadata import frame_path
from gap_runtime.contracts.cell import CellFrame
from gap_runtime.contracts.simulator import Simulator

HEIGHT = 240  # px of a frame: a report shows hundreds of them
HZ = 10.0  # frames per second of world time
WIDTH = 480  # px of a video


def fixed_camera(simulator: Simulator) -> str:
    """The first camera that no arm carries, else the first; '' without one."""
    names = simulator.camera_names
    return next((c for c in names if "wrist" not in c), next(iter(names), ""))


def save_frame(simulator: Simulator, folder: Path, seed: int, which: str) -> None:
    """Save what the first fixed camera sees now, where there is one. Never part of a policy, so never part of its time.

    Raises `StorageError`.
    """
    import cv2

    name = fixed_camera(simulator)
    if not name:
        return
    (camera,) = simulator.observe([name]).cameras
    rgb = camera.rgb.data
    width = round(rgb.shape[1] * HEIGHT / rgb.shape[0])
    small = cv2.resize(rgb, (width, HEIGHT), interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".png", cv2.cvtColor(small, cv2.COLOR_RGB2BGR))
    replace_files({frame_path(folder, seed, which): data.tobytes()})


class VideoRecorder:
    """Records from `start` to `stop`. `began` is the world time of its first frame [s], None before there is one."""

    def __init__(self, simulator: Simulator, file: Path) -> None:
        self.file = file
        self.began: float | None = None
        self._simulator = simulator
        self._writer: Any = None
        self._unsubscribe: Callable[[], None] | None = None
        self._camera = fixed_camera(simulator)

    def start(self) -> None:
        """From now on; without a camera there is nothing to record."""
        if self._camera:
            self._unsubscribe = self._simulator.subscribe(self._frame, HZ, [self._camera])

    def stop(self) -> Path | None:
        """The finished file; None when nothing was recorded."""
        if self._unsubscribe is not None:
            self._unsubscribe()
        if self._writer is None:
            return None
        self._writer.release()
        return self.file

    def _frame(self, frame: CellFrame) -> None:
        import cv2

        camera = next((c for c in frame.observation.cameras if c.name == self._camera), None)
        if camera is None:
            return
        pixels = camera.rgb.data[:, :, ::-1]
        size = (WIDTH, round(pixels.shape[0] * WIDTH / pixels.shape[1] / 2) * 2)
        if self._writer is None:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            with _silent_stderr():  # the codec library remarks on its own default tag
                self._writer = cv2.VideoWriter(str(self.file), cv2.VideoWriter.fourcc(*"VP80"), HZ, size)
            self.began = frame.time
        self._writer.write(cv2.resize(np.ascontiguousarray(pixels), size, interpolation=cv2.INTER_AREA))


@contextmanager
def _silent_stderr() -> Iterator[None]:
    """What C code prints goes nowhere."""
    saved, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)
