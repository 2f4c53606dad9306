"""Nothing that is not a drawing hangs, crashes or passes: binary garbage, text, cut-off files, in every suffix."""

import re
from pathlib import Path

import numpy as np
import pytest

import solver
from blockvis import read, save_layout

#: Every suffix that the page names, those that are refused whatever they hold among them.
PAGE = Path(__file__).parents[2] / "docs" / "formats.md"
NAMED = sorted(set(re.findall(r"`(\.\w+)`", PAGE.read_text(encoding="utf-8"))))

#: Read by gmsh in a process of its own; without it all of them are refused.
CAD = {".geo", ".geo_unrolled", ".step", ".stp", ".brep"}


@pytest.mark.parametrize("suffix", [pytest.param(s, marks=[pytest.mark.cad] if s in CAD else []) for s in NAMED])
@pytest.mark.parametrize("content", ["binary", "text", "zeros"])
def test_garbage_is_refused(tmp_path, suffix, content):
    data = {
        "binary": np.random.default_rng(1).bytes(4000),
        "text": b"Dear all,\nsee attachment.\n",
        "zeros": bytes(999),
    }
    path = tmp_path / f"a{suffix}"
    path.write_bytes(data[content])
    # Without the package of an extra its formats are refused, whatever they hold.
    with pytest.raises((ValueError, ImportError)):
        read(path)


@pytest.mark.parametrize(("suffix", "content"), [(".dxf", b"%PDF-1.4\n1 0 obj"), (".obj", b"glTF\2\0\0\0")])
def test_what_has_another_suffix_than_its_own_is_told_by_its_beginning(tmp_path, suffix, content):
    path = tmp_path / f"a{suffix}"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=rf"begins with {re.escape(repr(content[:16]))}"):
        read(path)


@pytest.mark.parametrize(
    "suffix", [".msh", ".json", ".geojson", ".dxf", ".svg", ".vtu", ".vtp", ".obj", ".ply", ".stl"]
)
def test_half_a_file_never_gives_the_whole(tmp_path, suffix):
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
