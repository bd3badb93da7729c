import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from gap_cli.rehearse.stats import quantile, wilson

counts = st.integers(1, 500).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))


@given(counts)
def test_wilson_agrees_with_scipy(count):
    passed, total = count
    interval = binomtest(passed, total).proportion_ci(method="wilson")
    rate = wilson(passed, total)
    assert (rate.low, rate.high) == pytest.approx((interval.low, interval.high), abs=1e-12)


@given(counts)
def test_the_rate_lies_in_its_interval(count):
    rate = wilson(*count)
    assert 0 <= rate.low <= rate.value <= rate.high <= 1


def test_nothing_observed_says_nothing():
    assert (wilson(0, 0).low, wilson(0, 0).high) == (0.0, 1.0)


@pytest.mark.parametrize("bad", [(-1, 3), (4, 3)])
def test_what_is_no_rate_is_refused(bad):
    with pytest.raises(ValueError):
        wilson(*bad)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=30), st.floats(0, 1))
def test_quantile_agrees_with_numpy(values, q):
    assert quantile(values, q) == pytest.approx(float(np.quantile(values, q)), rel=1e-9, abs=1e-9)


def test_there_is_no_quantile_of_nothing():
    assert quantile([], 0.5) is None
