"""One kitchen for all tests of perceiving, tracking and grasping parts."""

from __future__ import annotations

import pytest

from tests.sim.skills_perception.cell import Kitchen


@pytest.fixture(scope="session")
def kitchen(tmp_path_factory):
    made = Kitchen(tmp_path_factory.mktemp("kitchen"))
    yield made
    made.close()
