"""Which ways to a solution are tried, and in which order."""

from __future__ import annotations

from solver.lp.problem import SolveError

from .clarabel import run_clarabel
from .problem import ConicProgram, ConicSolution


def solve_cones(
    program: ConicProgram, routes: tuple[str, ...] = ("clarabel", "clarabel without presolve")
) -> ConicSolution:
    """Solve a conic program, trying one route after another until a solution passes its check.

    Parameters
    ----------
    program : ConicProgram
    routes : tuple of str
        In the order to try.

    Raises
    ------
    Unbounded
        If the program has no minimum, proved by a ray.
    SolveError
        If no route gives a solution that passes; the message lists what each of them ended with.
    """
    outcomes = []
    for route in routes:
        solution, status = run_clarabel(program, route)
        if solution is not None and solution.accepted:
            return solution
        if solution is not None:
            status += f", violation {solution.violation:.1e}, gap {solution.gap:.1e}"
        outcomes.append(f"{route}: {status}")
    raise SolveError(
        f"no solution of the conic program with {program.matrix.shape[0]} rows and {len(program.friction)} cones "
        f"passed its check ({'; '.join(outcomes)})"
    )
