"""Run tests file by file, each file in a process of its own: ``python tools/tests_by_file.py "MARKERS"``.

``FOLDER=MARKERS`` after it says which tests of a folder run instead.

What takes long or starts other programs runs here: a process that crashes or hangs is then named with the file it ran
and with the stacks of its threads, and costs that file alone. Where pytest's own workers share the files out, one that
dies can keep the others waiting without end.

A process that was ended by a signal or by the clock has said nothing about its tests: it is run once more, and both are
reported. Tests that fail are never run again.
"""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

#: Seconds that one file may take; the longest takes about 300 on two quiet cores, 850 on two slow and busy ones.
PATIENCE = 1500

#: Folders whose files take longest come first, and in each those of most tests: no long one is left for the end.
FOLDERS = ("tests/regression", "tests/system", "tests/validation", "tests")

#: What pytest ends with where no test is left.
NOTHING = 5


def files(markers: str) -> list[str]:
    """Find the files with tests that the markers select, those that may take long first."""
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-m", markers, *FOLDERS]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True)
    if done.returncode:
        sys.exit(f"{done.stdout}\nthe tests of '{markers}' could not be collected (exit code {done.returncode})")
    found = Counter(re.findall(r"^(\S+\.py)::", done.stdout, re.MULTILINE))
    folder = {file: next(i for i, folder in enumerate(FOLDERS) if file.startswith(folder)) for file in found}
    return sorted(found, key=lambda file: (folder[file], -found[file], file))


def once(file: str, markers: str, seconds: float) -> tuple[int, str]:
    """Run the tests of one file; return the exit code, negative where a signal ended it, and what was printed."""
    command = [sys.executable, "-X", "faulthandler", "-m", "pytest", "-q", "-m", markers, file]
    # There is a file for each core: threads of the linear algebra would wait for cores that other files have.
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    with tempfile.TemporaryFile() as printed:
        process = subprocess.Popen(
            command, stdout=printed, stderr=subprocess.STDOUT, env=environment, start_new_session=True
        )
        try:
            process.wait(seconds)
        except subprocess.TimeoutExpired:
            # It prints its stacks first.
            process.send_signal(signal.SIGABRT)
            time.sleep(2)
            printed.write(f"\nnot done after {seconds:g} s".encode())
        # What it started goes with it.
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        code = process.wait()
        printed.seek(0)
        return code, printed.read().decode(errors="replace")


def run(file: str, markers: str, seconds: float) -> bool:
    """Run the tests of one file and report them; return whether they passed."""
    for attempt in ("", ", once more"):
        before = time.monotonic()
        code, printed = once(file, markers, seconds)
        last = printed.strip().splitlines()[-1:] or [""]
        took = f"{time.monotonic() - before:.0f} s"
        if code in (0, NOTHING):
            print(f"{file}: {last[0]}{attempt}", flush=True)
            return True
        ended = f"ended by signal {-code}" if code < 0 else f"exit code {code}"
        print(f"\n{file}: {ended} after {took}{attempt}\n{printed}\n", flush=True)
        if code > 0:
            return False
    return False


def main(markers: str, instead: dict[str, str]) -> int:
    """Run what the markers select on all cores, in some folders others; return the exit code, 0 where all passed."""
    selected = files(markers)
    chosen = [instead.get(os.path.dirname(file), markers) for file in selected]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        passed = list(pool.map(lambda file, markers: run(file, markers, PATIENCE), selected, chosen))
    failed = [file for file, good in zip(selected, passed, strict=True) if not good]
    print(f"{len(selected)} files, {len(failed)} failed" + "".join(f"\n  {file}" for file in failed))
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], dict(argument.split("=") for argument in sys.argv[2:])))
