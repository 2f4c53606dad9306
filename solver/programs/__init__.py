"""Mathematical programs, linear ones and those with round friction cones: stated, solved, checked."""
