"""A WebM of one camera in world time, for the page of a single run."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from gap_runtime.contracts.cell import CellFrame
from gap_runtime.contracts.simulator import Simulator

HZ = 10.0  # frames per second of world time
WIDTH = 480  # px


class Film:
    """Records from `start` to `stop`. `began` is the world time of its first frame [s], None before there is one."""

    def __init__(self, simulator: Simulator, file: Path) -> None:
        self.file = file
        self.began: float | None = None
        self._simulator = simulator
        self._writer: Any = None
        self._unsubscribe: Callable[[], None] | None = None
        self._camera = next(
            (c for c in simulator.camera_names if "wrist" not in c), next(iter(simulator.camera_names), "")
        )

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
