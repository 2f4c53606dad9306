"""The table [explain]: which causes are looked at, and how far the observations and the model are trusted."""

from __future__ import annotations

from dataclasses import dataclass

from .toml_table import Table, shortened

#: Directions in which a support may have moved, as the case file names them.
DIRECTIONS = ("down", "up", "left", "right", "rotation")


@dataclass(frozen=True)
class ExplainSettings:
    """What ``blockvis explain`` looks for.

    Attributes
    ----------
    supports : tuple of tuples of str
        Supports, or groups of them that move as one; each support of the drawing by default.
    directions : tuple of str
        Of :data:`DIRECTIONS`.
    trough : bool, optional
        Whether troughs of the ground are candidates; by default where the structure stands on three places or more.
    centres, inflections : tuple of float [m]
        Of troughs; a few over the width of the structure by default.
    friction : (float, float), optional
        Range of the friction coefficient; by default from 0.8 to 1.25 times that of the case.
    limit : float, optional [m]
        Largest displacement of a support.
    model_uncertainty : float
        Standard deviation of computed widths, as a fraction of the observed ones.
    place_uncertainty : float, optional [m]
        Within which a crack at x, y may be another joint of the model; half a block by default.
    outliers : float
        Probability that an observation has another cause.
    """

    supports: tuple[tuple[str, ...], ...] = ()
    directions: tuple[str, ...] = ("down", "left", "right", "rotation")
    trough: bool | None = None
    centres: tuple[float, ...] = ()
    inflections: tuple[float, ...] = ()
    friction: tuple[float, float] | None = None
    limit: float | None = None
    model_uncertainty: float = 0.25
    place_uncertainty: float | None = None
    outliers: float = 0.05


def read_explain(table: Table) -> ExplainSettings:
    """Read the table [explain]."""
    default = ExplainSettings()
    directions = table.take("directions", list(default.directions))
    directions = [directions] if isinstance(directions, str) else directions
    if not isinstance(directions, list) or not directions or not all(word in DIRECTIONS for word in directions):
        raise table.error("directions", f"is {shortened(directions)}; choose from {', '.join(DIRECTIONS)}")
    trough = table.take("trough")
    if trough not in (None, True, False):
        raise table.error("trough", f"is {shortened(trough)}; give true or false")
    inflections = table.numbers("inflections") or ()
    if any(value <= 0.0 for value in inflections):
        raise table.error("inflections", f"is {list(inflections)}; give lengths above 0, in m")
    friction = table.pair("friction")
    if friction is not None and not 0.0 <= friction[0] <= friction[1]:
        raise table.error("friction", f"is {list(friction)}; give the smallest and the largest coefficient")
    found = ExplainSettings(
        supports=_groups(table),
        directions=tuple(directions),
        trough=trough,
        centres=table.numbers("centres") or (),
        inflections=inflections,
        friction=friction,
        limit=table.number("limit", positive=True),
        model_uncertainty=table.number("model_uncertainty", default.model_uncertainty, positive=True),
        place_uncertainty=table.number("place_uncertainty"),
        outliers=table.number("outliers", default.outliers),
    )
    if found.place_uncertainty is not None and found.place_uncertainty < 0.0:
        raise table.error("place_uncertainty", f"is {found.place_uncertainty:g}; give a length of at least 0, in m")
    if not 0.0 < found.outliers < 1.0:
        raise table.error("outliers", f"is {found.outliers:g}; give a probability above 0 and below 1")
    table.finish()
    return found


def _groups(table: Table) -> tuple[tuple[str, ...], ...]:
    given = table.take("supports")
    entries = [given] if isinstance(given, str) else [] if given is None else given
    groups = []
    for entry in entries if isinstance(entries, list | tuple) else [None]:
        names = [entry] if isinstance(entry, str) else entry
        if not isinstance(names, list | tuple) or not names or not all(isinstance(name, str) for name in names):
            raise table.error("supports", f'is {shortened(given)}; give names, ["left", ["middle", "right"]]')
        groups.append(tuple(names))
    return tuple(groups)
