"""Parametric layouts in masonry terms; each comes with its ground."""

from .arches import arch, basket_handle_arch, pointed_arch, segmental_arch
from .frames import arch_on_piers, buttressed_arch, column, portal

__all__ = [
    "arch",
    "arch_on_piers",
    "basket_handle_arch",
    "buttressed_arch",
    "column",
    "pointed_arch",
    "portal",
    "segmental_arch",
]
