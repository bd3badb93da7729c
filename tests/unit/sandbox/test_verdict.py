import signal

import pytest

from gap_cli.sandbox import exit_status as verdict
from gap_cli.sandbox.zygote import NOT_LOCKED


@pytest.mark.parametrize(
    ("status", "cause"),
    [
        (signal.SIGSYS, "syscall"),
        (signal.SIGXCPU, "timeout"),
        (signal.SIGXFSZ, "syscall"),
        (signal.SIGSEGV, "crash"),
        (signal.SIGKILL, "crash"),
        (0, "crash"),
        (NOT_LOCKED << 8, "unavailable"),
        (None, "crash"),
        (-1, "crash"),
    ],
)
def test_a_wait_status_becomes_one_word(status, cause):
    assert verdict.ended("It", status).cause == cause


@pytest.mark.parametrize("line", [-1, 0, 10**9, "7", True, 1.5, None, []])
def test_a_line_that_is_none_is_left_out(line):
    assert verdict.reported("It", {"message": "x", "line": line}).line is None


@pytest.mark.parametrize("cause", [None, [], {}, "timeout", "unavailable", "../x"])
def test_the_child_may_only_claim_what_it_can_know(cause):
    assert verdict.reported("It", {"message": "x", "cause": cause}).cause == "error"


def test_text_of_the_child_is_bounded_and_printable():
    assert verdict.clean("a\x1b[2Jb\u202ec\ud800\nd") == "a\ufffd[2Jb\ufffdc?\nd"
    assert len(verdict.clean("x" * 10**6)) == verdict.MAX_TEXT
    assert verdict.clean({"a": 1}) == ""


def test_the_line_is_in_the_message_and_in_the_error():
    error = verdict.reported("The builder code", {"message": "no", "line": 7, "hint": "do", "cause": "forbidden"})
    assert (str(error), error.line, error.cause) == ("The builder code, line 7: no. do", 7, "forbidden")
