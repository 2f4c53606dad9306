"""The suffixes of the videos that blockvis writes, for the case file that names one and the pictures that write it."""

VIDEO_SUFFIXES = (".mp4", ".gif", ".webp")
