"""Tiny checkpoints, made once per session and named to the plugin as a user names them: by environment variable."""

from __future__ import annotations

import os

os.environ.setdefault("HF_HUB_OFFLINE", "1")  # before any test imports the hub's client: no test may touch the net

from types import SimpleNamespace

import pytest
import torch

from gap_hf import loading
from gap_hf.settings import WEIGHTS, variable
from tests.unit.hf import tiny


@pytest.fixture(scope="session", autouse=True)
def _one_thread():
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(autouse=True)
def _plain_environment(monkeypatch):
    for name in [n for n in os.environ if n.startswith("GAP_HF_") and n not in ("GAP_HF_DEVICE", "GAP_HF_DTYPE")]:
        monkeypatch.delenv(name)


@pytest.fixture(scope="session")
def checkpoints(tmp_path_factory):
    """The folder of a service's tiny checkpoint, made by the first test that asks for it."""
    made = {}

    def folder(service, **options):
        key = (service, *sorted(options.items()))
        if key not in made:
            made[key] = tmp_path_factory.mktemp(service)
            getattr(tiny, service)(made[key], **options)
        return made[key]

    return folder


@pytest.fixture
def serve(monkeypatch, checkpoints):
    """Name a tiny checkpoint as the weights of a service; returns its folder."""

    def name(service, tiny_name=None, **options):
        assert service in WEIGHTS
        folder = checkpoints(tiny_name or service, **options)
        monkeypatch.setenv(variable(service), str(folder))
        return folder

    return name


@pytest.fixture
def ctx():
    """A tool context without a world: an episode's state and a seed."""
    return SimpleNamespace(state={}, seed=0, raise_if_cancelled=lambda: None)


@pytest.fixture
def fresh():
    """No network loaded, before and after."""
    loading.forget()
    yield
    loading.forget()
