"""The results folder: written as the run goes, reopened without solving."""

from __future__ import annotations

import csv
import io
import json
import os
import platform
import time
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

import solver

__all__ = ["ResultsExist", "ResultsFolder", "open_results", "stored_case", "summary_of", "write"]

#: Columns of response.csv.
COLUMNS = (
    "increment",
    "phase",
    "settlement",
    "reaction",
    "reaction_over_weight",
    "load_multiplier",
    "equilibrium_residual",
    "largest_penetration",
    "duality_gap",
    "complementarity",
    "kinematic_violation",
    "contacts_open",
    "contacts_sticking",
    "contacts_sliding",
    "contacts_hinging",
    "programs",
    "seconds",
)


class ResultsExist(ValueError):
    """The results folder holds a run already."""


def _written(path: Path, content: str | bytes) -> None:
    """Writes a whole file or nothing: a reader never sees half of it, a killed run leaves the one before."""
    data = content.encode() if isinstance(content, str) else content
    partial = path.with_name(f".{path.name}.part")
    with open(partial, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.replace(partial, path)


class ResultsFolder:
    """A results folder that grows with the run: readable at every moment, whatever ends it.

    Parameters
    ----------
    path : str or Path
    assembly : solver.Assembly
    case_text : str
        The case file, kept in the summary.
    overwrite : bool
        Whether results that are there already may be replaced.

    Raises
    ------
    ResultsExist
        If the folder holds results and ``overwrite`` is false.
    """

    def __init__(
        self, path: str | Path, assembly: solver.Assembly, *, case_text: str = "", overwrite: bool = False
    ) -> None:
        self.path, self.assembly, self.case_text = Path(path), assembly, case_text
        if not overwrite and ((self.path / "summary.json").exists() or (self.path / "increments").exists()):
            raise ResultsExist(f"'{self.path}' holds results already; choose another folder with -o or add --force")
        (self.path / "increments").mkdir(parents=True, exist_ok=True)
        for old in [*self.path.glob("increments/*.vtu"), *self.path.glob("increments/*.npz")]:
            old.unlink()
        for name in ("summary.json", "response.csv", "blocks.pvd", "contacts.pvd"):
            (self.path / name).unlink(missing_ok=True)
        self.increments: list[solver.Increment] = []
        self._rows = io.StringIO()
        self._table = csv.writer(self._rows, lineterminator="\n")
        self._table.writerow(COLUMNS)
        _written(self.path / "assembly.npz", _packed(_assembly_arrays(assembly)))

    def add(self, increment: solver.Increment) -> None:
        """Writes one increment: its VTU files, its row, and PVD files that list everything so far."""
        from .datasets import block_dataset, contact_dataset, output_times
        from .vtkxml import write_pvd, write_vtu

        number = len(self.increments)
        self.increments.append(increment)
        folder = self.path / "increments"
        write_vtu(block_dataset(self.assembly, increment), folder / f"blocks_{number:05d}.vtu")
        write_vtu(contact_dataset(self.assembly, increment), folder / f"contacts_{number:05d}.vtu")
        _written(folder / f"state_{number:05d}.npz", _packed(_increment_arrays(increment)))
        times = output_times(self.increments)
        for kind in ("blocks", "contacts"):
            entries = [(t, f"increments/{kind}_{i:05d}.vtu") for i, t in enumerate(times)]
            write_pvd(self.path / f"{kind}.pvd", entries)
        if increment.status == solver.Status.EQUILIBRIUM:
            self._table.writerow(_row(number, increment, solver.total_weight(self.assembly)))
            _written(self.path / "response.csv", self._rows.getvalue())

    def finish(self, response: solver.Response, seconds: float) -> dict[str, Any]:
        """Writes and returns the summary."""
        if not response.path:
            _written(self.path / "response.csv", self._rows.getvalue())
        summary = summary_of(response, seconds=seconds, case_text=self.case_text)
        _written(self.path / "summary.json", json.dumps(summary, indent=2, ensure_ascii=False) + "\n")
        return summary


def write(response: solver.Response, folder: str | Path, *, overwrite: bool = False) -> Path:
    """Writes the results folder of a response: VTU per increment, PVD, CSV and summary.json.

    Parameters
    ----------
    response : solver.Response
    folder : str or Path
    overwrite : bool
        Whether results that are there already may be replaced.

    Raises
    ------
    ResultsExist
    """
    results = ResultsFolder(folder, response.assembly, overwrite=overwrite)
    for increment in response.increments:
        results.add(increment)
    results.finish(response, sum(i.seconds for i in response.increments))
    return results.path


def summary_of(response: solver.Response, *, seconds: float, case_text: str = "") -> dict[str, Any]:
    """What summary.json holds; every length in m, force in N, angle in rad.

    Parameters
    ----------
    response : solver.Response
    seconds : float
        Solver time.
    case_text : str
    """
    path, collapse = response.path, response.collapse
    worst = {
        name: max((getattr(i.certificate, name) for i in path), default=None)
        for name in (
            "equilibrium_residual",
            "largest_penetration",
            "duality_gap",
            "complementarity",
            "kinematic_violation",
        )
    }
    return {
        "status": str(response.stop),
        "message": response.message,
        "collapse_displacement": collapse.displacement if collapse else None,
        "collapse_bracket": list(collapse.bracket) if collapse else None,
        "settlement_unit": response.settlements[-1].unit if response.settlements else "m",
        "initial_reaction": path[0].reaction if path else None,
        "collapse_reaction": collapse.reaction if collapse else None,
        "mechanism": collapse.words if collapse else None,
        "last_settlement": path[-1].settlement if path else None,
        "last_reaction": path[-1].reaction if path else None,
        "total_weight": response.total_weight,
        "n_blocks": response.assembly.n_blocks,
        "n_contacts": len(path[-1].contacts) if path else None,
        "n_increments": len(path),
        "n_falling_frames": len(response.increments) - len(path),
        "n_programs": sum(i.programs for i in response.increments),
        "largest_residuals": worst,
        "seconds": seconds,
        "finished": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "versions": _versions(),
        "case": case_text,
    }


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version(), "platform": platform.platform()}
    for name in ("blockvis", "numpy", "scipy", "highspy", "pyvista", "vtk", "meshio"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def _row(number: int, increment: solver.Increment, weight: float) -> Sequence[Any]:
    certificate = increment.certificate
    counts = np.bincount(increment.states, minlength=len(solver.ContactState))
    return (
        number,
        increment.phase,
        repr(float(increment.settlement)),
        repr(float(increment.reaction)),
        repr(float(increment.reaction) / weight),
        repr(float(increment.load_multiplier)),
        f"{certificate.equilibrium_residual:.3e}",
        f"{certificate.largest_penetration:.3e}",
        f"{certificate.duality_gap:.3e}",
        f"{certificate.complementarity:.3e}",
        f"{certificate.kinematic_violation:.3e}",
        *(int(counts[state]) for state in (0, 1, 2, 3)),
        increment.programs,
        f"{increment.seconds:.4f}",
    )


def _packed(arrays: Mapping[str, Any]) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def _assembly_arrays(assembly: solver.Assembly) -> dict[str, Any]:
    return {
        "vertices": assembly.vertices,
        "offsets": assembly.offsets,
        "names": np.array(assembly.names),
        "roles": assembly.roles,
        "density": assembly.density,
        "thickness": assembly.thickness,
        "materials": np.array(assembly.materials),
    }


_CONTACT_ARRAYS = ("vertex", "edge", "corner", "block_a", "block_b", "points", "frames", "gaps", "along")
_ARRAYS = ("forces", "displacements", "friction", "velocity", "support_forces")
_NUMBERS = ("settlement", "phase", "load_multiplier", "reaction", "programs", "seconds")
_CERTIFICATE = (
    "equilibrium_residual",
    "largest_penetration",
    "duality_gap",
    "complementarity",
    "kinematic_violation",
)


def _increment_arrays(increment: solver.Increment) -> dict[str, Any]:
    arrays: dict[str, Any] = {name: getattr(increment.contacts, name) for name in _CONTACT_ARRAYS}
    arrays.update({name: getattr(increment, name) for name in (*_ARRAYS, *_NUMBERS)})
    arrays.update({name: getattr(increment.certificate, name) for name in _CERTIFICATE})
    arrays.update(
        positions=increment.pose.positions, rotations=increment.pose.rotations, status=np.array(str(increment.status))
    )
    return arrays


def _increment_of(arrays: Mapping[str, np.ndarray]) -> solver.Increment:
    fields: dict[str, Any] = {name: arrays[name] for name in _ARRAYS}
    fields.update({name: arrays[name].item() for name in _NUMBERS})
    return solver.Increment(
        pose=solver.Pose(arrays["positions"], arrays["rotations"]),
        contacts=solver.Contacts(**{name: arrays[name] for name in _CONTACT_ARRAYS}),
        certificate=solver.Certificate(**{name: arrays[name].item() for name in _CERTIFICATE}),
        status=solver.Status(str(arrays["status"])),
        **fields,
    )


def stored_case(folder: str | Path) -> str:
    """Text of the case that a results folder was written from; empty where it was written from Python."""
    summary = Path(folder) / "summary.json"
    if not summary.is_file():
        return ""
    return str(json.loads(summary.read_text(encoding="utf-8")).get("case", ""))


def open_results(folder: str | Path) -> solver.Response:
    """Reopens a results folder as the response it was written from, without solving.

    Parameters
    ----------
    folder : str or Path

    Returns
    -------
    solver.Response
        Without the settlements' limits and the loads unless the case can be read back from the summary.

    Raises
    ------
    ValueError
        If the folder holds no results.
    """
    from .case import case_interfaces, case_loads, parse_case

    folder = Path(folder)
    if not (folder / "assembly.npz").is_file():
        raise ValueError(f"'{folder}' holds no results (no assembly.npz in it); give the folder that a run wrote")
    with np.load(folder / "assembly.npz", allow_pickle=False) as stored:
        assembly = solver.Assembly(
            vertices=stored["vertices"],
            offsets=stored["offsets"],
            names=tuple(map(str, stored["names"])),
            roles=stored["roles"],
            density=stored["density"],
            thickness=stored["thickness"],
            materials=tuple(map(str, stored["materials"])),
        )
    increments = []
    for file in sorted((folder / "increments").glob("state_*.npz")):
        with np.load(file, allow_pickle=False) as stored:
            increments.append(_increment_of(stored))
    summary = {}
    if (folder / "summary.json").is_file():
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    settlements: tuple[solver.Settlement, ...] = ()
    interfaces, loads = solver.Interfaces(), solver.self_weight(assembly)
    if summary.get("case"):
        case = parse_case(summary["case"], folder / "case.toml")
        settlements, interfaces, loads = case.settlements, case_interfaces(case), case_loads(case, assembly)
    stop = solver.Status(summary.get("status", solver.Status.INTERRUPTED))
    return solver.Response(
        assembly=assembly,
        settlements=settlements,
        interfaces=interfaces,
        loads=loads,
        increments=tuple(increments),
        stop=stop,
        message=summary.get("message", ""),
        collapse=_collapse_of(summary, increments, assembly),
    )


def _collapse_of(
    summary: Mapping[str, Any], increments: Sequence[solver.Increment], assembly: solver.Assembly
) -> solver.Collapse | None:
    if summary.get("collapse_bracket") is None:
        return None
    mechanism = np.zeros((assembly.n_blocks, 3))
    falling = [i for i in increments if i.status == solver.Status.FALLING]
    if falling:
        motion = falling[0].velocity
        mechanism = motion / max(np.abs(motion * [1.0, 1.0, assembly.block_size]).max(), 1e-300)
    return solver.Collapse(
        displacement=summary["collapse_displacement"],
        bracket=(summary["collapse_bracket"][0], summary["collapse_bracket"][1]),
        reaction=summary["collapse_reaction"],
        mechanism=mechanism,
        unit=summary.get("settlement_unit", "m"),
        words=summary.get("mechanism") or "",
    )
