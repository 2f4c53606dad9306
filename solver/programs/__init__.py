"""Mathematical programs, linear ones and those with round friction cones: stated, solved, checked."""

from mmap import mmap

try:
    # A library that is loaded with HiGHS asks for 256 MiB until it gets them, for ever.
    mmap(-1, 3 << 27).close()
except OSError:
    raise MemoryError("400 MB of it are not free to load the solver: raise its limit (ulimit -v)") from None
