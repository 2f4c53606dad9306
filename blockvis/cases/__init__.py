"""Case files: read, checked, and built into assembly, interfaces and loads."""
