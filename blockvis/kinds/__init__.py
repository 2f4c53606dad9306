"""Kinds of analysis: their keys, how they start, and the words of what came out."""
