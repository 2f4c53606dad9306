"""Parametric layouts: arches, frames and walls in the plane, vaults and domes in space, each with its ground."""

from .arches import arch, basket_handle_arch, pointed_arch, segmental_arch
from .catalogue import LAYOUTS, build, dimension_of, help_text, parameters_of
from .corners import l_corner, t_corner, two_leaf_wall
from .domes import dome
from .fill import bond
from .frames import arch_on_piers, buttressed_arch, column, portal
from .groins import church_bay, cross_vault, pavilion_vault
from .vaults import barrel_vault, extruded_arch
from .walls import facade, panel, wall

__all__ = [
    "LAYOUTS", "arch", "arch_on_piers", "barrel_vault", "basket_handle_arch", "bond", "build", "buttressed_arch",
    "church_bay", "column", "cross_vault", "dimension_of", "dome", "extruded_arch", "facade", "help_text", "l_corner",
    "panel", "parameters_of", "pavilion_vault", "pointed_arch", "portal", "segmental_arch", "t_corner", "two_leaf_wall",
    "wall",
]  # fmt: skip
