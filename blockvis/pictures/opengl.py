"""Whether there is an OpenGL to draw with, tried in another process: VTK ends the one that finds none."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from functools import cache

_PROBE = """
from vtkmodules.vtkRenderingCore import vtkRenderWindow, vtkRenderer
import vtkmodules.vtkRenderingOpenGL2
window = vtkRenderWindow()
window.SetOffScreenRendering(1)
window.SetSize(16, 16)
renderer = vtkRenderer()
renderer.SetBackground(1, 0, 0)
window.AddRenderer(renderer)
window.Render()
from vtkmodules.vtkCommonCore import vtkUnsignedCharArray
pixels = vtkUnsignedCharArray()
window.GetPixelData(8, 8, 8, 8, 0, pixels, 0)
assert pixels.GetValue(0) == 255, "the window stays black"
"""

#: Seconds after which the probe counts as failed; a healthy one takes about one.
_PROBE_PATIENCE = 60.0


class RenderingUnavailable(RuntimeError):
    """No usable OpenGL: pictures of the blocks cannot be drawn; everything else can."""


def rendering_available() -> str | None:
    """None where blocks can be drawn off-screen; otherwise what is missing and how to get it.

    Notes
    -----
    Another process draws a test picture, because VTK ends the whole process where it finds no usable OpenGL.
    """
    _prefer_off_screen()
    return _probed(os.environ.get("VTK_DEFAULT_OPENGL_WINDOW", ""), sys.executable)


@cache
def _probed(window: str, python: str) -> str | None:
    remedy = (
        "pictures of the blocks need OpenGL, in software or hardware, and none works here ({}); "
        "on Debian or Ubuntu: apt-get install --no-install-recommends libegl1 libgl1-mesa-dri"
    )
    try:
        done = subprocess.run(
            [python, "-c", _PROBE], capture_output=True, text=True, timeout=_PROBE_PATIENCE, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return remedy.format(f"the test picture failed: {error}")
    if done.returncode == 0:
        return None
    # VTK colours its messages and puts time, thread and file before them.
    plain = [re.sub(r"\x1b\[[0-9;]*m", "", line).split("| ")[-1].strip() for line in done.stderr.splitlines()]
    why = next((line for line in reversed(plain) if line), "no message")
    return remedy.format(f"the test picture ended with code {done.returncode}: {why[:100]}")


def _prefer_off_screen() -> None:
    # VTK asks for an X display first and complains where there is none.
    if sys.platform.startswith("linux"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
