"""Write the tables of the validation pages from the validation tests themselves: what each compares, both numbers.

``python tools/validation_tables.py FILE.md`` runs ``tests/validation`` and keeps every comparison of one number with a
reference that held. A test that fails ends it; nothing is written then.
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

TESTS = Path(__file__).resolve().parents[1] / "tests" / "validation"

#: ``0.14105 == 0.14104982 ± 1.4e-04`` as pytest explains a comparison; numpy's numbers are wrapped in their type.
_NUMBER = r"(?:np\.float64\()?(-?[\d.]+(?:e[-+]?\d+)?)\)?"
COMPARISON = re.compile(rf"^{_NUMBER} == {_NUMBER} ± (\S+)", flags=re.M)


@dataclass(frozen=True)
class Row:
    """A comparison of one number with its reference.

    Attributes
    ----------
    inputs : dict
        What the test was given, by name.
    compared : str
        The expression that was compared.
    reference, value, tolerance : float
        In the unit of the expression.
    """

    inputs: dict[str, Any]
    compared: str
    reference: float
    value: float
    tolerance: float


class Comparisons:
    """A pytest plugin that keeps the comparisons of numbers that held.

    Attributes
    ----------
    rows : dict
        Rows by (first line of the module's docstring, name of the test).
    references : dict
        Names that a test's references come from, by the same: inputs of the test that its tables need not repeat.
    """

    def __init__(self) -> None:
        self.rows: dict[tuple[str, str], list[Row]] = {}
        self.references: dict[tuple[str, str], set[str]] = {}

    def pytest_assertion_pass(self, item: Any, orig: str, expl: str) -> None:
        """Keep a comparison that pytest has found to hold."""
        found = COMPARISON.search(expl)
        if found is None:
            return
        value, reference, tolerance = (float(number) for number in found.groups())
        comparison = ast.parse(orig, mode="eval").body
        assert isinstance(comparison, ast.Compare)
        module = (item.module.__doc__ or item.module.__name__).strip().splitlines()[0]
        test = module, item.originalname.removeprefix("test_").replace("_", " ")
        names = {part.id for part in ast.walk(comparison.comparators[0]) if isinstance(part, ast.Name)}
        self.references.setdefault(test, set()).update(names)
        inputs = dict(item.callspec.params) if hasattr(item, "callspec") else {}
        row = Row(inputs, ast.unparse(comparison.left), reference, value, tolerance)
        self.rows.setdefault(test, []).append(row)


def page(found: Comparisons) -> str:
    """Make the tables in Markdown, one for each test.

    Parameters
    ----------
    found : Comparisons
    """
    lines, last = [], None
    for (module, test), rows in found.rows.items():
        if module != last:
            lines += [f"## {module.rstrip('.')}", ""]
            last = module
        lines += [f"### {test}", "", "| input | compared | reference | ours | difference | allowed |", "|---" * 6 + "|"]
        references = [row.reference for row in rows]
        for row in rows:
            known = found.references[module, test]
            given = {k: v for k, v in row.inputs.items() if k not in known and v not in references}
            lines.append(
                f"| {', '.join(f'{_words(k)} {_plain(v)}' for k, v in given.items())} | `{row.compared}` "
                f"| {row.reference:.9g} | {row.value:.9g} | {row.value - row.reference:+.1e} | {row.tolerance:.1e} |"
            )
        lines.append("")
    return "\n".join(lines)


def _words(name: str) -> str:
    return name.replace("_", " ")


def _plain(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def run_tests() -> Comparisons:
    """Run the validation tests but the slow ones and return what they compared; raise if one failed."""
    found = Comparisons()
    # Numbers are shortened in the explanations of a less talkative run.
    options = ["-vv", "-n", "0", "-m", "not slow", "-p", "no:cacheprovider", "-o", "enable_assertion_pass_hook=true"]
    if pytest.main([*options, str(TESTS)], plugins=[found]) != 0:
        raise SystemExit("a validation test failed; its table is not written")
    return found


def write(file: Path) -> None:
    """Run the tests in a process of their own and write their tables.

    Parameters
    ----------
    file : Path
    """
    with tempfile.TemporaryDirectory() as cache:
        # Compiled tests that other runs have left do not report what they compare.
        environment = {**os.environ, "PYTHONPYCACHEPREFIX": cache}
        command = [sys.executable, __file__, "--here", str(file)]
        run = subprocess.run(
            command, env=environment, capture_output=True, text=True, encoding="utf-8", errors="replace"
        )
        if run.returncode:
            raise SystemExit(f"{run.stdout}{run.stderr}")


if __name__ == "__main__":
    if sys.argv[1] == "--here":
        target = Path(sys.argv[2])
        target.write_text(page(run_tests()), encoding="utf-8")
    else:
        write(Path(sys.argv[1]))
