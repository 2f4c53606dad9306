"""Wheel and sdist are built, pass the checks of the package index, and hold what running needs."""

import os
import re
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.slow


def _ran(*command, **options):
    done = subprocess.run(command, capture_output=True, text=True, encoding="utf-8", errors="replace", **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The wheel and the sdist; the wheel is made of the sdist, as an index would do it."""
    pytest.importorskip("build", reason="build is needed, of the extra dev")
    folder = tmp_path_factory.mktemp("dist")
    _ran(sys.executable, "-m", "build", "--outdir", folder, ROOT)
    (wheel,), (sdist,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    return wheel, sdist


def test_the_citation_has_the_version_that_is_built(built):
    wheel, _ = built
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    assert wheel.name.startswith(f"blockvis-{cited[1]}-")


def test_the_package_index_would_take_them(built):
    pytest.importorskip("twine", reason="twine is needed, of the extra dev")
    _ran(sys.executable, "-m", "twine", "check", "--strict", *built)


def test_they_hold_every_file_of_the_packages(built):
    wheel, sdist = built
    wanted = {
        path.relative_to(ROOT).as_posix()
        for package in ("solver", "blockvis")
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    assert wanted <= names
    assert {name.split("/")[0] for name in names} == {"solver", "blockvis", f"{wheel.name.split('-py3')[0]}.dist-info"}
    with tarfile.open(sdist) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    wanted |= {"README.md", "CHANGELOG.md", "CITATION.cff", "LICENSE", "examples/semicircular_arch.toml"}
    wanted |= {"assets/semicircular_arch.msh", "tests/conftest.py", "tools/key_reference.py"}
    assert wanted <= held


def test_the_wheel_runs_without_the_repository(built, tmp_path):
    """It draws, writes the page of a report, whose parts are data of the package, and knows its version."""
    wheel, _ = built
    site = tmp_path / "site"
    _ran(sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", site, wheel)
    environment = {**os.environ, "PYTHONPATH": str(site)}
    command = (sys.executable, "-m", "blockvis")
    _ran(*command, "layout", "portal", "-o", "portal.svg", cwd=tmp_path, env=environment)
    _ran(*command, "new", "portal.svg", cwd=tmp_path, env=environment)
    assert "results in" in _ran(*command, "run", "portal.toml", "--no-film", cwd=tmp_path, env=environment)
    assert (tmp_path / "portal-results" / "report.html").stat().st_size > 10_000
    where = _ran(sys.executable, "-c", "import blockvis; print(blockvis.__file__)", cwd=tmp_path, env=environment)
    assert Path(where.strip()).is_relative_to(site)
