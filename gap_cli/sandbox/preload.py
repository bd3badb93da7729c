"""Loads and exercises what inline scripts compute with, before the fork: a jailed child can import nothing new."""

from __future__ import annotations

import collections.abc
import contextlib
import dataclasses
import enum
import functools
import itertools
import math
import operator
import re
import statistics
import time
import typing

import numpy as np
import numpy.fft
import numpy.linalg
import numpy.ma
import numpy.polynomial
import numpy.random
import numpy.typing
import scipy.spatial.transform
from scipy.spatial.transform import Rotation, Slerp

from gap_cli.sandbox import robots
from gap_runtime.contracts import failures, robot, scripting, tool, types
from gap_runtime.contracts.encoding import codec
from gap_runtime.contracts.encoding import framing as wire

LOADED = (
    collections.abc, contextlib, dataclasses, enum, functools, itertools, math, operator, re, statistics, time, typing,
    numpy.ma, numpy.polynomial, numpy.typing, scipy.spatial.transform, codec, failures, robot, robots, scripting, tool,
    types, wire,
)  # fmt: skip


def up() -> None:
    """Run one of everything, so that what is loaded on first use is loaded now."""
    rng = np.random.default_rng(0)
    m = rng.normal(size=(4, 4))
    for work in (np.linalg.svd, np.linalg.inv, np.linalg.eig, np.linalg.det, np.linalg.pinv, np.fft.fft2, np.unique):
        work(m)
    np.linalg.eigh(m @ m.T)
    np.linalg.lstsq(m, m[0], rcond=None)
    np.median(m), np.percentile(m, 50), np.cov(m), np.histogram(m), np.interp(0.5, [0, 1], [0, 1])
    str(m), repr(m), np.einsum("ij,jk->ik", m, m), np.argsort(m), np.where(m > 0), np.cross(m[0, :3], m[1, :3])
    turns = Rotation.from_rotvec(m[:2, :3])
    Slerp([0.0, 1.0], turns)(0.5).as_matrix()
    turns.mean().as_quat(), turns.as_euler("xyz"), turns.apply(m[:2, :3]), (turns * turns.inv()).magnitude()
    Rotation.from_matrix(turns.as_matrix()), Rotation.align_vectors(m[:, :3], m[:, :3])
    wire.unpack(wire.pack({"pose": types.Se3Pose.of(np.eye(4)), "m": m}))


def seed(value: int) -> None:
    """Seed numpy's global generator, so that a script which uses it repeats itself."""
    np.random.seed(value % 2**32)
