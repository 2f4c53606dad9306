"""Blocks of 3DEC's command files, .3ddat .3dec .dat .txt: ``poly brick``, ``poly prism``, ``block create ... face`` ...

Of the other commands those are followed that call a file beside this one, that fix or free blocks, give their group or
density, and that say which way gravity acts. What cuts, moves or deletes blocks, or makes them by FISH, is refused:
only 3DEC runs it. All others are counted, but for those that steer the program alone.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from blockvis.layout.layout import Layout
from blockvis.layout.left_out import passed_over
from blockvis.layout.solids import Solid, between, box, fans
from solver import mechanics
from solver.mechanics import counted

from . import meshio_files
from .bodies import Bodies, Body
from .closed_surfaces import closed_bodies
from .reading import Reading, naming

#: What tells a command file from a mesh of the same suffix.
MAKES = re.compile(r"^\s*(poly(hedron)?\s+\S|block\s+create\s)", re.IGNORECASE | re.MULTILINE)
CALLS = re.compile(r"^\s*(program\s+)?call\s+\S", re.IGNORECASE | re.MULTILINE)

#: Files that call each other deeper than this call themselves.
DEEPEST_CALL = 8

#: Commands that change blocks made before them, the first words of each.
CHANGES = (
    "jset", "joint-set", "cut", "delete", "del", "tunnel", "excavate", "remove", "densify", "move", "mirror", "rotate",
    "scale", *(f"block {word}" for word in (
        "cut", "delete", "densify", "excavate", "move", "translate", "rotate", "scale", "mirror", "transform",
    )),
)  # fmt: skip

#: Commands that make blocks from what is not in the file.
IMPORTS = ("block import", "block generate")

#: Commands that make the blocks of a range supports, or free ones again.
FIXES = {"fix": True, "block fix": True, "free": False, "block free": False}

#: Commands of two words, by the first.
LONG = ("block", "model", "program", "set", "fish")

#: Commands that say nothing of the blocks as they are made: first words of each.
STEERS = {
    "model", "program", "set", "fish", "new", "title", "heading", "config", "plot", "history", "hist", "save", "solve",
    "step", "cycle", "ret", "return", "stop", "quit", "exit", "log", "pause", "print", "list", "block history",
    "block list", "block export",
}  # fmt: skip

#: Commands that begin as those of STEERS do, and bring in what is not in the file.
BRINGS = ("model restore", "model import")

#: Words that say something of a block by the number after them.
ABOUT = ("region", "reg", "r", "mat", "material", "con", "cons", "constitutive", "join", "joint", "id")

REGION = {"reg": "region", "r": "region"}

#: Words of the shapes of blocks, before the numbers of their corners.
SHAPES = ("brick", "prism", "a", "b", "face-1", "face-2", "face")


@dataclass
class _Block:
    """A block: (n, 3) corners, faces, and what is said of it."""

    points: np.ndarray
    faces: list[list[int]]
    words: dict[str, str] = field(default_factory=dict)
    groups: list[str] = field(default_factory=list)
    fixed: bool = False
    density: float | None = None

    @property
    def middle(self) -> np.ndarray:
        """(3,) array: of the box around it."""
        return np.asarray((self.points.min(axis=0) + self.points.max(axis=0)) / 2.0)

    def is_of(self, kind: str, word: str) -> bool:
        """Whether it is of a group, or of a region."""
        return word in self.groups if kind == "group" else self.words.get("region") == word


@dataclass
class _Model:
    """What a command file has made so far."""

    blocks: list[_Block] = field(default_factory=list)
    names: dict[str, str] = field(default_factory=dict)
    up: str = "z"
    up_says: str = ""
    passed: Counter[str] = field(default_factory=Counter)


def read(path: Path, reading: Reading) -> Layout | Bodies:
    """Read the blocks of a command file; a .dat file that makes none is a mesh of Tecplot."""
    text = path.read_text(encoding="utf-8", errors="replace")
    if not MAKES.search(text) and not CALLS.search(text):
        if path.suffix.lower() == ".dat":
            return meshio_files.read(path, reading)
        raise ValueError(
            "it makes no block by 3DEC's commands (poly brick, poly prism, block create ...); give a drawing"
        )
    model = _Model()
    _run(path, text, model, 0)
    if not model.blocks:
        raise ValueError("it and the files that it calls make no block; give the file of the geometry")
    return _bodies(model)


def _run(path: Path, text: str, model: _Model, depth: int) -> None:
    """Carry out the commands of a file, and of those beside it that it calls."""
    inside_fish = False
    for line, words in _commands(text):
        small = [word.lower() for word in words]
        if small[0] in ("def", "define") or (small[0] == "fish" and small[1:2] in (["def"], ["define"])):
            inside_fish = True
        elif inside_fish and small[0] == "end":
            inside_fish = False
        elif inside_fish and MAKES.match(" ".join(words)):
            raise ValueError(f"line {line} {_by_fish(words)}")
        elif not inside_fish and (small[0] == "call" or small[:2] == ["program", "call"]):
            for word in words[1 if small[0] == "call" else 2 :]:
                _call(_plain(word), path, model, depth)
        elif not inside_fish:
            with naming(f"line {line}"):
                _follow(words, model)


def _call(name: str, path: Path, model: _Model, depth: int) -> None:
    """Carry out a file beside another; others are counted as passed over."""
    called = path.parent / name
    beside = called.resolve().is_relative_to(path.parent.resolve()) and called.is_file()
    if depth >= DEEPEST_CALL or not beside:
        model.passed[f"call '{name}'"] += 1
    else:
        with naming(f"'{called}'"):
            _run(called, called.read_text(encoding="utf-8", errors="replace"), model, depth + 1)


def _commands(text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the number of the first line of each command, and its words: quoted ones as they are."""
    start, whole = 0, ""
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.split(";")[0].rstrip()
        start = start if whole else number
        goes_on = re.search(r"(&|\.\.\.)$", line)
        whole += " " + (line[: goes_on.start()] if goes_on else line)
        if not goes_on:
            words = re.findall(r"'[^']*'|\"[^\"]*\"|\[[^\]]*\]?|[^\s(),=\[]+", whole)
            if words:
                yield start, words
            whole = ""


