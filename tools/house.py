"""Counts the house: lines by room, constants, public names, long and branching functions, repeated stretches.

python tools/house.py            a table in Markdown
python tools/house.py --repeats  and where stretches of lines repeat
"""

from __future__ import annotations

import argparse
import ast
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]

#: Lines, constants and public names that the third house was to have.
BUDGETS = {
    "solver": {"lines": 9500, "constants": 120, "public names": 30},
    "blockvis": {"lines": 27500, "constants": 250},
    "tests": {"lines": 16500},
}

#: Lines of a stretch that counts as repeated, and complexity above which a function is listed.
STRETCH, COMPLEX = 6, 12

#: What makes a function branch, after McCabe.
BRANCHES = (ast.If, ast.For, ast.While, ast.ExceptHandler, ast.comprehension, ast.match_case)


@dataclass(frozen=True)
class Module:
    """A parsed file.

    Attributes
    ----------
    room : str
        Package and first folder or file within it.
    path : Path
    lines : list of str
    tree : ast.Module
    """

    room: str
    path: Path
    lines: list[str]
    tree: ast.Module


def modules(package: str) -> Iterator[Module]:
    """Read the modules of a package, in their order."""
    for path in sorted((ROOT / package).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        parts = path.relative_to(ROOT).with_suffix("").parts
        room = "/".join(parts[:2]) if len(parts) > 2 else f"{package}/*.py"
        yield Module(room, path.relative_to(ROOT), text.splitlines(), ast.parse(text))


def docstring_lines(tree: ast.Module) -> set[int]:
    """Find the numbers of the lines that belong to docstrings."""
    found: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            first = node.body[0]
            found.update(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    return found


def code_lines(module: Module) -> int:
    """Count the lines that are neither empty, nor a comment, nor a docstring."""
    written = docstring_lines(module.tree)
    return sum(
        number not in written and bool(line.strip()) and not line.strip().startswith("#")
        for number, line in enumerate(module.lines, start=1)
    )


def is_number(value: ast.expr) -> bool:
    """Whether an expression is made of numbers alone."""
    leaves = [node for node in ast.walk(value) if isinstance(node, ast.Name | ast.Constant | ast.Call)]
    return bool(leaves) and all(
        isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool)
        for node in leaves
    )


def constants(tree: ast.Module) -> list[str]:
    """List the names in capitals to which the body of a module assigns numbers."""
    names = []
    for node in tree.body:
        if not isinstance(node, ast.Assign):
            continue
        for target in node.targets:
            pairs = [(target, node.value)]
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs = list(zip(target.elts, node.value.elts, strict=True))
            names += [
                part.id
                for part, value in pairs
                if isinstance(part, ast.Name) and part.id.strip("_").isupper() and is_number(value)
            ]
    return names


def complexity(function: ast.AST) -> int:
    """Count the branches of a function, and one."""
    return 1 + sum(isinstance(node, BRANCHES) for node in ast.walk(function))


def functions(module: Module) -> Iterator[tuple[str, int, int]]:
    """Give name, lines and complexity of each function."""
    for node in ast.walk(module.tree):
        if isinstance(node, ast.FunctionDef):
            yield f"{module.path}:{node.name}", (node.end_lineno or node.lineno) - node.lineno + 1, complexity(node)


def repeats(package: list[Module]) -> Counter[tuple[str, str]]:
    """Count the stretches of lines that each pair of files has in common, or a file twice."""
    places: dict[tuple[str, ...], list[str]] = defaultdict(list)
    for module in package:
        written = docstring_lines(module.tree)
        kept = [
            line.strip()
            for number, line in enumerate(module.lines, start=1)
            if number not in written and len(line.strip()) > 3 and not line.strip().startswith(("#", "import", "from"))
        ]
        for k in range(len(kept) - STRETCH + 1):
            places[tuple(kept[k : k + STRETCH])].append(str(module.path))
    pairs: Counter[tuple[str, str]] = Counter()
    for found in places.values():
        for k, first in enumerate(found):
            pairs.update((first, second) for second in found[k + 1 :])
    return pairs


def public_names(package: list[Module]) -> int | None:
    """Count the names in ``__all__`` of the package itself."""
    face = next(
        (module for module in package if module.path.name == "__init__.py" and len(module.path.parts) == 2), None
    )
    for node in [] if face is None else face.tree.body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
            return len(node.value.elts) if isinstance(node.value, ast.List) else None
    return None


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", action="store_true", help="list the pairs of files with repeated stretches")
    listed = parser.parse_args().repeats
    for name, budget in BUDGETS.items():
        package = list(modules(name))
        rooms: dict[str, list[Module]] = defaultdict(list)
        for module in package:
            rooms[module.room].append(module)
        print(
            f"\n## {name}\n\n| room | lines | without blanks, comments, docstrings | constants |\n|---|---:|---:|---:|"
        )
        for room, within in sorted(rooms.items()):
            total, code = sum(len(module.lines) for module in within), sum(map(code_lines, within))
            print(f"| {room} | {total} | {code} | {sum(len(constants(module.tree)) for module in within)} |")
        every = [function for module in package for function in functions(module)]
        shared = repeats(package)
        facts = {
            "lines": sum(len(module.lines) for module in package),
            "constants": sum(len(constants(module.tree)) for module in package),
            "public names": public_names(package),
            f"functions above complexity {COMPLEX}": sum(degree > COMPLEX for *_, degree in every),
            f"pairs of places with the same {STRETCH} lines": len(shared),
        }
        print()
        for fact, count in facts.items():
            if count is not None:
                print(f"- {fact}: {count}" + (f" (budget {budget[fact]})" if fact in budget else ""))
        longest = sorted(every, key=lambda function: -function[1])[:5]
        print("- longest functions: " + ", ".join(f"{place} {length}" for place, length, _ in longest))
        if listed:
            for (first, second), count in shared.most_common():
                print(f"  - {first}, {second}: {count}")


if __name__ == "__main__":
    main()
