"""Nothing that is not a drawing hangs, crashes or passes: binary garbage, text, cut-off files, in every suffix."""

import time

import numpy as np
import pytest

from blockvis import read, save_layout
from blockvis.formats import FORMATS
from blockvis.system.extras import MissingExtra

READ = sorted(suffix for suffix, known in FORMATS.items() if known.reads)

#: Read by gmsh in a process of its own; without it all of them are refused.
CAD = {".geo", ".geo_unrolled", ".step", ".stp", ".brep"}


@pytest.mark.parametrize("suffix", [pytest.param(s, marks=[pytest.mark.cad] if s in CAD else []) for s in READ])
@pytest.mark.parametrize("content", ["binary", "text", "zeros"])
def test_garbage_is_refused(tmp_path, suffix, content):
    data = {
        "binary": np.random.default_rng(1).bytes(4000),
        "text": b"Dear all,\nsee attachment.\n",
        "zeros": bytes(999),
    }
    path = tmp_path / f"a{suffix}"
    path.write_bytes(data[content])
    start = time.perf_counter()
    # Without the package of an extra its formats are refused, whatever they hold.
    with pytest.raises((ValueError, MissingExtra)):
        read(path)
    assert time.perf_counter() - start < 30


@pytest.mark.parametrize(
    "suffix", [".msh", ".json", ".geojson", ".dxf", ".svg", ".vtu", ".vtp", ".obj", ".ply", ".stl"]
)
def test_half_a_file_never_gives_the_whole(tmp_path, suffix):
    import solver

    bricks = [[[k, 0], [k + 0.9, 0], [k + 0.9, 1], [k, 1]] for k in range(6)]
    wall = solver.Assembly.from_outlines(bricks)
    path = tmp_path / f"a{suffix}"
    save_layout(wall, path)
    data = path.read_bytes()
    for share in (0.3, 0.6, 0.9):
        path.write_bytes(data[: int(share * len(data))])
        try:
            found = read(path).n_blocks
        except ValueError:
            continue
        # Drawing programs recover what is whole. The last tenth may hold nothing of a block.
        assert found < 6 or share == 0.9
