"""Packages that only some verbs need, and the command that installs them."""

from __future__ import annotations

from importlib.util import find_spec

#: What each extra of pyproject.toml makes importable.
EXTRAS: dict[str, tuple[str, ...]] = {
    "studies": ("dask", "distributed", "pandas", "pyarrow", "SALib", "tomli_w"),
    "cad": ("gmsh",),
    "geo": ("shapefile",),
    "dae": ("collada",),
}

#: Packages that are not called as they are imported.
PACKAGES = {"shapefile": "pyshp", "collada": "pycollada"}


class MissingExtra(ImportError):
    """Packages of an extra are not installed; the message names them and the command that installs them."""


def install_command(extra: str) -> str:
    """Name the command that adds an extra, a key of :data:`EXTRAS`, to an installed blockvis."""
    return f"pip install 'blockvis[{extra}]'"


def require(extra: str, needed_by: str) -> None:
    """Check that the packages of an extra are installed, without importing them, and raise ``MissingExtra`` if not.

    ``needed_by`` is the subject of the message, in the plural.
    """
    missing = [PACKAGES.get(name, name) for name in EXTRAS[extra] if not is_installed(name)]
    if missing:
        raise MissingExtra(
            f"{needed_by} need {', '.join(missing)}, which this environment lacks; "
            f"install with: {install_command(extra)}"
        )


def is_installed(name: str) -> bool:
    """Whether a package, as it is imported, is installed, without importing it."""
    try:
        return find_spec(name) is not None
    except ImportError:
        return False
