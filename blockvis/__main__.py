"""``python -m blockvis``: the command line."""

from .cli import entry

entry()
