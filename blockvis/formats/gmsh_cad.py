"""Geometry, .geo .step .stp .brep, through gmsh (extra ``cad``), which runs in a process of its own."""

from __future__ import annotations

import math
import re
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from blockvis.layout.layout import Layout
from blockvis.layout.units import metres_per
from blockvis.system.extras import install_command
from blockvis.system.worker import Worker, WorkerEnded

from . import gmsh_mesh
from .bodies import MOST_FACES, Bodies, Body
from .reading import Reading

#: A geometry script that takes longer is stopped: it may never end.
LONGEST_SECONDS = 120

#: Memory [bytes] that gmsh may take: a script can ask for any number of points.
MOST_MEMORY = 4 * 2**30

#: Prefixes of the metre in STEP files.
_SI_PREFIXES = {"": "m", "MILLI": "mm", "CENTI": "cm", "DECI": "dm", "KILO": "km"}

#: Words of gmsh's script language that run programs, or read or write other files.
_REACHES_OUT = re.compile(
    r"\b(SystemCall|NonBlockingSystemCall|OnelabRun|Include|Merge|ShapeFromFile|Save|CreateDir)\b|Printf[^;]*\)\s*>"
)

_PACKAGES = "libglu1-mesa libxcursor1 libxft2 libxinerama1 libxrender1 libxi6 libxfixes3"


def read(path: Path, reading: Reading) -> Layout | Bodies:
    """Read a geometry file; .step states its unit, .brep and .geo state none."""
    script = path.suffix.lower().startswith(".geo")
    if script:
        text = re.sub(r"//[^\n]*|/\*.*?\*/", "", path.read_text(encoding="utf-8", errors="replace"), flags=re.DOTALL)
        found = _REACHES_OUT.search(text)
        if found:
            raise ValueError(
                f"it uses '{found[0].strip()}', which reaches beyond the file; "
                "run gmsh on it yourself and give the .msh"
            )
    # Chords within a thousandth of the radius, or within the given tolerance for a radius of 1 m.
    allowed = min(max(reading.chord_tolerance or 1e-3, 1e-6), 0.5)
    chords = math.ceil(math.pi / math.acos(1.0 - allowed))
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "found.msh"
        bodies = _meshed(path, target, chords)
        unit, per_mm = ("", 1.0) if path.suffix.lower() not in (".step", ".stp") else _step_unit(path)
        if bodies is not None:
            return _bodies_of_volumes(bodies, unit, per_mm)
        surfaces = gmsh_mesh.layout_of_mesh(target.read_bytes(), reading)
    if isinstance(surfaces, Bodies):
        scaled = [replace(body, points=per_mm * body.points) for body in surfaces.bodies]
        return replace(surfaces, bodies=scaled, unit=unit)
    left_out = tuple(item.mapped(per_mm) for item in surfaces.left_out)
    return replace(surfaces, blocks=tuple(ring * per_mm for ring in surfaces.outlines), left_out=left_out, unit=unit)


def _meshed(path: Path, target: Path, chords: int) -> list[dict[str, object]] | None:
    """Have a file meshed: its bodies, or None where it has surfaces only, whose mesh is then in the target."""
    worker = Worker("blockvis.formats.gmsh_process", errors=True)
    try:
        worker.say("mesh", (str(path.resolve()), str(target), chords, MOST_MEMORY, MOST_FACES))
        bodies: list[dict[str, object]] | None = worker.hear("mesh", "bodies", seconds=LONGEST_SECONDS)[1]
    except TimeoutError:
        raise ValueError(f"gmsh did not finish within {LONGEST_SECONDS} s; give it as .msh") from None
    except ImportError as error:
        raise ValueError(
            f"it needs gmsh, which could not be loaded ({error}); install with: "
            f"{install_command('cad')} and, on Debian, apt-get install {_PACKAGES}"
        ) from None
    except WorkerEnded as ended:
        raise _failed(ended.errors, target) from None
    except Exception as error:  # noqa: BLE001
        # gmsh raises a bare Exception with the last line of its log.
        raise _failed("MemoryError" if isinstance(error, MemoryError) else str(error), target) from None
    finally:
        worker.close()
    return bodies


def _failed(said: str, target: Path) -> ValueError:
    reason = " ".join(said.split())[-300:].replace(str(target), "the mesh")
    most = f"{MOST_MEMORY / 2**30:.3g} GiB of memory"
    remedy = "run gmsh on it yourself, with a coarser mesh, and give the .msh"
    if "alloc" in reason or "MemoryError" in reason:
        return ValueError(f"gmsh needs more than {most} for it; {remedy}")
    if not reason:
        # So it mostly ends, too, where it cannot have more memory.
        return ValueError(
            f"gmsh crashed on it without a word, as on some closed round faces, or with no more than {most}; {remedy}"
        )
    return ValueError(f"it cannot be read by gmsh: {reason}; repair it or give it as .msh")


def _step_unit(path: Path) -> tuple[str, float]:
    """Find the unit of length that a STEP file states, mm where it states none, and how many of it make a mm."""
    text = path.read_text(encoding="latin-1")
    stated = re.findall(r"LENGTH_UNIT\s*\(\s*\)[^;]*;", text)
    found = []
    for entity in stated:
        named = re.search(r"CONVERSION_BASED_UNIT\s*\(\s*'([^']*)'", entity)
        metric = re.search(r"SI_UNIT\s*\(\s*(?:\.(\w+)\.|\$)\s*,\s*\.METRE\.\s*\)", entity)
        if named:
            found.append(named[1].strip().lower())
        elif metric:
            found.append(_SI_PREFIXES.get(metric[1] or "", ""))
    # A file in inches also defines the millimetre that an inch is measured in: the one that is built on others counts.
    known = [unit for unit in found if unit in ("inch", "foot", "in", "ft")] or [unit for unit in found if unit]
    unit = {"inch": "in", "foot": "ft"}.get(known[0], known[0]) if known else "mm"
    return unit, metres_per("mm") / metres_per(unit)


def _bodies_of_volumes(found: list[dict[str, object]], unit: str, per_mm: float) -> Bodies:
    bodies = []
    for part in found:
        if int(str(part["groups"])) > 1:
            raise ValueError(f"'{part['name']}' is in {part['groups']} physical groups; keep it in one of them")
        points, faces = np.array(part["points"], dtype=float), np.array(part["faces"], dtype=np.int64)
        drawn = per_mm**3 * float(str(part.get("volume", 0.0)))
        said = {"group": str(part["group"]), "material": str(part["group"])} if part["group"] else {}
        body = Body(str(part["name"]), per_mm * points.reshape(-1, 3), faces.reshape(-1, 3), said, volume=drawn)
        bodies.append(body)
    return Bodies(bodies, unit)
