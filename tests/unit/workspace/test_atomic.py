import errno
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from gap_cli.workspace import atomic
from gap_cli.workspace.atomic import replace_files
from gap_runtime.errors import StorageError


def everything(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def test_writes_new_files_and_makes_their_folders(tmp_path):
    target = tmp_path / "a" / "b" / "c.txt"
    assert replace_files({target: b"one\n"}) == [target]
    assert target.read_bytes() == b"one\n"


def test_same_bytes_are_not_rewritten(tmp_path):
    target = tmp_path / "c.txt"
    replace_files({target: b"one\n"})
    before = target.stat()
    assert replace_files({target: b"one\n"}) == []
    assert (target.stat().st_mtime_ns, target.stat().st_ino) == (before.st_mtime_ns, before.st_ino)


def test_no_temporary_file_stays(tmp_path):
    replace_files({tmp_path / "c.txt": b"one\n"})
    assert names(tmp_path) == ["c.txt"]


def test_a_written_file_has_the_permissions_of_an_ordinary_one(tmp_path):
    replace_files({tmp_path / "c.txt": b"one\n"})
    (tmp_path / "plain.txt").write_bytes(b"one\n")
    assert (tmp_path / "c.txt").stat().st_mode == (tmp_path / "plain.txt").stat().st_mode


@pytest.mark.parametrize("call", ["replace", "fsync"])
@pytest.mark.parametrize("nth", [1, 2])
def test_a_disk_that_fails_leaves_whole_files_only(tmp_path, monkeypatch, call, nth):
    old = {tmp_path / "a.txt": b"old a\n", tmp_path / "b.txt": b"old b\n"}
    new = {tmp_path / "a.txt": b"new a, and longer\n", tmp_path / "b.txt": b"new b, and longer\n"}
    replace_files(old)
    real, calls = getattr(os, call), []

    def failing(*args):
        calls.append(args)
        if len(calls) == nth:
            raise OSError(errno.EIO, "Input/output error")
        return real(*args)

    monkeypatch.setattr(atomic.os, call, failing)
    with pytest.raises(StorageError, match="Cannot write"):
        replace_files(new)
    assert names(tmp_path) == ["a.txt", "b.txt"]
    for path, data in old.items():
        assert path.read_bytes() in (data, new[path])
    if call == "fsync":  # still staging: nothing was renamed
        assert {p: p.read_bytes() for p in old} == old


FULL = """
import resource, sys
from pathlib import Path
from gap_cli.workspace.atomic import replace_files
from gap_runtime.errors import StorageError
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
folder = Path(sys.argv[1])
try:
    replace_files({folder / "small.txt": b"new", folder / "deep" / "big.txt": b"x" * 5000})
except StorageError as error:
    print(error)
"""


def test_a_full_disk_changes_nothing(tmp_path):
    assert hasattr(resource, "RLIMIT_FSIZE")
    (tmp_path / "small.txt").write_bytes(b"old")
    done = subprocess.run([sys.executable, "-c", FULL, str(tmp_path)], capture_output=True, text=True, check=True)
    assert "big.txt" in done.stdout and "half-written" in done.stdout
    assert everything(tmp_path) == {"small.txt": b"old"}
    assert names(tmp_path) == ["small.txt"]


def test_removes_what_is_no_longer_wanted(tmp_path):
    replace_files({tmp_path / "a.txt": b"a\n", tmp_path / "b.txt": b"b\n"})
    replace_files({tmp_path / "a.txt": b"a\n"}, remove=[tmp_path / "b.txt"])
    assert everything(tmp_path) == {"a.txt": b"a\n"}
