"""What tests share: solved structures, their results folders, a Dask cluster."""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

# pytest-xdist has a worker for each core: threads of the linear algebra, which is loaded below, would wait for cores
# that other workers have.
os.environ.update({"OPENBLAS_NUM_THREADS": "1"} if "PYTEST_XDIST_WORKER" in os.environ else {})

import pytest
import structures
from hypothesis import settings

import blockvis
import solver

# The same examples at every run: HYPOTHESIS_PROFILE=default looks for others.
settings.register_profile("same", derandomize=True, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))


def pytest_configure(config: pytest.Config) -> None:
    """End the run where a worker dies: its replacement can keep the others waiting without end (pytest-xdist 3.8)."""
    if getattr(config.option, "maxworkerrestart", "absent") is None:
        config.option.maxworkerrestart = "0"


@pytest.fixture(scope="session")
def arch() -> solver.Response:
    """The reference arch: 12 voussoirs, friction coefficient 0.6, its right springer spreads until it collapses."""
    return structures.arch_response()


@pytest.fixture(scope="session")
def _arch_written(arch: solver.Response, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return blockvis.write(arch, tmp_path_factory.mktemp("arch") / "out")


@pytest.fixture
def arch_results(_arch_written: Path, tmp_path: Path) -> Path:
    """The results folder of the reference arch: a copy that the test may spoil."""
    return shutil.copytree(_arch_written, tmp_path / "out")


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a Dask scheduler with two workers, for studies that kill neither; idle ones would cost time, too."""
    with structures.started_cluster(tmp_path_factory.mktemp("dask")) as (address, _, _):
        yield address
