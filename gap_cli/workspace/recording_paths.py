"""Where the heavy files of a rehearsal go, which git does not see: pictures and recordings, by seed."""

from __future__ import annotations

from pathlib import Path


def frame_path(folder: Path, seed: int, which: str) -> Path:
    """Where the `first` or `last` frame of a seed goes."""
    return folder / "frames" / f"seed-{seed:06d}-{which}.png"


def recording_path(folder: Path, seed: int) -> Path:
    """Where the recording of a seed goes."""
    return folder / f"seed-{seed:06d}.mcap"
