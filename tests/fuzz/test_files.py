"""Files made to harm and files with bytes changed: read or refused, within 2 GiB and 20 s, without a traceback."""

import io
import sys
from pathlib import Path

import numpy as np
import pytest
from hostile import FILES, npz_absurd, npz_bomb, written
from mutations import MEMORY, READER, SECONDS, fixtures, mutated, read_all

from blockvis.cli import main

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are set the way Linux has them")


@pytest.mark.slow
def test_hostile_files_are_refused_within_bounds(tmp_path):
    paths = written(tmp_path)
    outcomes = {Path(str(o["file"])).name: o for o in read_all(paths, tmp_path)}
    assert set(outcomes) == set(FILES)
    for name, outcome in outcomes.items():
        assert outcome["outcome"] == "refused", (name, outcome)
        assert name in str(outcome["message"]) or "block '" in str(outcome["message"]), outcome
        assert len(str(outcome["message"])) < 1000, name
        assert float(str(outcome["seconds"])) < SECONDS
    assert not list(tmp_path.rglob("harmed"))
    for name in ("outside.pvd", "outside.vtm", "include.inp", "outside.xdmf"):
        assert "outside its folder" in str(outcomes[name]["message"])


@pytest.mark.fuzz
def test_changed_bytes_are_read_or_refused(tmp_path):
    random, paths = np.random.default_rng(2026), []
    for name, data in fixtures(tmp_path).items():
        for k in range(5):
            paths.append(tmp_path / f"{Path(name).stem}-{k}{Path(name).suffix}")
            paths[-1].write_bytes(mutated(data, random))
    outcomes = read_all(paths, tmp_path)
    assert len(outcomes) == len(paths)
    assert [o for o in outcomes if o["outcome"] not in ("read", "refused")] == []


def pickled() -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, x=np.array([{"a": 1}], dtype=object))
    return buffer.getvalue()


@pytest.mark.parametrize("name", ["assembly.npz", "increments/state_00000.npz"])
@pytest.mark.parametrize(
    ("content", "words"),
    [
        pytest.param(npz_bomb, "unpacks to", marks=pytest.mark.thorough),
        (npz_absurd, "Unable to allocate"),
        (pickled, "allow_pickle"),
        (lambda: b"", "damaged"),
        (lambda: bytes(5000), "damaged"),
    ],
)
def test_hostile_results_are_refused(arch_results, capsys, name, content, words):
    (arch_results / name).write_bytes(content())
    assert main(["render", str(arch_results)]) == 2
    said = capsys.readouterr().err
    assert f"{Path(name).name}' cannot be read" in said
    assert words in said


@pytest.mark.thorough
def test_the_limits_bind(tmp_path):
    """The bounds above are real: more memory or time than allowed is seen."""
    assert MEMORY == 2 << 30
    (tmp_path / "a.py").write_text(
        "import sys; sys.argv = ['', str(64 << 20), '1']; sys.path.insert(0, sys.argv[0])\n"
        f"sys.path.insert(0, {str(READER.parent)!r})\n"
        "import reader\nreader.main(str(64 << 20), '1', [])\n"
        "try:\n    bytearray(256 << 20)\nexcept MemoryError:\n    print('bound')\n",
        encoding="utf-8",
    )
    import subprocess

    done = subprocess.run([sys.executable, str(tmp_path / "a.py")], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "bound", done.stderr
