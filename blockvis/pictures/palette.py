"""The colours of all pictures, so that a crack looks the same in a still, in the animation and on the page."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

import solver

PAPER = (255, 255, 255)
INK = (38, 38, 38)
FAINT = (120, 120, 120)
OUTLINE = (92, 82, 68)
SUPPORT = (206, 209, 213)
HATCH = (140, 146, 153)
GHOST = (165, 165, 165)
OPEN = (226, 78, 27)
SLIDING = (126, 55, 178)
FORCE = (20, 92, 168)
HINGE = (17, 17, 17)
CRUSHING = (255, 193, 7)
SETTLEMENT = (0, 121, 107)
#: The ground of a fall in space, and shadows on it.
GROUND, SHADOW = (238, 236, 231), (214, 210, 202)
#: Of supports that move, where their motion is not hatched.
MOVING = (127, 187, 180)
LIVE = (190, 24, 118)
#: Arrows of loads.
LOADS = {"live": LIVE, "dead": (120, 66, 0)}
#: Ties that carry, and those that yield.
TIE, YIELDING = (30, 130, 50), (222, 148, 0)
#: Loose fill over arches and vaults, its hatch and its rim.
FILL, FILL_HATCH, FILL_RIM = (245, 239, 226), (196, 180, 150), (150, 128, 92)
WARNING = (190, 30, 30)
#: Blocks that have fallen while the rest stands, whatever they are of; their edges are those of a warning.
LOST = (247, 205, 198)
#: Blocks as drawn, before any analysis: all, drawn twice, refused, not standing; and what was left out.
DRAWN = (239, 230, 212)
TWICE = (91, 143, 214)
REFUSED = (214, 96, 91)
FALLS = (244, 176, 97)
LEFT_OUT = (176, 90, 200)

#: Fills by material, in the order of their sorted names: sandstone, brick, slate, tuff, moss, ash.
STONES = np.array(
    [(228, 217, 194), (214, 176, 152), (190, 198, 204), (222, 206, 154), (190, 203, 176), (212, 200, 208)], dtype=float
)

#: Words in the name of a material that choose its stone, in the languages of drawings so far.
HINTS = {1: ("brick", "mattone", "backstein", "brique", "ladrillo"), 2: ("slate", "granite"), 3: ("tuff", "tufo")}

#: Tints of the parts of a mechanism, so that neighbours differ: blue, green, violet, ochre, rose, teal.
PARTS = np.array(
    [(151, 190, 224), (172, 208, 160), (196, 178, 222), (236, 206, 136), (231, 178, 186), (150, 208, 204)], dtype=float
)

#: Edges of the blocks and the main cracks in a drawing of cracks, the widest first: red, blue, green,
#: violet, ochre, teal.
PALE_OUTLINE = (204, 199, 191)
SURVEYED = (WARNING, FORCE, (46, 125, 50), SLIDING, (184, 110, 0), (0, 121, 125))
#: Of the forces of ties over a settlement; blue is the reaction, and red what fails.
TIE_SHADES = (*SURVEYED[2:], *SURVEYED[:2])

#: Of the colour of blocks so much is left in a drawing of cracks.
SURVEY = 0.3

#: Of the colour of blocks that stand still while others move so much is left: the eye goes to what moves.
STILL = 0.45

#: Blocks of one material differ in lightness by up to this fraction, which distinguishes neighbours.
SHADE = 0.035

#: Cracks in space, from narrow to wide: all stand out from stone.
CRACKS = np.array([(244, 162, 97), OPEN, (122, 16, 16)], dtype=float)

#: Pale to deep indigo, even in lightness, and light enough at its end for outlines to show: no support that moves, and
#: no arrow on the blocks, has its hue.
RAMP = np.array(
    [
        (241, 242, 248),
        (217, 220, 238),
        (193, 199, 228),
        (169, 177, 217),
        (146, 155, 204),
        (124, 133, 190),
        (103, 112, 173),
        (84, 92, 153),
    ],
    dtype=float,
)  # fmt: skip


def block_colours(materials: tuple[str, ...], free: np.ndarray) -> np.ndarray:
    """(n_blocks, 3) uint8 array: fill of each block by its material, supports, where not ``free`` (n_blocks,), grey."""
    # Supports are grey: their materials take no stone.
    kinds = sorted({m for m, is_free in zip(materials, free, strict=True) if is_free})
    hinted = {kind: k for kind in kinds for k, words in HINTS.items() if any(w in kind.lower() for w in words)}
    rest = [k for k in range(len(STONES)) if k not in hinted.values()]
    others = [kind for kind in kinds if kind not in hinted]
    number = hinted | {kind: rest[k % len(rest)] for k, kind in enumerate(others)}
    colours = STONES[[number.get(m, 0) for m in materials]]
    # A fixed low-discrepancy sequence: the same picture every time, neighbours never alike.
    shade = 1.0 + SHADE * (2.0 * ((np.arange(len(materials)) * 0.6180339887) % 1.0) - 1.0)
    colours = np.where(free[:, None], colours * shade[:, None], SUPPORT)
    return np.clip(np.rint(colours), 0, 255).astype(np.uint8)


def role_colours(assembly: solver.Assembly, settles: bool = True) -> np.ndarray:
    """(n_blocks, 3) uint8 array: fills by material, supports grey, moving ones in the colour of what settles."""
    fill = block_colours(assembly.materials, assembly.free)
    fill[assembly.moving & settles] = MOVING
    return fill


def pale(fill: np.ndarray, blocks: np.ndarray | bool, left: float) -> np.ndarray:
    """(n_blocks, 3) uint8 array: fills of all blocks, or some (n_blocks,), with a part of their colour ``left``."""
    paler = np.rint(left * fill + (1.0 - left) * np.array(PAPER))
    return np.where(np.reshape(blocks, (-1, 1)), paler, fill).astype(np.uint8)


def part_colours(fill: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """(n_blocks, 3) uint8 array: fills with the parts of a mechanism, (n_blocks,) int, tinted; those of -1 stand."""
    tint = PARTS[parts % len(PARTS)]
    return np.where(parts[:, None] >= 0, np.rint(0.3 * fill + 0.7 * tint), fill).astype(np.uint8)


def crack_colours(count: int) -> np.ndarray:
    """(count, 3) uint8 array: colours of classes of cracks in space, from narrow to wide; of one the middle one."""
    return _on_ramp(CRACKS, np.linspace(0.0, 1.0, count) if count > 1 else np.full(count, 0.5))


def displacement_colours(fraction: np.ndarray) -> np.ndarray:
    """(n, 3) uint8 array: colours of the displacement scale, ``fraction`` (n,) from 0 to 1, clamped."""
    return _on_ramp(RAMP, fraction)


def _on_ramp(ramp: np.ndarray, fraction: np.ndarray) -> np.ndarray:
    places = np.linspace(0.0, 1.0, len(ramp))
    return np.rint(np.stack([np.interp(fraction, places, of) for of in ramp.T], axis=-1)).astype(np.uint8)


def rgb(colour: np.ndarray) -> tuple[int, int, int]:
    """Give a colour of an array, (3,), as integers."""
    return int(colour[0]), int(colour[1]), int(colour[2])


def hexadecimal(colour: Iterable[float]) -> str:
    """Write a colour as CSS and matplotlib do.

    Examples
    --------
    >>> hexadecimal((255, 0, 16))
    '#ff0010'
    """
    return "#{:02x}{:02x}{:02x}".format(*map(int, colour))
