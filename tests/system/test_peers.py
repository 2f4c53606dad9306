"""The comparison with other tools runs without them: our own rows, and a word for each that is missing."""

import importlib
import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest
import shapely

from blockvis import generators

PEERS = Path(__file__).parents[2] / "benchmarks" / "peers"
SCRIPT = PEERS / "peers.py"


def _printed(*options):
    done = subprocess.run([sys.executable, str(SCRIPT), *options], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    table = [[cell.strip() for cell in line.strip("|").split("|")] for line in done.stdout.splitlines() if "|" in line]
    return done.stdout, [cells for cells in table if cells[0] == "blockvis"]


@pytest.mark.thorough
def test_our_rows_agree_with_the_references():
    _, rows = _printed("--quick")
    numbers = [(float(cells[3]), float(cells[4])) for cells in rows if cells[2] != "equilibrium"]
    assert len(numbers) == 4
    for reference, found in numbers:
        assert found == pytest.approx(reference, rel=1e-3)
    verdicts = [cells[5] for cells in rows if cells[2] == "equilibrium"]
    assert verdicts == ["right", "right", "right"]


@pytest.mark.slow
def test_a_peer_that_is_missing_is_named():
    missing = [n for n in ("pymunk", "mujoco", "compas_lmgc90", "compas_cra") if importlib.util.find_spec(n) is None]
    if not missing:
        pytest.skip("every peer is installed")
    printed, rows = _printed("--questions", "2")
    assert [f"{name}: not installed" for name in missing] == [x for x in printed.splitlines() if "not installed" in x]
    assert len(rows) == 4


@pytest.mark.slow
def test_every_benchmark_can_be_imported():
    """They are run by hand, long after a name that they take from the package has gone."""
    files = sorted(PEERS.parent.rglob("*.py"))
    lines = [
        f"import sys; sys.path[:0] = {[str(PEERS.parent), str(PEERS)]}",
        *(f"import {file.stem}" for file in files),
    ]
    done = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr


def test_engines_get_convex_pieces_that_fill_a_brick(monkeypatch):
    """Engines take the convex hull of a shape: four notched bricks of a bay would press into the arch beside them."""
    monkeypatch.syspath_prepend(str(PEERS))
    engines = importlib.import_module("physics_engines")
    bay = generators.facade(
        bricks=10,
        courses=14,
        storeys=1,
        windows=1,
        window_bricks=4,
        window_courses=6,
        sill_courses=3,
        voussoirs=3,
        rise_courses=1.5,
    )
    assert not engines.are_convex(bay)
    assert engines.are_convex(generators.arch())
    pieces = [engines.convex_pieces(bay.outline(i)) for i in range(bay.n_blocks)]
    for brick, parts in enumerate(pieces):
        outline = shapely.Polygon(bay.outline(brick))
        shapes = [shapely.Polygon(part) for part in parts]
        assert shapely.union_all(shapes).symmetric_difference(outline).area < 1e-12
        assert sum(shape.convex_hull.area for shape in shapes) == pytest.approx(outline.area, rel=1e-9)
        assert all(shape.exterior.is_ccw for shape in shapes)


@pytest.mark.slow
def test_walls_beside_engines_are_kept_and_tabulated(tmp_path):
    """What ran is a line of the file, which is not run again; the table has the exact value and how far ours is off."""
    walls = [sys.executable, str(PEERS / "walls.py"), str(tmp_path / "runs.jsonl")]
    for _ in range(2):
        done = subprocess.run(
            [*walls, "--walls", "flat arch", "--engines"], capture_output=True, text=True, timeout=300, check=True
        )
    assert not done.stdout
    table = subprocess.run([*walls, "--table"], capture_output=True, text=True, timeout=300, check=True).stdout
    cells = [cell.strip() for cell in table.splitlines()[2].strip("|").split("|")]
    assert cells[:3] == ["flat arch of two blocks, supports spread", "2", "0.0616 m"]
    found, apart = cells[3].split(" m (")
    assert float(found) == pytest.approx(0.0615528, rel=3e-3)
    assert float(apart.split()[0]) == pytest.approx(0, abs=0.3)
    assert cells[4:] == ["–", "–", "–"]
