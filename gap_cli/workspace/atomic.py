"""Writes files so that a reader, a crash or a full disk sees the old bytes or the new ones, never a mixture."""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

from gap_runtime.errors import StorageError

_HINTS = {
    errno.ENOSPC: "The disk is full; free some space. Nothing was half-written.",
    errno.EDQUOT: "Your disk quota is used up. Nothing was half-written.",
    errno.EFBIG: "The file size limit (ulimit -f) is too small. Nothing was half-written.",
    errno.EROFS: "The file system is read-only; choose another folder with --root.",
    errno.EACCES: "You may not write there; choose another folder with --root.",
    errno.EPERM: "You may not write there; choose another folder with --root.",
}


def replace_files(files: Mapping[Path, bytes], *, remove: Iterable[Path] = ()) -> list[Path]:
    """Make each path hold its bytes, touching only those that differ; then delete `remove`. Returns what changed.

    All new contents are on disk before the first is renamed into place, so a full disk changes nothing. Raises
    `StorageError`.
    """
    changed = {path: data for path, data in files.items() if not _holds(path, data)}
    staged: list[tuple[Path, Path]] = []
    made: list[Path] = []
    path = Path()
    try:
        for path, data in changed.items():
            made += make_folders(path.parent)
            staged.append((_stage(path, data), path))
        for temporary, path in staged:
            os.replace(temporary, path)  # noqa: PTH105 (one system call, and tests make it fail)
        gone = [p for p in remove if p.exists()]
        for path in gone:
            path.unlink()
        for folder in sorted({p.parent for p in [*changed, *gone]}):
            sync_folder(folder)
    except OSError as error:
        raise storage_error(path, error) from None
    finally:
        for temporary, _ in staged:
            with contextlib.suppress(OSError):
                temporary.unlink()
        for folder in reversed(made):
            with contextlib.suppress(OSError):
                folder.rmdir()  # only where nothing came to be inside
    return list(changed)


def storage_error(path: Path, error: OSError) -> StorageError:
    """The `StorageError` for an operating system error met while writing `path`."""
    hint = _HINTS.get(error.errno or 0, "Nothing was half-written.")
    return StorageError(f"Cannot write {path}: {error.strerror or error}.", hint=hint)


def make_folders(folder: Path) -> list[Path]:
    """Create `folder` and its parents; returns those that were not there, outermost first."""
    missing = [p for p in (folder, *folder.parents) if not p.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    return missing[::-1]


def sync_folder(folder: Path) -> None:
    """Make the names in `folder` survive a power cut."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _holds(path: Path, data: bytes) -> bool:
    try:
        return path.stat().st_size == len(data) and path.read_bytes() == data
    except OSError:
        return False


def _stage(path: Path, data: bytes) -> Path:
    """A synced temporary file beside `path`, holding `data`. Leaves nothing behind when it fails."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".tmp")
    temporary = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.chmod(0o666 & ~_umask())
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    return temporary


def _umask() -> int:
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
