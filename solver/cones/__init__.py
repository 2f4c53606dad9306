"""Conic programs, with round friction cones: stated, solved and checked. Knows no masonry."""
