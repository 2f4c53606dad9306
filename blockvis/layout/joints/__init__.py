"""Joints of a layout: facing edges found, and moved onto their midline.

Outlines are (n, 2) arrays [m], counter-clockwise. ``anchored`` and ``laid`` are (n_blocks,) bool arrays: blocks that
keep their outline, and blocks between which a gap is no joint.
"""
