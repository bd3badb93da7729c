"""Streaming nodes and the observation stream: started with their subgraph, ended and freed with it."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator
from time import monotonic
from typing import Any

from gap_cli.contracts.failures import CancelledError, ToolError
from gap_cli.contracts.privilege import enter_node, leave_node
from gap_cli.contracts.tool import OBSERVED
from gap_cli.contracts.typeref import TypeRef
from gap_cli.contracts.world import World, WorldFrame
from gap_cli.graph.attempt import Attempt
from gap_cli.graph.compiled import Callee
from gap_cli.graph.context import NodeContext, Services, claim
from gap_cli.graph.frame import Frame
from gap_cli.graph.perform import inputs_of
from gap_cli.graph.streams import Stream
from gap_cli.graph.synthesize import synthesize

ENDING_S = 1.0
DEFAULT_HZ = 10.0
KEPT = 4


class Observations:
    """What `in.observation_stream` reads: the world's sensors at `hz` of world time, from the first reader on.

    What was taken last is kept in the episode's `state`, for tools that are handed only an image of it.
    """

    def __init__(self, world: World | None, hz: str, dry: bool, state: dict[str, Any]) -> None:
        self._world, self._hz, self._dry, self._state = world, float(hz or DEFAULT_HZ), dry, state
        self._lock = threading.Lock()
        self._stream: Stream | None = None
        self._unsubscribe: Callable[[], None] = lambda: None

    def stream(self) -> Stream:
        """The stream, subscribed now if it is the first request. Raises `ToolError` in a run without a world."""
        if self._world is None and not self._dry:
            raise ToolError("no_world", "This run has no world to observe.")
        with self._lock:
            if self._stream is None:
                taken = self._state.setdefault(OBSERVED, deque(maxlen=KEPT))
                stream = self._stream = Stream("in.observation_stream", taken.append)
                if self._world is None:
                    stream.publish(synthesize(TypeRef("Observation")))
                    return stream
                self._unsubscribe = self._world.subscribe(
                    lambda f: _offer(stream, f), self._hz, self._world.camera_names
                )
                stream.publish(self._world.observe())
            return self._stream

    def close(self) -> None:
        """Unsubscribe. Idempotent."""
        self._unsubscribe()
        self._unsubscribe = lambda: None
        if self._stream is not None:
            self._stream.close()


def start_streaming(services: Services, attempt: Attempt, on_error: Callable[[Attempt], None]) -> None:
    """Spawn a streaming node; its frame ends it."""
    frame, node = attempt.frame, attempt.node
    stream = Stream(node.path)
    frame.streams[node.index] = stream
    frame.streamers.append(attempt)
    attempt.finished = threading.Event()
    threading.Thread(
        target=_stream_node, args=(services, attempt, stream, on_error), name=f"gap-{node.path}", daemon=True
    ).start()


def stop_streaming(services: Services, frame: Frame) -> list[Attempt]:
    """Tell the frame's streaming nodes to stop, wait a little, give up on the rest; what each held is free again."""
    streamers, frame.streamers = frame.streamers, []
    for attempt in streamers:
        attempt.cancel("the subgraph has ended")
    for stream in frame.streams.values():
        stream.close()
    limit = monotonic() + ENDING_S
    for attempt in streamers:
        attempt.finished.wait(max(0.0, limit - monotonic()))
        attempt.abandon(services.settling)
        services.leases.release(attempt)
    return streamers


def _offer(stream: Stream, frame: WorldFrame) -> None:
    if not stream.closed:
        stream.publish(frame.observation)


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
    settled = attempt.settle(services.settling, None, error)
    stream.close()
    attempt.finished.set()
    if settled and error is not None:
        on_error(attempt)


def _produce(services: Services, attempt: Attempt, callee: Callee, stream: Stream) -> None:
    """Run the callee: it publishes by itself, yields items, or returns one item per call and is called again."""
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
        _wait_for_news(services, attempt)


def _wait_for_news(services: Services, attempt: Attempt) -> None:
    """Until the world has shown something new; a node that is polled would only repeat itself before."""
    if services.world is None:
        attempt.finished.wait(1.0 / DEFAULT_HZ)
        attempt.check()
        return
    source = attempt.frame.observations()
    source.after(source.count, attempt)
