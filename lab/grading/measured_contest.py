#!/usr/bin/env python3
"""Grades the contest (friction_diagnose::contest) on the measured logs, beside the plain regression.

    cargo build --release -p friction-diagnose --example contest
    lab/grading/measured_contest.py PROGRAM ../shared/data [--regression FILE] [--details] [--only TEXT]

PROGRAM is the built example. FILE holds the printed lines of prototypes/regression.py, whose base error and gain give its
held-out error. Of all programs only this one reads right-answers.json. The page of the data states the answers of three more.
"""
import argparse
import json
import re
import subprocess
from pathlib import Path

EMPS = {
    "accept": ["direction-asymmetry"],
    "never": ["none"],
    "args": [
        "--columns",
        "time_s=t_s,position_m=q_m,force_n=motor_force_N,velocity_m_s=vel_m_per_s,acceleration_m_s2=acc_m_per_s2",
        "--rigid-body", "inertia,offset", "--skip", "49", "--decimate", "10",
    ],
}
MORE = {
    "emps-train.csv": EMPS,
    "emps-pulses.csv": EMPS,
    "servo-pendulum.csv": {
        "accept": ["load-torque-coulomb"],
        "never": ["none"],
        "args": ["--columns", "torque_nm=drive_voltage_v", "--rigid-body", "load,offset"],
    },
}

MIN_INCLUSION = 0.5
MIN_MATERIALITY = 0.04
MAX_FLOORS_FOR_NONE = 2.5


def named(found):
    """Returns the causes that the figures would name, strongest first."""
    kept = [
        c for c in found["causes"]
        if c["inclusion"] >= MIN_INCLUSION and c["materiality"] >= MIN_MATERIALITY
    ]
    return sorted(kept, key=lambda c: -c["materiality"])


def is_right(first, also, truth):
    """Returns whether the first cause is accepted, none is forbidden and all that must be named are."""
    never = set(truth.get("never", []))
    is_any = "*" in never and also
    return first in truth["accept"] and not also & never and not is_any and set(truth.get("all", [])) <= also


def rival_errors(path):
    """Returns the held-out error of the regression for each log, from its printed lines."""
    errors = {}
    for line in Path(path).read_text().splitlines() if path else []:
        match = re.match(r"(?:ok  |MISS) (\S+) .*gain=(\S+) base=(\S+)", line)
        if match:
            errors[match[1]] = (1 - float(match[2])) * float(match[3])
    return errors


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--regression")
    parser.add_argument("--details", action="store_true")
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    truths = json.loads((options.folder / "right-answers.json").read_text()) | MORE
    rivals = rival_errors(options.regression)
    right = no_worse = compared = 0
    seconds = []
    logs = [name for name in sorted(truths) if options.only in name and (options.folder / name).exists()]
    print("| log | first cause | named (inclusion, materiality) | base | left | regression | floors | read s | s |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in logs:
        truth = truths[name]
        command = [options.program, str(options.folder / name), *truth.get("args", [])]
        run = subprocess.run(command, capture_output=True, text=True)
        if run.returncode:
            print(f"| {name} | FAILED {run.stderr.strip()[-200:]} |")
            continue
        found = json.loads(run.stdout)
        causes = named(found)
        first = causes[0]["cause"] if causes else ("unknown" if found["floors"] > MAX_FLOORS_FOR_NONE else "none")
        ok = is_right(first, {c["cause"] for c in causes}, truth)
        right += ok
        rival = rivals.get(name)
        worse = ""
        if rival is not None:
            compared += 1
            no_worse += found["rmse"] <= rival * 1.0005
            worse = "" if found["rmse"] <= rival * 1.0005 else " **worse**"
        seconds.append(found["seconds"]["contest"])
        words = ", ".join(
            f"{c['cause']}{'(' + c['follows'] + ')' if c['follows'] else ''} {c['inclusion']:.2f} {c['materiality']:.2f}"
            for c in causes
        )
        print(
            f"| {name} | {'' if ok else '**not** '}{first} | {words} | {found['base_rmse']:.4g} | {found['rmse']:.4g}{worse} | "
            f"{'-' if rival is None else format(rival, '.4g')} | {found['floors']:.1f} | {found['seconds']['read']:.2f} | "
            f"{seconds[-1]:.2f} |",
            flush=True,
        )
        if options.details:
            print(f"    {found['law']}, {found['correction']}, {found['hypotheses']} hypotheses, {found['runs']} runs")
            for c in found["causes"]:
                mark = "*" if c["in_best"] else " "
                print(
                    f"   {mark} {c['cause']:22} {c['follows'][:22]:22} {c['inclusion']:.2f} alone {c['alone']:.3f} last {c['last']:.3f} "
                    f"irr {c['irreplaceable']:.3f} {c['detail'][:50]} ~ {','.join(c['confusable_with'])}"
                )
    print(f"\nright {right} of {len(logs)}; held-out error no worse than the regression's on {no_worse} of {compared}; "
          f"processor mean {sum(seconds) / max(1, len(seconds)):.2f} s, most {max(seconds, default=0):.2f} s")


if __name__ == "__main__":
    main()
