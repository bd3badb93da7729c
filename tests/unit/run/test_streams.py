"""Streams: latest wins, nobody waits for a slow reader."""

from __future__ import annotations

import threading

import pytest

from gap_runtime.contracts.failures import CancelledError, ToolError
from gap_runtime.run.streams import Stream


class Patient:
    def check(self):
        pass


class Cancelled:
    def check(self):
        raise CancelledError("stop")


def test_a_reader_sees_the_newest_value_only():
    stream = Stream("s")
    for i in range(1000):
        stream.publish(i)
    assert stream.latest() == 999
    assert stream.count == 1000


def test_the_first_value_is_waited_for():
    stream = Stream("s")
    threading.Timer(0.02, stream.publish, [7]).start()
    assert stream.latest(Patient()) == 7


def test_a_cancelled_reader_stops_waiting():
    with pytest.raises(CancelledError):
        Stream("s").latest(Cancelled())


def test_the_last_value_outlives_its_producer():
    stream = Stream("s")
    stream.publish(1)
    stream.close()
    assert stream.latest() == 1


def test_an_end_without_a_value_is_an_error_not_a_hang():
    stream = Stream("s")
    stream.close()
    with pytest.raises(ToolError, match="published nothing"):
        stream.latest(Patient())


def test_an_item_after_the_end_is_refused():
    stream = Stream("s")
    stream.close()
    with pytest.raises(CancelledError):
        stream.publish(1)
    assert stream.count == 0


def test_waiting_for_news_returns_only_what_is_new():
    stream = Stream("s")
    stream.publish("old")
    threading.Timer(0.02, stream.publish, ["new"]).start()
    assert stream.after(1, Patient()) == "new"


def test_no_news_after_the_end():
    stream = Stream("s")
    stream.publish("old")
    stream.close()
    with pytest.raises(ToolError, match="has ended"):
        stream.after(1, Patient())
