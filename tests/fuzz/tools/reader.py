"""Reads layout files one after another under limits: ``python reader.py MEMORY SECONDS FILE ...``.

A JSON line per file, written before and after: whoever started it sees which file ended the process.
"""

from __future__ import annotations

import json
import resource
import signal
import sys
import time
import traceback
import warnings
from importlib import import_module
from pathlib import Path


class TooLong(BaseException):
    """The time for one file is over."""


def main(memory: str, seconds: str, files: list[str]) -> None:
    """Reads the files; limits are in bytes of address space and seconds of processor time for each."""
    # The libraries themselves map more than a gigabyte: they are loaded before the limit is set, and not counted.
    for library in ("meshio", "pyvista", "trimesh", "ezdxf", "shapely", "scipy.spatial", "blockvis.formats.solids"):
        import_module(library)
    from blockvis import read

    with open("/proc/self/statm", encoding="ascii") as file:
        mapped = int(file.read().split()[0]) * resource.getpagesize()
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (mapped + int(memory), hard))
    warnings.simplefilter("ignore")

    def stop(*_: object) -> None:
        raise TooLong

    signal.signal(signal.SIGPROF, stop)
    for name in files:
        print(json.dumps({"file": name}), flush=True)
        said = {"file": name, "outcome": "read", "message": ""}
        started = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, float(seconds))
        try:
            said["message"] = f"{read(Path(name)).n_blocks} blocks"
        except (ValueError, OSError) as error:
            said |= {"outcome": "refused", "message": str(error)}
        except TooLong:
            said |= {"outcome": "too long", "message": f"more than {seconds} s"}
        except BaseException:
            said |= {"outcome": "traceback", "message": traceback.format_exc()}
        signal.setitimer(signal.ITIMER_PROF, 0)
        said["seconds"] = time.process_time() - started
        said["peak"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        print(json.dumps(said), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3:])
