"""Interfaces: the friction and strength between blocks, by material and from joint to joint."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from .assembly import Assembly
from .words import checked, make_plain, plain

#: Friction coefficient above which it is probably an angle, and the largest: nothing slides by that, while larger ones
#: beside 1 cost the programs their digits.
STEEPEST, LARGEST = 3.0, 1e4


def steep_note(friction: float) -> str:
    """Say what a friction coefficient too large for masonry may have been meant as; empty for one of up to 3."""
    if friction <= STEEPEST:
        return ""
    angle = f"; if it is an angle in degrees, give its tangent, {math.tan(math.radians(friction)):.3g}"
    slope = math.degrees(math.atan(friction))
    return f"friction_coefficient = {friction:g} is a slope of {slope:.3g} degrees{angle if friction < 90.0 else ''}"


@dataclass(frozen=True)
class InterfaceLaw:
    """What an interface resists.

    Attributes
    ----------
    friction_coefficient : float
        Ratio of shear to normal force at sliding, from 0 to 1e4, by which nothing slides.
    cohesion : float [Pa]
        Shear strength without compression; none by default.
    compressive_strength : float [Pa]
        In limit loads only; infinite by default.
    tensile_strength : float [Pa]
        None by default; at most cohesion over friction coefficient, where the shear strength ends.
    normal_stiffness, shear_stiffness : float [Pa/m]
        Of elastic joints, whose give stays; infinite, or 0, for rigid ones.
    fracture_opening, fracture_slip : float [m]
        Opening and slip over which a point's cohesion and tensile strength fall to nothing; 0 for brittle joints.
    """

    friction_coefficient: float = 0.6
    cohesion: float = 0.0
    compressive_strength: float = np.inf
    tensile_strength: float = 0.0
    normal_stiffness: float = np.inf
    shear_stiffness: float = np.inf
    fracture_opening: float = 0.0
    fracture_slip: float = 0.0

    def __post_init__(self) -> None:
        """Check the values."""
        make_plain(self)
        units = {"friction_coefficient": "", "cohesion": " Pa", "tensile_strength": " Pa"}
        for name, unit in (units | {"fracture_opening": " m", "fracture_slip": " m"}).items():
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} is {getattr(self, name):g}{unit}; it must be a finite number of at least 0")
        mu, tension = self.friction_coefficient, self.tensile_strength
        if mu > LARGEST:
            raise ValueError(f"friction_coefficient is {mu:g}; nothing slides by {LARGEST:g}, give at most that")
        if not self.compressive_strength > 0.0:
            raise ValueError(f"compressive_strength is {self.compressive_strength:g} Pa; it must be positive")
        if mu * tension > self.cohesion * (1.0 + 1e-9):
            raise ValueError(
                f"tensile_strength is {tension:g} Pa, above cohesion / friction_coefficient {self.cohesion / mu:g} Pa, "
                "where the joint slides; give at most that, or more cohesion"
            )
        for name in ("normal_stiffness", "shear_stiffness"):
            if not (value := getattr(self, name)) >= 0.0:
                raise ValueError(f"{name} is {value:g} Pa/m; it must be positive, or left out for a rigid joint")
        for name in ("fracture_opening", "fracture_slip"):
            if (value := getattr(self, name)) > 0.0 and not self.bonds:
                raise ValueError(
                    f"{name} is {value:g} m, but there is no strength to lose; give cohesion, or leave it out"
                )

    def with_friction(self, factor: float) -> InterfaceLaw:
        """Return the law with friction times a factor, and no tension where its shear strength then ends."""
        mu = min(factor * self.friction_coefficient, LARGEST)
        tension = min(self.tensile_strength, self.cohesion / mu) if mu > 0.0 else self.tensile_strength
        return replace(self, friction_coefficient=mu, tensile_strength=tension)

    @property
    def crushes(self) -> bool:
        """Whether there is a compressive strength."""
        return bool(self.compressive_strength < np.inf)

    @property
    def bonds(self) -> bool:
        """Whether there is cohesion or tensile strength."""
        return self.cohesion > 0.0 or self.tensile_strength > 0.0

    @property
    def elastic(self) -> bool:
        """Whether joints give and stay so."""
        return 0.0 < self.normal_stiffness < np.inf or 0.0 < self.shear_stiffness < np.inf


@dataclass(frozen=True)
class JointScatter:
    """Friction that differs from joint to joint: a random factor for each pair of blocks.

    The factor of a pair depends on the seed and the two blocks alone, so that it is the same whenever the two touch:
    contact points come and go, joints keep their friction.

    Attributes
    ----------
    seed : int
        Of at least 0; the same seed gives the same factors.
    quantile : callable
        From an (n,) array of probabilities, inside 0 to 1, to the factors, finite and at least 0.
    """

    seed: int
    quantile: Callable[[np.ndarray], np.ndarray]

    def __post_init__(self) -> None:
        """Check the seed."""
        make_plain(self)
        if self.seed < 0:
            raise ValueError(f"seed is {self.seed}; give a whole number of at least 0")

    def factors(self, block_a: np.ndarray, block_b: np.ndarray) -> np.ndarray:
        """(n,) array: factor of each pair of blocks, in either order."""
        low, high = np.minimum(block_a, block_b), np.maximum(block_a, block_b)
        number = _mixed(_mixed(_mixed(np.array([self.seed])) ^ low.astype(np.uint64)) ^ high.astype(np.uint64))
        # The 53 bits that a float holds, half a step off both ends.
        found = np.asarray(self.quantile(((number >> np.uint64(11)) + 0.5) * 2.0**-53), dtype=float)
        for wrong in found[~((found >= 0.0) & (found < np.inf))].tolist():
            raise ValueError(f"the quantile of a joint's scatter gives the factor {wrong:g}; it must be at least 0")
        return found


def _mixed(number: np.ndarray) -> np.ndarray:
    """(n,) uint64 array: numbers that pass for random, each a function of the one it comes from.

    The finalizer of SplitMix64: Steele, Lea & Flood (2014), https://doi.org/10.1145/2660193.2660195.
    """
    z = number.astype(np.uint64) + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@dataclass(frozen=True)
class Interfaces:
    """The law of every interface: a default, and others for pairs of materials.

    Attributes
    ----------
    default : InterfaceLaw
    pairs : mapping from (material, material) to InterfaceLaw
        Either order.
    scatter : JointScatter, optional
        Factors on the friction of each pair of blocks; without it joints of the same materials are alike.
    ground : mapping from str to float [Pa/m]
        Stiffness of the ground under supports, by their names; a name that none has is that of numbered pieces. Joints
        with them have it for their normal stiffness, and neither tension nor cohesion.
    """

    default: InterfaceLaw = field(default_factory=InterfaceLaw)
    pairs: Mapping[tuple[str, str], InterfaceLaw] = field(default_factory=dict)
    scatter: JointScatter | None = None
    ground: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the laws, the ground, and that no pair has two laws."""
        make_plain(self)
        checked(self.default, InterfaceLaw, "the default law of interfaces")
        if self.scatter is not None:
            checked(self.scatter, JointScatter, "the scatter of interfaces")
        for pair, law in self.pairs.items():
            checked(law, InterfaceLaw, f"the law of the interface of {pair}")
            if not isinstance(pair, tuple) or len(pair) != 2:
                raise ValueError(f"pairs have a law for {pair!r}; give it for two materials")
            first, second = pair
            if self.pairs.get((second, first), law) != law:
                raise ValueError(
                    f"the interface of '{first}' and '{second}' has another law as '{second}' and '{first}'; give one"
                )
        for name, stiffness in self.ground.items():
            if not 0.0 < plain(stiffness, "float", f"the stiffness of the ground under '{name}'") < np.inf:
                raise ValueError(f"the ground under '{name}' has {stiffness:g} Pa/m; it must be positive")

    def check(self, assembly: Assembly) -> None:
        """Raise ``ValueError`` for laws of a material that no block has, and ground under what is no support."""
        for material in sorted({material for pair in self.pairs for material in pair} - set(assembly.materials)):
            has = sorted(set(assembly.materials))
            raise ValueError(f"no block is of the material '{material}' of the pairs of interfaces; there are {has}")
        for name, stiffness in self.ground.items():
            if np.isnan(replace(self, ground={name: stiffness}).ground_stiffness(assembly)).all():
                raise ValueError(f"no support is named '{name}', whose ground has a stiffness; name one")

    def friction(self, assembly: Assembly, block_a: np.ndarray, block_b: np.ndarray) -> np.ndarray:
        """(n,) array: friction coefficient between the blocks of each pair."""
        alike = self._by_material("friction_coefficient", assembly, block_a, block_b)
        return alike if self.scatter is None else alike * self.scatter.factors(block_a, block_b)

    def values(self, assembly: Assembly, block_a: np.ndarray, block_b: np.ndarray, *names: str) -> list[np.ndarray]:
        """(n,) array of each named attribute of the laws between the blocks of each pair."""
        found = [self._by_material(name, assembly, block_a, block_b) for name in names]
        if self.ground:
            of_block = self.ground_stiffness(assembly)
            stiffness = np.fmin(of_block[block_a], of_block[block_b])
            on_ground = ~np.isnan(stiffness)
            given = {"normal_stiffness": stiffness[on_ground], "cohesion": 0.0, "tensile_strength": 0.0}
            for name, values in zip(names, found, strict=True):
                if name in given:
                    values[on_ground] = given[name]
        return found

    def ground_stiffness(self, assembly: Assembly) -> np.ndarray:
        """(n_blocks,) array [Pa/m]: stiffness of the ground under each block that is a support with one, else nan."""
        cut = {name: stiffness for name, stiffness in self.ground.items() if name not in assembly.names}
        whole = (name.rstrip("0123456789").removesuffix(" ") for name in assembly.names)
        named = zip(assembly.names, whole, strict=True)
        found = np.array([self.ground.get(name, cut.get(one, np.nan)) for name, one in named])
        return np.where(assembly.free, np.nan, found)

    @property
    def laws(self) -> tuple[InterfaceLaw, ...]:
        """All laws."""
        return self.default, *self.pairs.values()

    @property
    def dry(self) -> bool:
        """Whether no interface has strength but friction, and none crushes."""
        return not any(law.bonds or law.crushes for law in self.laws)

    @property
    def elastic(self) -> bool:
        """Whether joints, or the ground under supports, give and stay so."""
        return bool(self.ground) or any(law.elastic for law in self.laws)

    @property
    def mortar(self) -> bool:
        """Whether an interface has cohesion, tensile strength or stiffness."""
        return self.elastic or any(law.bonds for law in self.laws)

    def refuse_crushing(self, analysis: str) -> None:
        """Raise ``ValueError`` for compressive strength in an analysis that follows a path."""
        if any(law.crushes for law in self.laws):
            raise ValueError(f"crushing along the path of {analysis} is not followed; leave compressive_strength out")

    def refuse_pose_alone(self) -> None:
        """Raise ``ValueError`` where joints are elastic, whose gaps do not tell which of them carry."""
        if self.elastic:
            raise ValueError(
                "joints are elastic, of which a pose does not tell what compresses them; give bonds_at, the bonds of "
                "the increment that the pose is from"
            )

    def refuse_mortar(self, what: str) -> None:
        """Raise ``ValueError`` for strength or stiffness of joints where only dry rigid ones are known."""
        if self.mortar:
            raise ValueError(f"{what} knows dry joints only; leave cohesion, tensile_strength and stiffness out")

    def _by_material(self, name: str, assembly: Assembly, block_a: np.ndarray, block_b: np.ndarray) -> np.ndarray:
        kinds = sorted({*assembly.materials, *(m for pair in self.pairs for m in pair)})
        number = {kind: k for k, kind in enumerate(kinds)}
        table = np.full((len(kinds), len(kinds)), getattr(self.default, name))
        for (first, second), law in self.pairs.items():
            table[number[first], number[second]] = table[number[second], number[first]] = getattr(law, name)
        material = np.array([number[m] for m in assembly.materials])
        return table[material[block_a], material[block_b]]
