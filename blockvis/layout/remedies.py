"""What to leave out of a drawing whose blocks overlap: the smallest set with a name, tried before it is proposed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence

from .inspect import inspected
from .layout import Layout
from .left_out import matches

#: What is left out is less than this part of the blocks: else it is the others that are the drawing.
LESS = 0.5

#: Proposals that are tried, the smallest first.
TRIES = 4

#: Blocks that are named one by one where their names do not begin alike.
NAMED = 6

#: Drawings of more blocks, or pairs that overlap, are not read again.
MOST = 20_000


def proposed_ignore(
    layout: Layout, pairs: Sequence[tuple[int, int]], read_without: Callable[[Sequence[str]], Layout]
) -> str:
    """Propose what to leave out so that no blocks overlap, by the pairs that do; "" where no small set has a name.

    ``read_without`` reads the same drawing without what patterns name.
    """
    if not pairs or max(len(pairs), layout.n_blocks) > MOST:
        return ""
    known: dict[tuple[str, ...], set[int]] = {}
    for patterns, blocks in _candidates(layout, pairs):
        covers = all(i in blocks or j in blocks for i, j in pairs)
        if covers and len(blocks) < LESS * layout.n_blocks:
            known.setdefault(patterns, blocks)
    concerned = {block for pair in pairs for block in pair}

    def rank(item: tuple[tuple[str, ...], set[int]]) -> tuple[bool, int]:
        """First what one word names, if all of it overlaps: of windows drawn as frames and panes, the layer of both."""
        return len(item[0]) > 1 or not item[1] <= concerned, len(item[1])

    for patterns, blocks in sorted(known.items(), key=rank)[:TRIES]:
        try:
            without = read_without(patterns)
            too_few = without.n_blocks < (1.0 - LESS) * layout.n_blocks
            if too_few or (found := inspected(without)).refused or found.deep:
                continue
        except ValueError:
            continue
        options = " ".join(f'--ignore "{pattern}"' for pattern in patterns)
        listed = ", ".join(f'"{pattern}"' for pattern in patterns)
        return (
            f"{options} leaves out {len(blocks)} of {layout.n_blocks} blocks, and then none overlap (tried; in a case "
            f"ignore = [{listed}])"
        )
    return ""


def _candidates(layout: Layout, pairs: Sequence[tuple[int, int]]) -> Iterator[tuple[tuple[str, ...], set[int]]]:
    """Names of sets of blocks, and their numbers: layers, materials, kinds and colours, names and how they begin."""
    concerned = sorted({block for pair in pairs for block in pair})
    for labels in ([(word,) for word in layout.groups], [(word,) for word in layout.materials], layout.looks):
        for word in dict.fromkeys(word for i in concerned for word in labels[i] if word):
            yield (word,), {i for i, own in enumerate(labels) if word in own}
    yield from _by_name(layout, _cover(pairs))


def _by_name(layout: Layout, cover: Sequence[int]) -> Iterator[tuple[tuple[str, ...], set[int]]]:
    """How the names of some blocks begin, or these names themselves, and the numbers of all that have them."""
    names = [layout.names[i] for i in cover]
    # What the first and the last have in common, all between them have.
    same = [a == b for a, b in zip(min(names), max(names), strict=False)]
    begins = min(names)[: [*same, False].index(False)]
    if begins and len(cover) > 1:
        yield (f"{begins}*",), {i for i, name in enumerate(layout.names) if matches([name], [f"{begins}*"])}
    if len(cover) <= NAMED:
        yield tuple(dict.fromkeys(names)), {i for i, name in enumerate(layout.names) if name in names}


def _cover(pairs: Sequence[tuple[int, int]]) -> list[int]:
    """Blocks of which every pair has one: again and again the one with most overlaps that are left."""
    left, cover = list(pairs), []
    while left:
        block = Counter(block for pair in left for block in pair).most_common(1)[0][0]
        cover.append(block)
        left = [pair for pair in left if block not in pair]
    return sorted(cover)
