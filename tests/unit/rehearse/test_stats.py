import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gap_cli.rehearse.stats import spread, wilson

counts = st.integers(1, 500).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n)))


def wilson_1927(passed, total):
    z, p = 1.959963984540054, passed / total
    scale = 1 + z * z / total
    centre, half = p + z * z / (2 * total), z * math.sqrt(p * (1 - p) / total + z * z / (4 * total * total))
    return (centre - half) / scale, (centre + half) / scale


@given(counts)
def test_the_interval_is_wilsons(count):
    rate = wilson(*count)
    assert (rate.low, rate.high) == pytest.approx(wilson_1927(*count), abs=1e-12)


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


def test_the_spread_of_durations():
    assert spread([4.0, 1.0, 2.0, 3.0]) == {"median": 2.5, "p90": pytest.approx(3.7), "max": 4.0}


def test_there_is_no_spread_of_nothing():
    assert spread([]) == {"median": None, "p90": None, "max": None}
