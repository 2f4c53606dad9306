"""The README is short, and what it and CONTRIBUTING name is there; `test_pages.py` runs its blocks."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_readme_is_short_and_its_links_lead_somewhere():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 130
    for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        for target in re.findall(r"\]\((?!https?:|<)([^)#]+)\)", page.read_text(encoding="utf-8")):
            file = target.replace("_static/assets", "../assets")
            assert (page.parent / file).exists(), f"{page.name}: {target}"


def test_references_of_the_readme_are_those_of_validation_tests():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    rows = [
        row.split("|") for row in text.split("| reference | ours |")[1].split("##")[0].splitlines()[2:] if "|" in row
    ]
    assert len(rows) == 10
    tests = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests" / "validation").glob("*.py"))
    #: Of formulas: arctan 1/2, sin(arctan 0.2), 2(√1.25 − 1).
    formulas = {"0.4636476": "np.arctan", "0.1961161": "np.sin(np.arctan(0.2))", "0.2360680": "np.hypot(1.0, height)"}
    for row in rows:
        reference = row[3].strip()
        written = formulas.get(reference, reference).rstrip("0") if reference[0] == "0" else reference
        assert formulas.get(reference, written) in tests, reference


def test_files_and_rooms_that_contributing_names_exist():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = [name for name in re.findall(r"`([\w./]+)`", text) if "/" in name or name.endswith(".py")]
    there = {
        f"/{path.relative_to(ROOT).as_posix()}"
        for top in ("solver", "blockvis", "tests", "docs", "tools")
        for path in (ROOT / top).rglob("*")
    }
    there |= {"/solver", "/blockvis", "/docs", "/.ci/run"}
    assert len(named) > 10
    assert [name for name in named if not any(path.endswith(f"/{name.strip('/')}") for path in there)] == []
