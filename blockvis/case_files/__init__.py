"""Case files: their keys, read and checked into a case; new ones, and their schema."""
