"""Layouts: the blocks of a drawing, repaired and assembled. This room knows no file format.

``where`` is the file, for messages.
"""
