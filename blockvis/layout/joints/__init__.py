"""Joints of a layout: facing edges found, and moved onto their midline."""
