"""Two nodes that look at one moment share one scene, and what it shows is worked out once."""

from __future__ import annotations

import threading
import time
from types import SimpleNamespace

from gap_catalogue.shared.frames import remember
from gap_perception.scene import analyse
from tests.unit.perception.test_frames import observation


def test_nodes_side_by_side_that_observe_the_same_moment_analyse_it_once(monkeypatch):
    made, found, state = [], [], {}

    def slowly(ctx, scene):
        time.sleep(0.02)  # long enough for the other to ask meanwhile
        made.append(scene)
        return object()

    monkeypatch.setattr(analyse, "_analyse", slowly)
    ready = threading.Barrier(2)

    def look():
        ready.wait()
        scene = remember(state, observation(1))
        found.append((scene, analyse.analyse(SimpleNamespace(state=state), scene)))

    threads = [threading.Thread(target=look) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) == 1
    assert found[0][0] is found[1][0] and found[0][1] is found[1][1]
