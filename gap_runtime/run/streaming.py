"""Streaming nodes and the observation stream: started with their subgraph, ended and freed with it."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator
from time import monotonic

from gap_runtime.contracts.access import enter_node, leave_node
from gap_runtime.contracts.cell import CellFrame
from gap_runtime.contracts.failures import CancelledError, ToolError
from gap_runtime.contracts.tool import OBSERVED
from gap_runtime.contracts.types.typeref import TypeRef
from gap_runtime.graph.compiled import BoundCallable
from gap_runtime.run.activation import SubgraphActivation
from gap_runtime.run.attempt import Attempt
from gap_runtime.run.context import NodeContext, claim, inputs_of
from gap_runtime.run.placeholders import placeholder
from gap_runtime.run.services import Services
from gap_runtime.run.streams import Stream, StreamReader

ENDING_S = 1.0
DEFAULT_HZ = 10.0
KEPT = 4
FIRST_S = 60.0  # of wall time to wait for what a streaming node publishes first
READERS_S = 60.0  # of wall time that the cell of a rehearsal waits for a streaming node


class Observations:
    """What `in.observation_stream` reads: the cell's sensors at `hz` of cell time, from the first reader on.

    What was read last is kept in the episode's `state`, for tools that are handed only an image of it.
    """

    def __init__(self, services: Services, hz: str, dry: bool) -> None:
        self._cell, self._hz, self._dry, self._state = services.cell, float(hz or DEFAULT_HZ), dry, services.state
        self._waiting_s = READERS_S if services.lockstep else 0.0
        self._lock = threading.Lock()
        self._stream: Stream | None = None
        self._unsubscribe: Callable[[], None] = lambda: None

    def stream(self) -> Stream:
        """The stream, subscribed now if it is the first request. Raises `ToolError` in a run without a cell."""
        if self._cell is None and not self._dry:
            raise ToolError("no_cell", "This run has no cell to observe.")
        with self._lock:
            if self._stream is None:
                taken = self._state.setdefault(OBSERVED, deque(maxlen=KEPT))
                stream = self._stream = Stream("in.observation_stream", taken.append)
                if self._cell is None:
                    stream.publish(placeholder(TypeRef("Observation")))
                    return stream
                self._unsubscribe = self._cell.subscribe(
                    lambda f: self._offer(stream, f), self._hz, self._cell.camera_names
                )
                stream.publish(self._cell.observe())
            return self._stream

    def _offer(self, stream: Stream, activation: CellFrame) -> None:
        if not stream.closed:
            stream.publish(activation.observation)
            stream.wait_for_readers(self._waiting_s)

    def close(self) -> None:
        """Unsubscribe. Idempotent."""
        self._unsubscribe()
        self._unsubscribe = lambda: None
        if self._stream is not None:
            self._stream.close()


def start_streaming(services: Services, attempt: Attempt, on_error: Callable[[Attempt], None]) -> None:
    """Spawn a streaming node. In lockstep it has published, or ended, before anything else runs."""
    activation, node = attempt.activation, attempt.node
    stream = Stream(node.path)
    activation.streams[node.index] = stream
    activation.streamers.append(attempt)
    attempt.finished = threading.Event()
    threading.Thread(
        target=_stream_node, args=(services, attempt, stream, on_error), name=f"gap-{node.path}", daemon=True
    ).start()
    if services.lockstep:
        stream.wait_for_first(FIRST_S)


def stop_streaming(services: Services, activation: SubgraphActivation) -> list[Attempt]:
    """Tell the streaming nodes to stop, wait a little, abandon the rest; what each held is free again."""
    streamers, activation.streamers = activation.streamers, []
    for attempt in streamers:
        attempt.cancel("the subgraph has ended")
    for stream in activation.streams.values():
        stream.close()
    limit = monotonic() + ENDING_S
    for attempt in streamers:
        attempt.finished.wait(max(0.0, limit - monotonic()))
        attempt.abandon(services.completing)
        services.leases.release(attempt)
    return streamers


def _stream_node(services: Services, attempt: Attempt, stream: Stream, on_error: Callable[[Attempt], None]) -> None:
    node, error = attempt.node, None
    assert node.callee is not None
    token = enter_node(node.path)
    try:
        attempt.begin(services.patience)
        _produce(services, attempt, node.callee, stream)
    except BaseException as problem:
        error = None if attempt.cancelled and isinstance(problem, CancelledError) else problem
    finally:
        leave_node(token)
    settled = attempt.complete(services.completing, None, error)
    stream.close()
    attempt.finished.set()
    if settled and error is not None:
        on_error(attempt)


def _produce(services: Services, attempt: Attempt, callee: BoundCallable, stream: Stream) -> None:
    """Run the callee: it publishes by itself, yields items, or returns one item per call and is called again."""
    observations: StreamReader | None = None
    while True:
        kwargs = inputs_of(attempt, callee)
        claim(services, attempt, callee, kwargs)
        context = NodeContext(services, attempt, callee.allowed)
        result = callee.invoke(context, kwargs)
        if isinstance(result, Iterator):
            try:
                for item in result:
                    context.publish(item)
            finally:  # now, not when it is collected: what it frees must be free before its subgraph is left
                getattr(result, "close", lambda: None)()
            return
        if result is None:
            return
        context.publish(result)
        if services.cell is None:
            attempt.finished.wait(1.0 / DEFAULT_HZ)
            attempt.check()
            continue
        if observations is None:
            source = attempt.activation.observations()
            observations = source.reader(attempt, source.count)
        observations.next()  # a node that is polled would only repeat itself before the cell has shown something new
