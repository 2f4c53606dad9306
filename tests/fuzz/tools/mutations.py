"""Files of every format that is read, with bytes changed at random: ``python tests/fuzz/tools/mutations.py --count 100``.

Each must be read as a drawing or refused with a reason: a traceback, a process that dies, more than 20 s or 2 GiB of
memory fails. Prints a table per suffix; exits with 1 if anything failed.
"""

from __future__ import annotations

import argparse
import json
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
    found["r12.dxf"] = _dxf(_dxf_insert("B"), _dxf_block("B", DXF_SQUARE)).encode()
    found |= _meshes(folder)
    (folder / "part.vtu").write_bytes(found["a.vtu"])
    found["b.vtm"] = _vtm("part.vtu").encode()
    found["b.pvd"] = (
        b'<VTKFile type="Collection"><Collection><DataSet timestep="0" part="0" file="part.vtu"/></Collection></VTKFile>'
    )
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
    """The data with a few bytes changed, dropped, doubled or cut off, or a number made absurd."""
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


def main() -> int:
    """Runs the campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100, help="of mutations of each file")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", help="suffix")
    parser.add_argument("--keep", help="folder for the files that failed")
    options = parser.parse_args()
    failed = total = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for fixture, data in fixtures(folder).items():
            if options.only and not fixture.endswith(options.only):
                continue
            random = np.random.default_rng([options.seed, *fixture.encode()])
            paths = []
            for k in range(options.count):
                path = folder / f"{Path(fixture).stem}-{k}{Path(fixture).suffix}"
                path.write_bytes(mutated(data, random))
                paths.append(path)
            outcomes = read_all(paths, folder)
            counts = Counter(str(outcome["outcome"]) for outcome in outcomes)
            bad = [outcome for outcome in outcomes if outcome["outcome"] not in ("read", "refused")]
            slowest = max(float(str(outcome.get("seconds", 0.0))) for outcome in outcomes)
            print(f"{fixture:16} {dict(counts)}, slowest {slowest:.2f} s", flush=True)
            for outcome in bad:
                print(
                    f"   {Path(str(outcome['file'])).name} {outcome['outcome']}: {str(outcome['message'])[-700:]}",
                    flush=True,
                )
                if options.keep:
                    Path(options.keep).mkdir(exist_ok=True)
                    source = Path(str(outcome["file"]))
                    (Path(options.keep) / source.name).write_bytes(source.read_bytes())
            failed, total = failed + len(bad), total + len(outcomes)
            for path in paths:
                path.unlink()
    print(f"{total} files, {failed} failed")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