def _by_fish(words: Sequence[str]) -> str:
    called = " ".join(words)[:60]
    return f"makes blocks by FISH ('{called}'), which only 3DEC runs; write them with numbers, or export them from 3DEC"


def _follow(words: list[str], model: _Model) -> None:
    """Carry out one command, or count it as passed over."""
    small = [word.lower() for word in words]
    two = " ".join(small[:2])
    head = two if small[0] in LONG else small[0]
    if small[0] in ("poly", "polyhedron"):
        model.blocks.append(_made(words[1:]))
    elif two == "block create":
        model.blocks.append(_made(words[2:]))
    elif small[0] == "range" and small[1:2] == ["name"] and len(words) == 5 and small[3] == "region":
        model.names[words[4]] = _plain(words[2])
    elif head in ("gravity", "model gravity", "block gravity", "set gravity"):
        _turn(words, model)
    elif head in FIXES or head in ("block group", "block property"):
        model.passed[head] += not _says(head, words, model)
    elif two in IMPORTS:
        raise ValueError(
            f"it makes blocks ('{' '.join(words)[:60]}'), which only 3DEC does; write them by "
            "poly prism or block create, or take the line out"
        )
    elif model.blocks and (small[0] in CHANGES or two in CHANGES):
        raise ValueError(
            f"it changes the blocks ('{' '.join(words)[:60]}'), which only 3DEC does; write "
            "the blocks as they are then, by poly prism or block create"
        )
    elif head in BRINGS or not STEERS & {small[0], head}:
        model.passed["FISH" if small[0][0] in "@[" else head] += 1


def _says(head: str, words: list[str], model: _Model) -> bool:
    """Take what a command says of the blocks of a range; whether there are such blocks, and it is understood."""
    if head in FIXES:
        chosen = _in_range(words[len(head.split()) :], model)
        for block in chosen:
            block.fixed = FIXES[head]
    elif head == "block group":
        chosen = _in_range(words[5 if words[3:4] == ["slot"] else 3 :], model) if len(words) > 2 else []
        for block in chosen:
            block.groups.append(_plain(words[2]))
    else:
        density = _number(words[3]) if len(words) > 3 and words[2].lower() == "density" else None
        chosen = _in_range(words[4:], model) if density is not None else []
        for block in chosen:
            block.density = density
    return bool(chosen)


def _made(words: list[str]) -> _Block:
    lists, about = list[tuple[str, list[float]]](), dict[str, str]()
    for word in words:
        number = _number(word)
        if number is not None and lists:
            lists[-1][1].append(number)
        elif word[0] in "@[":
            raise ValueError(f"it {_by_fish(words)}")
        elif lists and lists[-1][0] == "group" and not lists[-1][1] and "group" not in about:
            about["group"] = _plain(word)
        else:
            lists.append((word.lower(), []))
    for word, numbers in lists:
        if word in ABOUT and len(numbers) == 1:
            about[REGION.get(word, word)] = f"{numbers[0]:g}"
    shapes = [(word, numbers) for word, numbers in lists if word in SHAPES]
    if not np.isfinite([number for _, numbers in shapes for number in numbers]).all():
        raise ValueError("it has a corner that is not finite; repair it")
    points, faces = _shape(shapes or lists[:1])
    return _Block(points, faces, about, [about.pop("group")] if "group" in about else [])


