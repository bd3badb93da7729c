"""Runs everything of one simulator on one thread: GL contexts are bound to a thread, and physics is not thread-safe."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


class SimulatorThread:
    """Calls from any thread, done one at a time on this one. A call made on this thread runs at once."""

    def __init__(self, name: str) -> None:
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix=name)
        self._id = self._pool.submit(threading.get_ident).result()

    def call(self, function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
        """The function's result, or its exception."""
        if threading.get_ident() == self._id:
            return function(*args, **kwargs)
        return self._pool.submit(function, *args, **kwargs).result()

    def close(self) -> None:
        """Finish what was begun and end the thread. Idempotent."""
        self._pool.shutdown(wait=threading.get_ident() != self._id)
