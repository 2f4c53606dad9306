"""compas_cra beside ours on one equilibrium problem: do forces exist that carry the weight of the blocks?

Rigid-block equilibrium (RBE) penalises tension and always finds forces: an equilibrium exists where the tension it
cannot avoid is none. Coupled rigid-block analysis (CRA) adds infinitesimal movements and fails where there is none.
"""

from __future__ import annotations

import contextlib
import io
import time
from dataclasses import dataclass

import numpy as np

import solver
from blockvis.layout.layout import layout_of, standing

__all__ = ["Verdict", "coupled_analysis", "limit_load", "rigid_block_equilibrium"]


@dataclass(frozen=True)
class Verdict:
    """What a tool says about one assembly under its weight.

    Attributes
    ----------
    stands : bool
    residual : float
        Largest unbalanced force, relative to the weight of the free blocks; ``nan`` where there are no forces.
    tension : float
        Largest tension at a contact point, relative to the weight.
    seconds : float [s]
        Processor time; without that of finding the joints for compas_cra, which ``note`` tells.
    note : str
    """

    stands: bool
    residual: float = float("nan")
    tension: float = float("nan")
    seconds: float = float("nan")
    note: str = ""


#: Tension, relative to the weight, up to which forces count as an equilibrium of dry joints.
TENSION = 1e-6


def limit_load(assembly: solver.Assembly, friction: float) -> Verdict:
    """Ours: the limit load for a horizontal live load, which says also whether the dead load is carried."""
    started = time.process_time()
    along = (1.0, 0.0, 0.0)[: assembly.dimension]
    loads = solver.Loads(solver.self_weight(assembly).dead, solver.weight_fraction(assembly, along))
    found = solver.limit_load(assembly, loads=loads, friction_coefficient=friction)
    seconds = time.process_time() - started
    if found.status is solver.LimitStatus.NO_EQUILIBRIUM:
        return Verdict(False, seconds=seconds)
    return Verdict(True, found.certificate.equilibrium_residual, 0.0, seconds, f"and α = {found.multiplier:.4f}")


def _cra_assembly(assembly: solver.Assembly):
    from compas_assembly.datastructures import Block
    from compas_cra.algorithms import assembly_interfaces_numpy
    from compas_cra.datastructures import CRA_Assembly

    sketch = layout_of(assembly)
    solids = sketch.solids if assembly.dimension == 3 else standing(sketch, 1.0).solids  # gravity is along -z
    blocks = CRA_Assembly()
    for i, (vertices, faces) in enumerate(solids):
        blocks.add_block(Block.from_vertices_and_faces(vertices.tolist(), faces), node=i)
    blocks.set_boundary_conditions(np.flatnonzero(~assembly.free).tolist())
    smallest = 1e-3 * float(assembly.widths.min()) ** 2  # m²; the default of 0.1 m² would drop joints of bricks
    assembly_interfaces_numpy(blocks, nmax=assembly.n_blocks, tmax=1e-6, amin=smallest)
    return blocks


def _solved(assembly: solver.Assembly, friction: float, method: str) -> Verdict:
    import compas_cra.equilibrium

    with contextlib.redirect_stdout(io.StringIO()):  # it prints matrices and densities
        started = time.process_time()
        blocks = _cra_assembly(assembly)
        meeting = time.process_time() - started
        started = time.process_time()
        try:
            getattr(compas_cra.equilibrium, method)(blocks, mu=friction, density=1.0)
        except ValueError as refused:
            return Verdict(False, seconds=time.process_time() - started, note=str(refused))
        seconds = time.process_time() - started
        weight = compas_cra.equilibrium.external_force_setup(blocks, 1.0).flatten()
        matrix = compas_cra.equilibrium.equilibrium_setup(blocks, penalty=True)
    forces = [
        [force["c_np"], force["c_nn"], force["c_u"], force["c_v"]]
        for edge in blocks.graph.edges()
        for interface in blocks.graph.edge_attribute(edge, "interfaces")
        for force in interface.forces
    ]
    total = float(np.abs(weight).sum())
    # RBE's normal forces come in two parts, of which the solver leaves a little on both
    tension = max(0.0, max(pulling - pushing for pushing, pulling, _, _ in forces)) / total
    residual = float(np.abs(matrix @ np.ravel(forces) + weight).max()) / total
    note = f"tension {tension:.0e} W, " if tension > TENSION else ""
    return Verdict(tension <= TENSION, residual, tension, seconds, f"{note}joints in another {meeting:.2f} s")


def rigid_block_equilibrium(assembly: solver.Assembly, friction: float) -> Verdict:
    """compas_cra, RBE."""
    return _solved(assembly, friction, "rbe_solve")


def coupled_analysis(assembly: solver.Assembly, friction: float) -> Verdict:
    """compas_cra, CRA."""
    return _solved(assembly, friction, "cra_solve")
