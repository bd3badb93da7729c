"""Finds an OpenGL that needs no screen at run time, EGL first, then OSMesa, and says what to install otherwise."""

from __future__ import annotations

import atexit
import importlib
import os
import sys
import weakref
from functools import cache
from typing import Any

from gap_runtime.contracts.failures import GapError

BACKENDS = ("egl", "osmesa")
# Values of MUJOCO_GL that MuJoCo knows and that ask for nothing without a screen.
ELSEWHERE = ("", "glfw", "off", "disable", "disabled", "false", "0", "on", "enable", "enabled", "true", "1")
INSTALL = "On Debian or Ubuntu: apt install libegl1 libgl1 (or libosmesa6)."
_PROBE_SIZE = 16


class GraphicsError(GapError):
    """No OpenGL that can draw without a screen; nothing a camera sees can be simulated."""


@cache
def probe() -> str:
    """The backend that works here, `egl` or `osmesa`. `MUJOCO_GL` narrows the choice to the one it names.

    Raises `GraphicsError` saying in one sentence what to install, or that `MUJOCO_GL` names no backend.
    """
    asked = os.environ.get("GAP_MUJOCO_GL", "").lower().strip()
    named = asked in BACKENDS
    if not named and asked not in ELSEWHERE:
        raise GraphicsError(f"MUJOCO_GL={asked!r} names no OpenGL.", hint=f"Unset it, or set {' or '.join(BACKENDS)}.")
    reasons = []
    for name in (asked,) if named else BACKENDS:
        try:
            _try(name)
            return name
        except Exception as error:  # whatever a driver or a loader raises, the next backend may still work
            _forget(name)
            reasons.append(f"{name}: {_reason(error)}")
    what = f"MUJOCO_GL asks for {asked}, which cannot" if named else "No OpenGL can"
    hint = f"Unset MUJOCO_GL, or install {asked}. {INSTALL}" if named else INSTALL
    raise GraphicsError(f"{what} render without a screen here ({'; '.join(reasons)}).", hint=hint)


def _reason(error: Exception) -> str:
    if isinstance(error, AttributeError):  # of the None that PyOpenGL has instead of a library
        return "its library was not found"
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def _try(name: str) -> None:
    """Go all the way to where MuJoCo could draw: a context alone does not prove that there is an OpenGL behind it."""
    os.environ["MUJOCO_GL"] = name  # MuJoCo's own loader asks for it
    context = _context_class(name)(_PROBE_SIZE, _PROBE_SIZE)
    try:
        context.make_current()
        import mujoco

        mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), mujoco.mjtFontScale.mjFONTSCALE_100).free()
    finally:
        context.free()


def make_context(width: int, height: int) -> Any:
    """A GL context for offscreen drawing, current on the calling thread and bound to it. Raises `GraphicsError`."""
    name = probe()
    try:
        context = _context_class(name)(width, height)
        context.make_current()
    except Exception as error:
        raise GraphicsError(f"The {name} OpenGL refused a {width}x{height} context: {error}", hint=INSTALL) from error
    atexit.register(_abandon, weakref.ref(context))
    return context


def _abandon(context: weakref.ref[Any]) -> None:
    """At exit the display closes before the contexts do, and freeing one then raises."""
    alive = context()
    if alive is not None:
        alive._context = None


def _context_class(name: str) -> Any:
    # PyOpenGL binds one platform per process, when it is first imported.
    if f"mujoco.{name}" not in sys.modules:
        os.environ["PYOPENGL_PLATFORM"] = name
    return importlib.import_module(f"mujoco.{name}").GLContext


def _forget(name: str) -> None:
    """Unload PyOpenGL, so that the next backend can bind it to another platform."""
    os.environ["MUJOCO_GL"] = "off"
    os.environ.pop("PYOPENGL_PLATFORM", None)
    for module in [m for m in sys.modules if m.split(".")[0] == "OpenGL" or m.startswith(f"mujoco.{name}")]:
        del sys.modules[module]
