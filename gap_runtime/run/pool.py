"""Threads for parallel branches: made when needed, gone when idle, and replaced when one never comes back."""

from __future__ import annotations

import os
import queue
import sys
import threading
from collections.abc import Callable

IDLE_S = 2.0
MAX_THREADS = 64


class Pool:
    """Daemon threads that run callables. A callable that never returns costs its thread, not the pool."""

    def __init__(self, max_threads: int = MAX_THREADS) -> None:
        self._max = max_threads
        self._lock = threading.Lock()
        self._work: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._threads = 0
        self._idle = 0

    @property
    def threads(self) -> int:
        """How many threads are alive."""
        return self._threads

    def submit(self, work: Callable[[], None]) -> None:
        """Run `work`, which must not raise, on some thread; on a new one where none is idle."""
        with self._lock:
            spawn = self._work.qsize() >= self._idle and self._threads < self._max
            self._threads += spawn
            self._work.put(work)
        if spawn:
            threading.Thread(target=self._run, name="gap-node", daemon=True).start()

    def replace_one(self) -> None:
        """A thread is stuck for good: allow another in its place."""
        with self._lock:
            self._max += 1

    def _run(self) -> None:
        while True:
            with self._lock:
                self._idle += 1
            try:
                work = self._work.get(timeout=IDLE_S)
            except queue.Empty:
                with self._lock:
                    if self._work.empty():
                        self._idle -= 1
                        self._threads -= 1
                        return
                    self._idle -= 1
                continue
            with self._lock:
                self._idle -= 1
            work()


_shared: list[Pool] = []
os.register_at_fork(after_in_child=_shared.clear)  # threads do not survive a fork


def shared_pool() -> Pool:
    """The pool of this process for nodes."""
    return _pools()[0]


def runner_pool() -> Pool:
    """The pool of this process for the threads graphs run on: one each, as many as there are graphs."""
    return _pools()[1]


def _pools() -> list[Pool]:
    if not _shared:
        _shared.extend((Pool(), Pool(max_threads=sys.maxsize)))
    return _shared
