import contextvars
import threading

import pytest

from gap_runtime.contracts.access import assert_privileged, current_node, enter_node, leave_node, node_scope
from gap_runtime.contracts.failures import PrivilegedReadError


def test_outside_a_node_the_truth_may_be_read():
    assert current_node() is None
    assert_privileged("the poses")


def test_inside_a_node_it_may_not():
    with node_scope("grasp_sg/close"), pytest.raises(PrivilegedReadError, match=r"'grasp_sg/close'.*the poses"):
        assert_privileged("the poses")
    assert_privileged("the poses")


def test_scopes_nest_and_end_with_their_block_whatever_happens():
    with node_scope("a"):
        with pytest.raises(KeyError), node_scope("b"):
            assert current_node() == "b"
            raise KeyError
        assert current_node() == "a"
    assert current_node() is None


def test_entering_and_leaving_by_hand_is_the_same():
    token = enter_node("a")
    assert current_node() == "a"
    leave_node(token)
    assert current_node() is None


def test_one_branch_does_not_mark_another():
    inside, checked = threading.Barrier(2, timeout=10), []

    def branch():
        with node_scope("other"):
            inside.wait()
            inside.wait()

    thread = threading.Thread(target=branch)
    thread.start()
    inside.wait()
    checked.append(current_node())
    inside.wait()
    thread.join()
    assert checked == [None]


def test_a_thread_that_is_given_the_context_of_a_node_is_bound_by_it():
    seen = []
    with node_scope("a"):
        context = contextvars.copy_context()
    thread = threading.Thread(target=context.run, args=(lambda: seen.append(current_node()),))
    thread.start()
    thread.join()
    assert seen == ["a"]
