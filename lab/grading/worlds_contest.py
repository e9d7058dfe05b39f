#!/usr/bin/env python3
"""Grades the contest (friction_diagnose::contest) on simulated worlds, and writes its evidence for a calibration.

    cargo run --release -p unkind-worlds --example write_worlds -- training 1 60 DIR
    lab/grading/worlds_contest.py PROGRAM DIR [--evidence FILE]

DIR holds pairs of NAME.csv and NAME.json. FILE becomes a table with one row for each candidate: its figures, and whether it is
in the world. A world counts as right, abstained or wrong as in contest.rs of this folder.
"""
import argparse
import collections
import json
import statistics
import subprocess
from pathlib import Path

from measured_contest import MAX_FLOORS_FOR_NONE, named

FIGURES = ["inclusion", "materiality", "alone", "last", "irreplaceable"]


def verdict(causes, floors, truth):
    """Returns right, abstained or wrong, and the first cause."""
    of_the_log = set(truth["true_of_the_log"])
    causes = [c for c in causes if c["cause"] not in of_the_log or c["cause"] == truth["cause"]]
    first = causes[0]["cause"] if causes else ("unknown" if floors > MAX_FLOORS_FOR_NONE else "none")
    if truth["cause"] == "none":
        return ("right" if first == "none" else "abstained" if not causes else "wrong"), first
    like = {first} | set(causes[0]["confusable_with"] if causes else ())
    if truth["cause"] in like or (causes and truth["cause"] == "unknown" and first == "unknown"):
        return "right", first
    if not causes:
        return ("abstained" if truth["detectable"] else "right"), first
    return "wrong", first


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--evidence", type=Path)
    options = parser.parse_args()
    counts = collections.defaultdict(collections.Counter)
    rows, seconds, clean = [], [], []
    for path in sorted(options.folder.glob("*.json")):
        truth = json.loads(path.read_text())
        command = [options.program, str(path.with_suffix(".csv"))]
        if truth["rigid_body"]:
            command += ["--rigid-body", ",".join(truth["rigid_body"])]
        run = subprocess.run(command, capture_output=True, text=True)
        if run.returncode:
            print(f"FAILED {path.stem} {run.stderr.strip()[-150:]}")
            continue
        found = json.loads(run.stdout)
        causes = named(found)
        judged, first = verdict(causes, found["floors"], truth)
        is_clean = truth["cause"] == "none"
        group = "clean" if is_clean else "detectable" if truth["detectable"] else "undetectable"
        counts[(truth["plant"], group)][judged] += 1
        seconds.append(found["seconds"]["contest"])
        for c in found["causes"]:
            real = c["cause"] == truth["cause"] or c["cause"] in truth["true_of_the_log"]
            figures = [f"{c[name]:.4f}" for name in FIGURES]
            more = [f"{found['floors']:.3f}", str(found["blocks"]), str(found["runs"]), str(len(c["confusable_with"])), str(int(c["in_best"]))]
            rows.append([path.stem, c["cause"], *figures, *more, str(int(real))])
            if is_clean and c["in_best"] and c["cause"] not in truth["true_of_the_log"]:
                clean.append((c["cause"], c["inclusion"], c["materiality"]))
        words = ", ".join(f"{c['cause']} {c['inclusion']:.2f} {c['materiality']:.2f}" for c in causes)
        print(f"{judged:9} {group:12} {truth['plant'][:14]:14} {truth['sensor']:15} {truth['cause']:22} -> {first}  [{words}] "
              f"{found['floors']:.1f} floors {seconds[-1]:.1f} s {path.stem}", flush=True)
    for key, counter in sorted(counts.items()):
        print(*key, dict(counter))
    print(f"processor mean {statistics.mean(seconds):.2f} s, most {max(seconds):.2f} s")
    print("causes in the best hypothesis of clean worlds (inclusion, materiality):")
    for cause, inclusion, materiality in sorted(clean, key=lambda c: -c[2])[:25]:
        print(f"  {cause:22} {inclusion:.2f} {materiality:.3f}")
    if options.evidence:
        head = ["world", "cause", *FIGURES, "floors", "blocks", "runs", "confusable", "in_best", "real"]
        options.evidence.write_text("\n".join("\t".join(row) for row in [head, *rows]) + "\n")


if __name__ == "__main__":
    main()
