"""Parametric layouts: arches, frames and walls in the plane, vaults and domes in space, each with its ground."""

from .arches import arch, basket_handle_arch, pointed_arch, segmental_arch
from .catalogue import LAYOUTS, build, dimension_of, help_text, parameters_of
from .domes import dome
from .frames import arch_on_piers, buttressed_arch, column, portal
from .vaults import barrel_vault, extruded_arch
from .walls import facade, panel, wall

__all__ = [
    "LAYOUTS",
    "arch",
    "arch_on_piers",
    "barrel_vault",
    "basket_handle_arch",
    "build",
    "buttressed_arch",
    "column",
    "dimension_of",
    "dome",
    "extruded_arch",
    "facade",
    "help_text",
    "panel",
    "parameters_of",
    "pointed_arch",
    "portal",
    "segmental_arch",
    "wall",
]
