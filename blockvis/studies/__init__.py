"""Studies: many runs of one case, because friction, joints and geometry of old masonry are uncertain."""
