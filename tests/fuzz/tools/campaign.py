"""Thousands of random structures before the oracle: ``python tests/fuzz/tools/campaign.py --count 1000 --seed 0``.

Prints a line per trial that went wrong, and a table at the end; exits with 1 if anything went wrong. A single trial
again: ``--kind voronoi --seed 17 --count 1``.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict

from judge import Finding, tried
from rubble import KINDS


def main() -> int:
    """Runs the campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100, help="of trials of each kind")
    parser.add_argument("--seed", type=int, default=0, help="of the first trial")
    parser.add_argument("--kind", choices=sorted(KINDS), action="append")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--log", help="file for one JSON line per trial")
    options = parser.parse_args()
    kinds = options.kind or sorted(KINDS)
    work = [(kind, options.seed + k) for k in range(options.count) for kind in kinds]
    started, findings = time.perf_counter(), []
    with ProcessPoolExecutor(options.jobs) as pool:
        for finding in pool.map(tried, *zip(*work, strict=True), chunksize=4):
            findings.append(finding)
            if options.log:
                with open(options.log, "a", encoding="utf-8") as log:
                    log.write(json.dumps(asdict(finding)) + "\n")
            for wrong in finding.wrong:
                print(f"{finding.kind} {finding.seed} ({finding.outcome}): {wrong}", flush=True)
    _report(findings, time.perf_counter() - started)
    return int(any(f.wrong for f in findings))


def _report(findings: list[Finding], seconds: float) -> None:
    print(f"\n{len(findings)} structures in {seconds:.0f} s; outcomes:")
    for outcome, count in Counter(f.outcome for f in findings).most_common():
        print(f"  {outcome:24} {count:6}   {100 * count / len(findings):5.1f} %")
    checks: Counter[str] = Counter()
    for finding in findings:
        checks.update(finding.checks)
    print("checks by the oracle:")
    for what, count in checks.most_common():
        print(f"  {what:44} {count:6}")
    slowest = max(findings, key=lambda f: f.seconds)
    print(f"slowest: {slowest.kind} {slowest.seed}, {slowest.seconds:.1f} s, {slowest.blocks} blocks")
    print(f"contradicted by the oracle, or failed: {sum(bool(f.wrong) for f in findings)}")


if __name__ == "__main__":
    sys.exit(main())
