"""Linear programs: stated, solved and checked. Knows no masonry."""
