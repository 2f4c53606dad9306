"""Geometry, .geo .step .stp .brep, through gmsh (extra ``cad``), which runs in a process of its own."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from blockvis.extras import install_command
from blockvis.layout.layout import Layout

from . import gmsh_mesh
from .gmsh_process import NO_LIBRARY
from .reading import Reading
from .solids import Body, layout_of_bodies

#: A geometry script that takes longer is stopped: it may never end.
LONGEST_SECONDS = 120

#: Words of gmsh's script language that run programs, or read or write other files.
_REACHES_OUT = re.compile(
    r"\b(SystemCall|NonBlockingSystemCall|OnelabRun|Include|Merge|ShapeFromFile|Save|CreateDir)\b|Printf[^;]*\)\s*>"
)

_PACKAGES = "libglu1-mesa libxcursor1 libxft2 libxinerama1 libxrender1 libxi6 libxfixes3"


def read(path: Path, reading: Reading) -> Layout:
    """Read a geometry file; gmsh converts .step and .brep to m, a .geo states no unit."""
    script = path.suffix.lower().startswith(".geo")
    if script:
        text = re.sub(r"//[^\n]*|/\*.*?\*/", "", path.read_text(encoding="utf-8", errors="replace"), flags=re.DOTALL)
        found = _REACHES_OUT.search(text)
        if found:
            raise ValueError(
                f"'{path}' uses '{found[0].strip()}', which reaches beyond the file; "
                "run gmsh on it yourself and give the .msh"
            )
    # Chords within a thousandth of the radius, or within the given tolerance for a radius of 1 m.
    allowed = min(max(reading.chord_tolerance or 1e-3, 1e-6), 0.5)
    chords = math.ceil(math.pi / math.acos(1.0 - allowed))
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "found"
        command = [sys.executable, "-m", "blockvis.formats.gmsh_process", str(path.resolve()), str(target), str(chords)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_SECONDS, check=False)
        except subprocess.TimeoutExpired:
            raise ValueError(f"'{path}': gmsh did not finish within {LONGEST_SECONDS} s; give it as .msh") from None
        if done.returncode == NO_LIBRARY:
            raise ValueError(
                f"'{path}' needs gmsh, which could not be loaded ({done.stderr.strip()}); install with: "
                f"{install_command('cad')} and, on Debian, apt-get install {_PACKAGES}"
            )
        if done.returncode:
            reason = " ".join(done.stderr.split())[-300:] or f"it ended with code {done.returncode}"
            raise ValueError(f"'{path}' cannot be read by gmsh: {reason}; repair it or give it as .msh")
        if done.stdout.strip().endswith("json"):
            layout = _layout_of_volumes(json.loads(target.with_suffix(".json").read_text(encoding="utf-8")), path)
        else:
            layout = gmsh_mesh.read(target.with_suffix(".msh"), reading)
    return replace(layout, unit="" if script else "m")


def _layout_of_volumes(found: list[dict[str, object]], path: Path) -> Layout:
    bodies, rows = [], []
    for part in found:
        if int(str(part["groups"])) > 1:
            raise ValueError(
                f"'{path}': '{part['name']}' is in {part['groups']} physical groups; keep it in one of them"
            )
        points, faces = np.array(part["points"], dtype=float), np.array(part["faces"], dtype=np.int64)
        bodies.append(Body(str(part["name"]), points.reshape(-1, 3), faces.reshape(-1, 3)))
        row = {"name": str(part["name"])}
        if part["group"]:
            row |= {"group": str(part["group"]), "material": str(part["group"])}
        rows.append(row)
    return layout_of_bodies(bodies, path, rows)
