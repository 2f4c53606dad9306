"""Which ways to a solution are tried, and in which order."""

from __future__ import annotations

import time
from dataclasses import replace

from .band import Diverges, NoProgress, interior_point
from .highs import run_highs
from .problem import LinearProgram, LPSolution, SolveError, checked, raise_if_proved

#: Up to this many rows the simplex method is the fastest, and gives a vertex.
SIMPLEX_ROWS = 250

#: Up to this many rows crossover from an interior solution to a vertex may be asked for: it takes twenty times as long
#: as the program itself (measured on running-bond walls), and more beyond.
CROSSOVER_ROWS = 1500

#: Our own way, for programs whose rows form a band.
BAND = "band"

#: The order for all but the smallest programs, and for small ones that need no vertex.
INTERIOR_ROUTES = (BAND, "hipo", "hipo without presolve", "ipx", "ipx with crossover", "simplex")

#: The order for programs of which a vertex is wanted.
VERTEX_ROUTES = ("hipo with crossover", "ipx with crossover", "simplex", "simplex without presolve")


def vertex_routes(rows: int) -> tuple[str, ...] | None:
    """Give the order in which a vertex of a program with so many rows is looked for; None for the one by size."""
    return VERTEX_ROUTES if SIMPLEX_ROWS < rows <= CROSSOVER_ROWS else None


def solve_lp(program: LinearProgram, routes: tuple[str, ...] | None = None) -> LPSolution:
    """Solve a linear program, trying one route after another until a solution passes its check.

    Parameters
    ----------
    program : LinearProgram
    routes : tuple of str, optional
        ``BAND`` or names out of ``ROUTES``, in the order to try; chosen by size by default.

    Raises
    ------
    Unbounded
        If the program has no minimum, proved by a ray.
    SolveError
        If no route gives a solution that passes; the message lists what each of them ended with.
    """
    if routes is None:
        small = program.matrix.shape[0] <= SIMPLEX_ROWS
        routes = ("simplex", "simplex without presolve", "ipx with crossover", "hipo") if small else INTERIOR_ROUTES
    outcomes = []
    for route in routes:
        solution, status = _in_band(program) if route == BAND else run_highs(program, route)
        if solution is not None and solution.accepted:
            return solution
        if solution is not None:
            status += (
                f", violation {max(solution.primal_violation, solution.dual_violation):.1e}, gap {solution.gap:.1e}"
            )
        outcomes.append(f"{route}: {status}")
    raise SolveError(
        f"no solution of the linear program with {program.matrix.shape[0]} rows and {program.matrix.shape[1]} "
        f"columns passed its check ({'; '.join(outcomes)})"
    )


def _in_band(program: LinearProgram) -> tuple[LPSolution | None, str]:
    started = time.perf_counter()
    given = program.cost, program.matrix, program.lower, program.upper, program.places
    start = program.start if program.start is not None and program.start.fits(program.matrix) else None
    try:
        try:
            x, y, iterations, early = interior_point(*given, start)
        except (Diverges, NoProgress):
            if start is None:
                raise
            x, y, iterations, early = interior_point(*given)
    except Diverges as found:
        raise_if_proved(program, found.ray)
        return None, str(found)
    except NoProgress as reason:
        return None, str(reason)
    solution = checked(program, x, y, BAND, iterations, time.perf_counter() - started)
    return replace(solution, early=early), "solved"
