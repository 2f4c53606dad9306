"""Whether the structure of a case stands as drawn, before anything is asked of it; if not, what falls and why."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

import solver
from blockvis.cases.contents import Case
from blockvis.layout.outlines import TOUCHING
from solver import mechanics
from solver.mechanics import linked

from .plan import planned

#: Most blocks whose first equilibrium is found in some seconds, in the plane and in space.
MOST_BLOCKS = {2: 2500, 3: 250}

#: The cause is looked for where the first equilibrium took no longer than this [s].
PATIENCE = 10.0

#: Friction with which blocks that can only tip still fall.
ROUGH = 5.0


@dataclass(frozen=True)
class FirstEquilibrium:
    """What came of a case as drawn."""

    stands: bool | None  #: None where it was not tried.
    says: str
    falling: tuple[int, ...] = ()  #: Blocks that fall.


def first_equilibrium(case: Case, assembly: solver.Assembly) -> FirstEquilibrium:
    """Find the first equilibrium of a case, of which an assembly was built, or say which blocks fall and why.

    Raises ``ValueError`` for input that cannot be analysed.
    """
    most = MOST_BLOCKS[assembly.dimension]
    if assembly.n_blocks > most:
        return FirstEquilibrium(None, f"not tried whether it stands: {assembly.n_blocks} blocks are more than {most}")
    started = time.process_time()
    first, ending = _first_of(case, assembly)
    seconds = time.process_time() - started
    if ending is None and first is not None and first.status != solver.Status.FALLING:
        found = f"it stands: first equilibrium found in {seconds:.1f} s"
        return FirstEquilibrium(True, "; ".join((found, *first.notes)))
    message = "no first equilibrium was found" if ending is None else ending.message
    falling = [] if first is None else mechanics.falling_blocks(assembly, first.velocity).tolist()
    cause = _cause(case, assembly, falling) if seconds < PATIENCE else ""
    says = f"{message.partition(';')[0]}; {cause}" if cause else message
    return FirstEquilibrium(False, says, tuple(falling))


def _first_of(case: Case, assembly: solver.Assembly) -> tuple[solver.Increment | None, mechanics.Ending | None]:
    """Find the first increment, and the ending of an analysis that has no second because nothing stands."""
    steps = planned(case, assembly).steps
    first = next(steps, None)
    if first is None or first.status == solver.Status.FALLING:
        for _ in steps:
            pass
        return first, steps.ending
    steps.close()
    return first, None


def _cause(case: Case, assembly: solver.Assembly, falling: Sequence[int]) -> str:
    """Say why blocks fall: they touch nothing that stands, they slide, or they tip."""
    contacts = mechanics.find_contacts(assembly, assembly.vertices, TOUCHING * assembly.block_size)
    part = linked((contacts.block_a, contacts.block_b), assembly.n_blocks)
    loose = np.flatnonzero(assembly.free & ~np.isin(part, part[~assembly.free]))
    if len(loose):
        others = "; the others fall for another reason, told once these stand" if set(falling) - set(loose) else ""
        return (
            f"{len(loose)} of them touch nothing that stands ({assembly.listed(loose, 6)}): give them a support, leave "
            f"them out (ignore), or close the gaps (joint_thickness){others}"
        )
    first, ending = _first_of(replace(case, friction_coefficient=ROUGH, interfaces={}), assembly)
    if ending is None and first is not None and first.status != solver.Status.FALLING:
        return (
            f"they slide: with more friction than {case.friction_coefficient:g}, or their gaps closed, they would stand"
        )
    still = np.array(falling if first is None else mechanics.falling_blocks(assembly, first.velocity))
    some = bool(set(falling) - set(still))
    who = f"{len(still)} of them ({assembly.listed(still, 6)})" if some else "they"
    return (
        f"{who} tip or drop whatever the friction is: look for gaps below them, a missing stone or a missing support; "
        "what overhangs needs a tie that is stiff or has prestress, a prop or a support"
        + "; the others slide, or fall with these"
        * some
    )
