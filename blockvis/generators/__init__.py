"""Parametric layouts: arches, frames and walls, each with its ground."""

from .arches import arch, basket_handle_arch, pointed_arch, segmental_arch
from .catalogue import LAYOUTS, build, help_text, parameters_of
from .frames import arch_on_piers, buttressed_arch, column, portal
from .walls import facade, panel, wall

__all__ = [
    "LAYOUTS",
    "arch",
    "arch_on_piers",
    "basket_handle_arch",
    "build",
    "buttressed_arch",
    "column",
    "facade",
    "help_text",
    "panel",
    "parameters_of",
    "pointed_arch",
    "portal",
    "segmental_arch",
    "wall",
]
