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
