"""Text that people read: numbers with their units, values as TOML writes them, and names similar to a given one."""

from __future__ import annotations

import difflib
import math
import re
import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

#: What stands before a unit of force, and from which number on.
PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""))

#: No length, force or stiffness is smaller or larger; products of some of them still fit a double.
SMALLEST, LARGEST = 1e-30, 1e30


def refuse_magnitude(value: float) -> str:
    """Say what to give instead of a number that is finite, but smaller or larger than something real; else "".

    Examples
    --------
    >>> refuse_magnitude(1e200), refuse_magnitude(0.0)
    ('give a number of 1e-30 to 1e+30', '')
    """
    # Neither NaN nor infinity is out of range: that they are no finite numbers is said elsewhere.
    out = 0 < abs(value) < SMALLEST or LARGEST < abs(value) < math.inf
    return f"give a number of {SMALLEST:g} to {LARGEST:g}" if out else ""


@contextmanager
def beginning(where: str) -> Iterator[None]:
    """Let what is refused, a ValueError, begin with where that is."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{where} {error}") from None


def listed(words: Sequence[str], most: int = 6) -> str:
    """List words, and count those beyond the first few.

    Examples
    --------
    >>> listed(["'a'", "'b'", "'c'"], 2)
    "'a', 'b' and 1 more"
    """
    return ", ".join(words[:most]) + (f" and {len(words) - most} more" if len(words) > most else "")


def numbered(words: Sequence[str], sign: str = " ") -> list[str]:
    """Put their numbers behind words that are there several times.

    Examples
    --------
    >>> numbered(["pier", "arch", "pier"])
    ['pier 1', 'arch', 'pier 2']
    """
    total, seen = Counter(words), Counter[str]()
    found = []
    for word in words:
        seen[word] += 1
        found.append(f"{word}{sign}{seen[word]}" if total[word] > 1 else word)
    return found


def place_text(place: Iterable[float], digits: int = 4) -> str:
    """Write a place.

    Examples
    --------
    >>> place_text((0.12345, 2.0))
    '(0.1235, 2)'
    >>> place_text((1.24e-16, -1e-12))
    '(0, 0)'
    """
    # A place at 0 would be said with the digits of its rounding.
    return f"({', '.join(f'{round(value, 9) + 0.0:.{digits}g}' for value in place)})"


def width_text(width: float) -> str:
    """Write the width of a crack [m] in mm: three digits, and no decimals from 10 mm on.

    Examples
    --------
    >>> width_text(0.00012), width_text(0.0034567), width_text(0.01234), width_text(1.234)
    ('0.12 mm', '3.46 mm', '12 mm', '1230 mm')
    """
    digits = float(f"{1e3 * width:.3g}")
    return f"{digits:.0f} mm" if digits >= 10.0 else f"{digits:g} mm"


def force_text(force: float, moment: bool = False, *, padded: bool = False) -> str:
    """Write a force [N], or a moment [N·m], with four digits and the unit that suits it.

    In captions of films zeros at the end are ``padded``: words that stand behind would jump from frame to frame.

    Examples
    --------
    >>> force_text(2211.97), force_text(152.3), force_text(3.21e6, moment=True)
    ('2.212 kN', '152.3 N', '3.21 MN·m')
    """
    factor, prefix = _prefix(force)
    return f"{_digits(force / factor, 4, padded)} {prefix}N" + ("·m" if moment else "")


def quantity_text(value: float, unit: str = "") -> str:
    """Write a number with its unit, with k, M or G before one of force.

    Examples
    --------
    >>> quantity_text(2.1e11, "Pa"), quantity_text(18000.0, "N/m³"), quantity_text(2000.0, "kg/m³")
    ('210 GPa', '18 kN/m³', '2000 kg/m³')
    >>> quantity_text(1.5), quantity_text(5e7)
    ('1.5', '5e7')
    """
    if unit.startswith(("N", "Pa")):
        factor, prefix = _prefix(value)
        value, unit = value / factor, prefix + unit
    digits = re.sub(r"e([+-])0*", lambda found: "e" + found[1].strip("+"), f"{value:.6g}")
    return f"{digits} {unit}".strip()


def padded_text(value: float, digits: int) -> str:
    """Write a number with so many digits, zeros at the end included.

    Examples
    --------
    >>> padded_text(0.3598, 5), padded_text(1053.0, 4)
    ('0.35980', '1053')
    """
    return _digits(value, digits, True)


def rounded_text(value: float) -> str:
    """Write a number with three digits, without a power of ten below a million.

    Examples
    --------
    >>> rounded_text(3000.0), rounded_text(0.61234), rounded_text(2.1e11)
    ('3000', '0.612', '2.1e+11')
    """
    return f"{float(f'{value:.3g}'):g}"


def _prefix(value: float) -> tuple[float, str]:
    """Choose what stands before the unit of a number, and by what it is divided then."""
    return next((factor, prefix) for factor, prefix in PREFIXES if abs(value) >= factor or factor == 1.0)


def _digits(value: float, digits: int, padded: bool) -> str:
    return f"{value:#.{digits}g}".rstrip(".") if padded and value else f"{value:.{digits}g}"


def rounded_length(largest: float) -> float:
    """Round down to 1, 2 or 5 times a power of ten; 1 unless the length is positive and finite.

    Examples
    --------
    >>> rounded_length(0.34)
    0.2
    """
    if not (math.isfinite(largest) and largest > 0.0):
        return 1.0
    power = 10.0 ** math.floor(math.log10(largest))
    return float(f"{max(m for m in (1.0, 2.0, 5.0) if m * power <= largest * (1 + 1e-9)) * power:.6g}")


def bar_text(length: float) -> str:
    """Write the length of a scale bar [m]: below 0.1 m in mm.

    Examples
    --------
    >>> bar_text(0.1), bar_text(0.02)
    ('0.1 m', '20 mm')
    """
    return f"{length:g} m" if length >= 0.1 else f"{1e3 * length:g} mm"


def as_toml(value: Any) -> str:
    r"""Write a value as TOML has it; numbers with twelve digits, which leaves out the rounding of converted lengths.

    Examples
    --------
    >>> print(as_toml({"x": 0.1 + 0.2, "names": ["a", 'b "c"'], "film": False}))
    {x = 0.3, names = ["a", "b \"c\""], film = false}
    """
    import tomlkit

    return tomlkit.item(_inline(value)).as_string()


def as_key(key: str) -> str:
    """Write a key as TOML has it, in quotes where it needs them.

    Examples
    --------
    >>> as_key("limit"), as_key("left springer")
    ('limit', '"left springer"')
    """
    import tomlkit

    return tomlkit.key(key).as_string()


def _inline(value: Any) -> Any:
    import tomlkit

    if isinstance(value, Mapping):
        table = tomlkit.inline_table()
        table.update({key: _inline(one) for key, one in value.items()})
        return table
    if isinstance(value, list | tuple):
        return [_inline(one) for one in value]
    return float(f"{value:.12g}") if isinstance(value, float) else value


def nearest(word: str, known: Sequence[str], likeness: float = 0.5) -> str:
    """Write a hint at the known word most similar to the given one.

    Returns
    -------
    str
        Empty if no known word is similar, by a likeness of 0 to 1.

    Examples
    --------
    >>> nearest("thikness", ["density", "thickness"])
    " (did you mean 'thickness'?)"
    >>> nearest("frction", ["cohesion", "friction_coefficient"])
    " (did you mean 'friction_coefficient'?)"
    """
    # A word of a longer name counts as much as the name: who writes "frction" means friction_coefficient.
    whole = {part: name for name in reversed(known) for part in name.split("_")} | {name: name for name in known}
    near = difflib.get_close_matches(word, list(whole), n=1, cutoff=likeness)
    return f" (did you mean '{whole[near[0]]}'?)" if near else ""


def by_similarity(word: str, known: Iterable[str]) -> list[str]:
    """Order known words by similarity to the given one, upper and lower case alike, the most similar first."""
    likeness = {name: difflib.SequenceMatcher(None, word.lower(), name.lower()).ratio() for name in known}
    return sorted(likeness, key=lambda name: -likeness[name])


def files_like(path: Path, pattern: str = "*", *, or_any: bool = False) -> list[str]:
    """Find up to three names similar to that of a missing file, among those of its folder that fit a pattern of glob.

    ``or_any`` returns less similar names, or any, if none is similar.
    """
    beside = sorted(entry.name for entry in path.parent.glob(pattern)) if path.parent.is_dir() else []
    near = difflib.get_close_matches(path.name, beside, n=3, cutoff=0.4 if or_any else 0.6)
    return near or (beside[:3] if or_any else [])


def resume_command(folder: str | Path) -> str:
    """Write the command by which a run goes on, as a shell takes it.

    Examples
    --------
    >>> resume_command("bridge 2")
    "blockvis run --resume 'bridge 2'"
    """
    return shlex.join(["blockvis", "run", "--resume", str(folder)])


def refuse_unknown(given: Iterable[str], known: Sequence[str], where: str) -> None:
    """Raise ``ValueError`` for the first given key that is not known."""
    for key in given:
        if key not in known:
            raise ValueError(f"{where} has no '{key}'{nearest(str(key), known)}; it has {', '.join(known)}")
