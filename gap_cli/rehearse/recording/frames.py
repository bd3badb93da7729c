"""Pictures of an episode's first and last instant, for people; nothing reads them back."""

from __future__ import annotations

from pathlib import Path

from gap_cli.workspace.metadata import frame_path
from gap_runtime.contracts.simulator import Simulator
from gap_runtime.contracts.types import CameraObservation

HEIGHT = 240  # px: a report shows hundreds of them


def save_frame(simulator: Simulator, folder: Path, seed: int, which: str) -> None:
    """Save what the world's first fixed camera sees now. Never part of a policy, so never part of its time."""
    name = next((c for c in simulator.camera_names if "wrist" not in c), simulator.camera_names[0])
    (camera,) = simulator.observe([name]).cameras
    path = frame_path(folder, seed, which)
    path.parent.mkdir(parents=True, exist_ok=True)
    _write(path, camera)


def _write(path: Path, camera: CameraObservation) -> None:
    import cv2

    rgb = camera.rgb.data
    width = round(rgb.shape[1] * HEIGHT / rgb.shape[0])
    small = cv2.resize(rgb, (width, HEIGHT), interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".png", cv2.cvtColor(small, cv2.COLOR_RGB2BGR))
    path.write_bytes(data.tobytes())
