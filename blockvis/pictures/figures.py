"""Figures of matplotlib, in which a name is text whatever it holds."""

from __future__ import annotations

from matplotlib import rc_context

#: Decorates what draws a figure: between two signs "$" its text is no formula, as a name with prices is none.
plain_text = rc_context({"text.parse_math": False})
