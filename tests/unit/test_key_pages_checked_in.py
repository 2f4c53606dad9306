"""The pages of keys in the repository are what the code says."""

from pathlib import Path

import pytest
from key_reference import PAGES

KEYS = Path(__file__).parents[2] / "docs" / "keys"


@pytest.mark.parametrize("name", PAGES)
def test_the_page_in_the_repository_is_what_the_code_says(name):
    page = (KEYS / name).read_text(encoding="utf-8")
    assert page == PAGES[name](), "run python tools/key_reference.py docs/keys"
    assert len(page.encode()) < 60_000


def test_numbers_among_which_a_key_must_be_are_no_texts():
    """They stood in quotes, with which they are refused."""
    assert "| `depth` | 1 or -1 |" in PAGES["case_keys.md"]()
