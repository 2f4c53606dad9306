"""What tests share: solved structures, their results folders, a Dask cluster."""

from __future__ import annotations

import gc
import os
import pkgutil
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

# pytest-xdist has a worker for each core: threads of the linear algebra, which is loaded below, would wait for cores
# that other workers have.
os.environ.update({"OPENBLAS_NUM_THREADS": "1"} if "PYTEST_XDIST_WORKER" in os.environ else {})

import pytest
from hypothesis import settings

import blockvis
import solver

#: What writes titles, details and legends around pictures.
SHEET = "blockvis.pictures.frame.Sheet.composed"

# The same examples at every run: HYPOTHESIS_PROFILE=default looks for others.
settings.register_profile("same", derandomize=True, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))


def pytest_configure(config: pytest.Config) -> None:
    """End the run where a worker dies: its replacement can keep the others waiting without end (pytest-xdist 3.8)."""
    if getattr(config.option, "maxworkerrestart", "absent") is None:
        config.option.maxworkerrestart = "0"


def pytest_collection() -> None:
    """Look for no garbage while all tests are imported, where nearly nothing is: a tenth of the time in each worker."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Look for garbage again."""
    gc.enable()


@pytest.fixture(scope="session")
def arch() -> solver.Response:
    """The reference arch: 12 voussoirs, friction coefficient 0.6, its right springer spreads until it collapses."""
    # Here, as below: the process that workers wait for reads this file and solves nothing.
    import structures

    return structures.arch_response()


@pytest.fixture(scope="session")
def arch_folder(arch: solver.Response, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results folder of the reference arch, for tests that only read it."""
    return blockvis.write(arch, tmp_path_factory.mktemp("arch") / "out")


@pytest.fixture
def arch_results(arch_folder: Path, tmp_path: Path) -> Path:
    """The results folder of the reference arch: a copy that the test may spoil."""
    return shutil.copytree(arch_folder, tmp_path / "out")


@pytest.fixture
def words(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """What the sheets of pictures say from here on, one dictionary per picture."""
    told: list[dict[str, Any]] = []
    composed = pkgutil.resolve_name(SHEET)

    def noted(self: Any, picture: Any, **said: Any) -> Any:
        told.append(said)
        return composed(self, picture, **said)

    monkeypatch.setattr(SHEET, noted)
    return told


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a Dask scheduler with two workers, for studies that kill neither; idle ones would cost time, too."""
    import structures

    with structures.started_cluster(tmp_path_factory.mktemp("dask")) as (address, _, _):
        yield address
