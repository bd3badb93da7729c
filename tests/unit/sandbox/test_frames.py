import os
import threading
import time

import pytest

from gap_cli.sandbox.framing import (
    HEADER,
    DeadlineError,
    FloodError,
    HangUpError,
    Pipes,
    read_frame,
    write_frame,
)


@pytest.fixture
def pipes():
    made = Pipes(time.monotonic() + 0.2)
    yield made
    made.close()


def test_a_message_larger_than_the_pipe_goes_both_ways(pipes):
    pipes.deadline = time.monotonic() + 20
    payload = os.urandom(5_000_000)
    child = threading.Thread(target=lambda: write_frame(pipes.child_writes, read_frame(pipes.child_reads)))
    child.start()
    pipes.send(payload)
    assert pipes.receive(len(payload)) == payload
    child.join()


def test_silence_ends_at_the_deadline(pipes):
    with pytest.raises(DeadlineError):
        pipes.receive(10)


def test_a_message_that_stops_halfway_ends_at_the_deadline(pipes):
    os.write(pipes.child_writes, HEADER.pack(10) + b"half")
    with pytest.raises(DeadlineError):
        pipes.receive(10)


def test_a_reader_that_never_reads_ends_at_the_deadline(pipes):
    with pytest.raises(DeadlineError):
        pipes.send(bytes(8_000_000))


def test_an_announced_length_is_refused_before_a_byte_of_it_is_read(pipes):
    os.write(pipes.child_writes, HEADER.pack(11) + b"eleven byte")
    with pytest.raises(FloodError):
        pipes.receive(10)
    assert os.read(pipes._reading, 99) == b"eleven byte"


def test_a_closed_pipe_is_a_hang_up(pipes):
    pipes.give_away()
    with pytest.raises(HangUpError):
        pipes.receive(10)
    with pytest.raises(HangUpError):
        pipes.send(b"x")


def test_waiting_gives_up_when_told_to():
    class Stop(Exception):
        pass

    def check():
        raise Stop

    pipes = Pipes(time.monotonic() + 10, check)
    with pytest.raises(Stop):
        pipes.receive(10)
    pipes.close()


def test_closing_twice_closes_nobody_elses_descriptor(pipes):
    pipes.close()
    other = os.open(os.devnull, os.O_RDONLY)
    pipes.close()
    os.fstat(other)
    os.close(other)
