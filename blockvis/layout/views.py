"""Views: which two coordinates of a drawing in space become x and y of the layout."""

from __future__ import annotations

from .notes import UPRIGHT, Note

#: Coordinates kept by each view: from +z, from -y and from +x, which mirrors nothing.
VIEWS = {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}


def checked_view(view: str | None) -> str | None:
    """Return the view if it is one; ValueError for any other word."""
    if view is not None and view not in VIEWS:
        raise ValueError(f"view '{view}' is not known; the views are {', '.join(VIEWS)}")
    return view


def checked_dimension(dimension: int | str | None) -> int | None:
    """Return the dimension, None for "auto"; ValueError for anything but 2, 3 and "auto"."""
    if dimension in (None, "auto"):
        return None
    if dimension not in (2, 3) or isinstance(dimension, bool):
        raise ValueError(f'dimension is {dimension!r}; give 2, 3 or "auto"')
    return int(dimension)


def axis_across(view: str) -> int:
    """Give the number of the coordinate along which a view looks."""
    return 3 - sum(VIEWS[view])


def view_along(axis: int) -> str:
    """Name the view that looks along an axis: 0 for x, 1 for y, 2 for z."""
    return next(view for view in VIEWS if axis_across(view) == axis)


def upright_note(view: str) -> Note:
    """Say that a drawing that stands upright was turned into the plane of x and y."""
    return Note(UPRIGHT, f"the drawing stands upright: its ({view[0]}, {view[1]}) were read as (x, y)")
