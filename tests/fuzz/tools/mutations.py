"""Files of every format that is read, with bytes changed at random: ``python tests/fuzz/tools/mutations.py --count 100``.

Each must be read as a drawing or refused with a reason: a traceback, a process that dies, more than 20 s or 2 GiB of
memory fails. Prints a table per suffix; exits with 1 if anything failed.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
from hostile import DXF_SQUARE, _dxf, _dxf_block, _dxf_insert, _vtm

import solver
from blockvis import save_layout

#: Limits for one file: bytes of memory beside the libraries, seconds of processor time.
MEMORY, SECONDS = 2 << 30, 20

READER = Path(__file__).with_name("reader.py")


def fixtures(folder: Path) -> dict[str, bytes]:
    """A small valid file of each kind that is read, by name."""
    bricks = [[[k, 0], [k + 0.9, 0], [k + 0.9, 1], [k, 1]] for k in range(4)]
    wall = solver.Assembly.from_outlines([*bricks, [[0, -1], [4, -1], [4, 0], [0, 0]]], names=[*"abcd", "Straße"])
    found = {}
    for suffix in (".msh", ".json", ".dxf", ".svg", ".vtu", ".vtp", ".vtk", ".stl", ".obj", ".ply"):
        save_layout(wall, folder / f"a{suffix}")
        found[f"a{suffix}"] = (folder / f"a{suffix}").read_bytes()
    found |= _more_kinds(folder, wall)
    found["r12.dxf"] = _dxf(_dxf_insert("B"), _dxf_block("B", DXF_SQUARE)).encode()
    found |= _meshes(folder)
    (folder / "part.vtu").write_bytes(found["a.vtu"])
    found["b.vtm"] = _vtm("part.vtu").encode()
    found["b.pvd"] = (
        b'<VTKFile type="Collection"><Collection><DataSet timestep="0" part="0" file="part.vtu"/></Collection></VTKFile>'
    )
    return found


COMMANDS = """new
poly brick -0.5 1.5 0 0.3 -0.1 0 region 1
range name ground region 1
poly brick 0, 0.4 0, 0.3 0, 0.2 mat 2 region 2
poly region 2 prism &
a (0.0,0,0.2) (0.4,0,0.2) (0.4,0,0.4) ( 0.0, 0, 0.4 ) &
b (0.0,0.3,0.2) (0.4,0.3,0.2) (0.4,0.3,0.4) (0.0,0.3,0.4)
block create brick 0.4 0.8 0 0.3 0 0.2 group 'right pier'
prop mat 1 dens 1800
fix region 1
"""

CELLS_OF_OLD = """# vtk DataFile Version 3.0
x
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 6 double
0 0 0 1 0 0 1 1 0 0 1 0 2 0 0 2 1 0
CELLS 2 10
4 0 1 2 3
4 1 4 5 2
CELL_TYPES 2
9
9
CELL_DATA 2
SCALARS block_id int 1
LOOKUP_TABLE default
0 1
"""


def _more_kinds(folder: Path, wall: solver.Assembly) -> dict[str, bytes]:
    """Blocks in space in the formats that hold them, geodata, commands of 3DEC, an image, and old files of VTK."""
    import sqlite3
    import struct

    import shapefile
    import shapely
    from PIL import Image

    corners = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (0.9, 0), (0.9, 1), (0, 1))], dtype=float)
    faces = [[3, 2, 1, 0], [4, 5, 6, 7], *([k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k] for k in range(4))]
    solids = solver.Assembly.from_solids([(corners + np.array([k, 0, 0]), faces) for k in range(3)], names=[*"abc"])
    found = {"a.3ddat": COMMANDS.encode(), "old.vtk": CELLS_OF_OLD.encode()}
    for suffix in (".json", ".vtu", ".vtk", ".obj", ".ply", ".glb"):
        save_layout(solids, folder / f"space{suffix}")
        found[f"space{suffix}"] = (folder / f"space{suffix}").read_bytes()
    save_layout(wall, folder / "a.geojson")
    found["a.geojson"] = (folder / "a.geojson").read_bytes()
    rings = [wall.outline(k).tolist() for k in range(wall.n_blocks)]
    with shapefile.Writer(str(folder / "a.shp")) as file:
        file.field("name", "C")
        for name, ring in zip(wall.names, rings, strict=True):
            file.poly([[*ring[::-1], ring[-1]]])
            file.record(name)
    found["a.shp"] = (folder / "a.shp").read_bytes()
    base = sqlite3.connect(folder / "a.gpkg")
    base.execute("CREATE TABLE gpkg_geometry_columns (table_name, column_name, srs_id)")
    base.execute("CREATE TABLE gpkg_spatial_ref_sys (srs_id, srs_name, definition)")
    base.execute("INSERT INTO gpkg_spatial_ref_sys VALUES (-1, 'Undefined Cartesian', 'undefined')")
    base.execute("CREATE TABLE stones (fid INTEGER PRIMARY KEY, geom BLOB, stone TEXT)")
    base.execute("INSERT INTO gpkg_geometry_columns VALUES ('stones', 'geom', -1)")
    for name, ring in zip(wall.names, rings, strict=True):
        blob = b"GP\0" + struct.pack("<Bi", 1, -1) + shapely.to_wkb(shapely.Polygon(ring))
        base.execute("INSERT INTO stones (geom, stone) VALUES (?, ?)", (blob, name))
    base.commit()
    base.close()
    found["a.gpkg"] = (folder / "a.gpkg").read_bytes()
    pixels = np.zeros((40, 60), dtype=np.uint8)
    for k in range(3):
        pixels[10:30, 20 * k + 1 : 20 * k + 19] = 60 * (k + 1)
    for suffix in (".png", ".tif", ".bmp"):
        Image.fromarray(pixels).save(folder / f"image{suffix}")
        found[f"image{suffix}"] = (folder / f"image{suffix}").read_bytes()
    return found


def _meshes(folder: Path) -> dict[str, bytes]:
    """The same bricks as meshio and trimesh write them, and binary where a format has both."""
    import meshio
    import pyvista
    import trimesh

    x = np.array([[k + dx, dy, 0.0] for k in range(4) for dx, dy in ((0, 0), (0.9, 0), (0.9, 1), (0, 1))])
    quads = np.arange(16).reshape(4, 4)
    mesh = meshio.Mesh(x, [("quad", quads)], cell_data={"block_id": [np.arange(4)]})
    flat = meshio.Mesh(x[:, :2], [("quad", quads)])
    found = {}
    for name, given, options in (
        ("b.inp", mesh, {}),
        ("b.bdf", mesh, {}),
        ("b.mesh", mesh, {}),
        ("b.meshb", mesh, {}),
        ("b.su2", flat, {}),
        ("b.ugrid", mesh, {}),
        ("b.avs", mesh, {}),
        ("b.tec", mesh, {}),
        ("b.vol", mesh, {}),
        ("b.mdpa", mesh, {}),
        ("b.wkt", meshio.Mesh(x[:, :2], [("triangle", np.array([[0, 1, 2], [4, 5, 6]]))]), {}),
        ("b.post", mesh, {}),
        ("b.xml", meshio.Mesh(x[:, :2], [("triangle", np.array([[0, 1, 2], [4, 5, 6]]))]), {}),
        ("binary41.msh", mesh, {"file_format": "gmsh", "binary": True}),
        ("binary22.msh", mesh, {"file_format": "gmsh22", "binary": True}),
        ("binary.vtk", mesh, {"binary": True}),
    ):
        try:
            meshio.write(folder / name, given, **options)
        except Exception as error:
            print(f"no fixture {name}: {error}", file=sys.stderr)
            continue
        found[name] = (folder / name).read_bytes()
    box = trimesh.util.concatenate([trimesh.creation.box(bounds=[[k, 0, 0], [k + 0.9, 1, 1]]) for k in range(3)])
    for name in ("binary.stl", "b.off", "b.glb", "binary.ply"):
        box.export(folder / name)
        found[name] = (folder / name).read_bytes()
    surface = pyvista.PolyData(x, faces=np.column_stack([np.full(4, 4), quads]).ravel())
    for name, binary in (("raw.vtp", True), ("ascii.vtp", False)):
        surface.save(folder / name, binary=binary)
        found[name] = (folder / name).read_bytes()
    return found


def mutated(data: bytes, random: np.random.Generator) -> bytes:
    """The data with a few bytes changed, dropped, doubled or cut off, or a number made absurd.

    Of half the texts whole lines or words change places, which readers get further with than with damaged bytes.
    """
    return _reordered(data, random) if random.random() < 0.5 and data.isascii() else _damaged(data, random)


def _damaged(data: bytes, random: np.random.Generator) -> bytes:
    out = bytearray(data)
    for _ in range(int(random.integers(1, 6))):
        if not out:
            break
        k, kind = int(random.integers(len(out))), int(random.integers(8))
        length = int(random.integers(1, 40))
        if kind == 0:
            out[k] = int(random.integers(256))
        elif kind == 1:
            out[k] ^= 1 << int(random.integers(8))
        elif kind == 2:
            del out[k : k + length]
        elif kind == 3:
            out[k:k] = out[k : k + length]
        elif kind == 4 and random.random() < 0.3:
            del out[k:]
        elif kind == 5:
            out[k : k + 8] = int(random.integers(1 << 62)).to_bytes(8, "little")
        elif kind == 6:
            out[k : k + 4] = bytes(random.choice([b"\xff\xff\xff\xff", b"\x00\x00\x00\x80", b"nan ", b"1e99", b"-1 -"]))
        else:
            digits = [m for m in range(k, min(k + 200, len(out))) if chr(out[m]).isdigit()]
            if digits:
                out[digits[0] : digits[0] + 1] = bytes(
                    random.choice([b"999999999999", b"-7", b"0", b"1e308", b"2147483648"])
                )
    return bytes(out)


def _reordered(data: bytes, random: np.random.Generator) -> bytes:
    """The text with lines or words dropped, doubled or in the place of others."""
    by_line = data.count(b"\n") > 4 and random.random() < 0.5
    parts = re.split(rb"(\n)" if by_line else rb"([\s,;\"<>{}\[\]()]+)", data)
    for _ in range(int(random.integers(1, 4))):
        j, k = (2 * int(n) for n in random.integers((len(parts) + 1) // 2, size=2))
        kind = int(random.integers(4))
        if kind == 0:
            parts[j], parts[k] = parts[k], parts[j]
        elif kind == 1:
            parts[j] = parts[k]
        elif kind == 2:
            parts[j] = b""
        else:
            parts[j : j + 1] = [parts[j], b"\n" if by_line else b" ", parts[j]]
    return b"".join(parts)


def read_all(paths: list[Path], folder: Path) -> list[dict[str, object]]:
    """Reads files under limits in a process that is started again behind each file that ends it."""
    outcomes: list[dict[str, object]] = []
    rest = [str(path) for path in paths]
    while rest:
        command = [sys.executable, str(READER), str(MEMORY), str(SECONDS), *rest]
        done = subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False, errors="replace")
        said = []
        for line in done.stdout.splitlines():
            if line.startswith('{"file"'):
                said.append(json.loads(line))
        finished = [line for line in said if "outcome" in line]
        outcomes += finished
        if len(finished) == len(rest):
            break
        if not said:
            raise RuntimeError(f"the reader did not start: {done.stderr[-2000:]}")
        fatal = rest[len(finished)]
        outcomes.append({"file": fatal, "outcome": "died", "message": f"code {done.returncode}: {done.stderr[-300:]}"})
        rest = rest[len(finished) + 1 :]
    return outcomes


def _told(fixture: str, outcomes: list[dict[str, object]], keep: str | None) -> int:
    """Print what became of the files of a fixture, keep those that failed, and count them."""
    counts = Counter(str(outcome["outcome"]) for outcome in outcomes)
    slowest = max(float(str(outcome.get("seconds", 0.0))) for outcome in outcomes)
    print(f"{fixture:16} {dict(counts)}, slowest {slowest:.2f} s", flush=True)
    bad = [outcome for outcome in outcomes if outcome["outcome"] not in ("read", "refused")]
    for outcome in bad:
        path = Path(str(outcome["file"]))
        print(f"   {path.name} {outcome['outcome']}: {str(outcome['message'])[-700:]}", flush=True)
        if keep:
            Path(keep).mkdir(exist_ok=True)
            (Path(keep) / path.name).write_bytes(path.read_bytes())
    return len(bad)


def main() -> int:
    """Runs the campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100, help="of mutations of each file")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", help="suffix")
    parser.add_argument("--keep", help="folder for the files that failed")
    options = parser.parse_args()
    failed = 0
    with tempfile.TemporaryDirectory() as name:
        folder, paths = Path(name), dict[str, list[Path]]()
        for fixture, data in fixtures(folder).items():
            if options.only and not fixture.endswith(options.only):
                continue
            random = np.random.default_rng([options.seed, *fixture.encode()])
            paths[fixture] = [folder / f"{Path(fixture).stem}-{k}{Path(fixture).suffix}" for k in range(options.count)]
            for path in paths[fixture]:
                path.write_bytes(mutated(data, random))
        every = [path for of in paths.values() for path in of]
        # All of them in as few processes as may be: each takes seconds to load its libraries.
        of_file = {Path(str(outcome["file"])): outcome for outcome in read_all(every, folder)}
        for fixture, own in paths.items():
            failed += _told(fixture, [of_file[path] for path in own], options.keep)
    print(f"{len(every)} files, {failed} failed")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
