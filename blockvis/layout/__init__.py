"""Layouts: the blocks as a drawing has them, repaired, and made an assembly of. Knows no format."""