def _shape(shapes: list[tuple[str, list[float]]]) -> Solid:
    """Corners and faces of a block by the words of its shape, each with the numbers after it."""
    word = shapes[0][0] if shapes else ""
    if word == "brick":
        return _brick(shapes[0][1])
    if word == "prism" and len(shapes) == 3:
        return _prism(shapes[1][1], shapes[2][1])
    if word == "face":
        return _polyhedron([numbers for _, numbers in shapes])
    raise ValueError(f"it makes a block by '{word}', which is not read; write it as brick, prism or faces")


def _brick(numbers: list[float]) -> Solid:
    if len(numbers) not in (2, 4, 6):
        raise ValueError(f"brick takes x0 x1 y0 y1 z0 z1; {len(numbers)} numbers stand there")
    # The last pair holds for the directions that are not given.
    pairs = [*numbers, *numbers[-2:] * 2][:6]
    return box(pairs[::2], pairs[1::2])


def _prism(first: list[float], second: list[float]) -> Solid:
    n = len(first) // 3
    if len(first) != len(second) or len(first) % 3 or n < 3:
        raise ValueError(
            f"both faces of a prism take as many corners (x, y, z), three or more; there are "
            f"{len(first)} and {len(second)} numbers"
        )
    return between(np.reshape(first, (n, 3)), np.reshape(second, (n, 3)))


def _polyhedron(faces: list[list[float]]) -> Solid:
    wrong = next((k for k, numbers in enumerate(faces) if len(numbers) % 3 or len(numbers) < 9), None)
    if wrong is not None or len(faces) < 4:
        what = f"there are {len(faces)}" if wrong is None else f"face {wrong + 1} has {len(faces[wrong])} numbers"
        raise ValueError(f"it takes four faces or more of three corners (x, y, z) or more; {what}")
    counts = [len(numbers) // 3 for numbers in faces]
    ends = np.cumsum(counts)
    rings = [list(range(end - n, end)) for n, end in zip(counts, ends.tolist(), strict=True)]
    return np.reshape([number for numbers in faces for number in numbers], (-1, 3)), rings


def _turn(words: list[str], model: _Model) -> None:
    numbers = [number for word in words if (number := _number(word)) is not None]
    if len(numbers) == 3 and numbers[1] < 0.0 and numbers[0] == numbers[2] == 0.0:
        model.up, model.up_says = "y", "gravity acts along -y in the file"
    elif len(numbers) == 3 and any(numbers[:2]):
        model.passed["gravity that is not vertical"] += 1


def _in_range(words: list[str], model: _Model) -> list[_Block]:
    """Choose the blocks of a region or group, or those whose middle lies within limits; none of an unknown range.

    None either where blocks are hidden: commands may pass these over.
    """
    said = [word for word in words if word.lower() not in ("range", "and")]
    small, words = [*map(str.lower, said)], [*map(_plain, said)]
    regions = {name.lower(): region for region, name in model.names.items()}
    chosen, k = [] if model.passed["hide"] + model.passed["block hide"] else model.blocks, 0
    while k < len(words):
        key = small[k].removeprefix("position-").removeprefix("pos-")
        after = words[k + 1 : k + 3]
        if key in ("region", "group") and after:
            chosen, k = [block for block in chosen if block.is_of(key, after[0])], k + 2
        elif key in ("x", "y", "z") and len(after) == 2 and None not in (limits := [_number(word) for word in after]):
            low, high = (number for number in limits if number is not None)
            axis = "xyz".index(key)
            chosen, k = [block for block in chosen if low <= block.middle[axis] <= high], k + 3
        elif _plain(key) in regions:
            chosen, k = [block for block in chosen if block.is_of("region", regions[_plain(key)])], k + 1
        else:
            return []
    return chosen


def _bodies(model: _Model) -> Bodies:
    every = np.concatenate([block.points for block in model.blocks])
    size = float(np.ptp(every, axis=0).max())
    bodies: list[Body] = []
    for k, block in enumerate(model.blocks):
        part = Body(f"block {k + 1}", block.points, fans(block.faces), _said(block, model.names))
        bodies += closed_bodies(part, size)
    notes = [f"{counted(len(model.blocks), 'block')} of 3DEC; its joints, loads and steps are not read"]
    fixed = sum(block.fixed for block in model.blocks)
    notes += [f"fixed, as the file says: {fixed} of them"] if fixed else []
    notes += passed_over(model.passed, "commands that were passed over")
    return Bodies(bodies, notes=notes, up=model.up, up_says=model.up_says)


def _said(block: _Block, names: dict[str, str]) -> dict[str, Any]:
    region = block.words.get("region", "")
    group = (block.groups[-1] if block.groups else "") or names.get(region) or (f"region {region}" if region else "")
    material = block.words.get("mat") or block.words.get("material")
    row: dict[str, Any] = {"group": group}
    row |= {"material": f"mat {material}"} if material else {}
    row |= {"density": block.density} if block.density is not None else {}
    return row | ({"role": mechanics.FIXED} if block.fixed else {})


def _number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None


def _plain(word: str) -> str:
    return word.strip("'\"")
