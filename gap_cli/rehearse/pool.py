"""The local engine: one process per worker, so that a crash, a hang or a lost gigabyte costs one episode."""

from __future__ import annotations

import selectors
import time
from collections import deque
from collections.abc import Callable, Sequence
from threading import Event

from gap_cli.rehearse.process import Worker
from gap_cli.rehearse.rows import void_episode
from gap_runtime.contracts.engine import EpisodeResult, RehearsalJob
from gap_runtime.errors import GapError, RunError

TICK_S = 0.2
START_LIMIT_S = 180.0
STARTS_LOST = 2  # workers that may die while starting before the rehearsal gives up


class LocalEngine:
    """Rolls episodes out on this machine. `command` is what a worker runs, for tests to replace."""

    def __init__(self, workers: int, command: Sequence[str] = ()) -> None:
        self.workers = workers
        self.command = tuple(command)

    def run(
        self, job: RehearsalJob, seeds: Sequence[int], report: Callable[[EpisodeResult], None], stop: Event
    ) -> None:
        """See `Engine.run`."""
        pool = _Pool(job, deque(seeds), report, stop, self.command)
        try:
            pool.run(min(self.workers, len(seeds)))
        finally:
            pool.close()


class _Pool:
    """The workers of one rehearsal and the seeds they have not been given yet."""

    def __init__(
        self,
        job: RehearsalJob,
        seeds: deque[int],
        report: Callable[[EpisodeResult], None],
        stop: Event,
        command: tuple[str, ...],
    ) -> None:
        self.job, self.seeds, self.report, self.stop, self.command = job, seeds, report, stop, command
        self.workers: dict[int, Worker] = {}
        self.selector = selectors.DefaultSelector()
        self.lost_starts = 0

    def run(self, size: int) -> None:
        """Until every seed is reported, or `stop` is set and what was under way is reported."""
        for slot in range(size):
            self._start(slot)
        while self._busy():
            for key, _ in self.selector.select(TICK_S):
                self._read(key.data)
            for worker in list(self.workers.values()):
                self._watch(worker)

    def close(self) -> None:
        """End every worker, politely first."""
        for worker in self.workers.values():
            worker.dismiss()
        for worker in list(self.workers.values()):
            worker.end()
        self.selector.close()

    def _busy(self) -> bool:
        working = any(w.seed is not None for w in self.workers.values())
        return working or (bool(self.seeds) and not self.stop.is_set())

    def _start(self, slot: int) -> None:
        worker = Worker.start(slot, self.job, self.command)
        self.workers[slot] = worker
        self.selector.register(worker.reader.fd, selectors.EVENT_READ, worker)

    def _read(self, worker: Worker) -> None:
        messages = worker.reader.read()
        if messages is None:
            self._lost(worker, worker.exit_reason())
            return
        for message in messages:
            if "error" in message:
                raise GapError(message["error"], hint=message.get("hint", ""))
            if "row" in message:
                self.report(EpisodeResult(message["row"]["seed"], message["row"], message["timing"]))
                worker.seed = None
            self.lost_starts = 0
            worker.ready = True
            self._assign(worker)

    def _assign(self, worker: Worker) -> None:
        if self.stop.is_set() or not self.seeds:
            return
        seed = self.seeds.popleft()
        try:
            worker.give(seed)
        except OSError:  # it died while idle; its end of the pipe says so next
            self.seeds.appendleft(seed)

    def _watch(self, worker: Worker) -> None:
        limit = self.job.wall_limit_s if worker.ready else START_LIMIT_S
        waited = time.monotonic() - worker.since
        if worker.seed is not None and waited > limit:
            worker.kill()
            self._lost(worker, f"hung: no result after {limit:g} s of wall time", status="hung")
        elif not worker.ready and waited > limit:
            worker.kill()
            self._lost(worker, f"did not start within {limit:g} s")

    def _lost(self, worker: Worker, reason: str, status: str = "crashed") -> None:
        """A worker is gone: report its episode, and put another in its place while there is work."""
        self.selector.unregister(worker.reader.fd)
        del self.workers[worker.slot]
        worker.end()
        if worker.seed is not None:
            self.report(EpisodeResult(worker.seed, void_episode(worker.seed, status, reason), {"seed": worker.seed}))
        if not worker.ready:
            self.lost_starts += 1
            if self.lost_starts >= STARTS_LOST:
                raise RunError(f"Rehearsal workers cannot start: {reason}.", hint=f"Their log is {worker.log}.")
        if self.seeds and not self.stop.is_set():
            self._start(worker.slot)
