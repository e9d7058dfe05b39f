#!/usr/bin/env python3
"""Processor times of the stages of tests/run, compared with the table in git.

    tests/stage_times.py compare TARGET FRESH    writes TARGET/stage-times-table.tsv from TARGET/stage-times.tsv, and compares
    tests/stage_times.py update TARGET FRESH     writes tests/stage-times.tsv
    tests/stage_times.py test                    tests this script

A slower machine must not fail, so a stage is judged by its share of the sum over all stages. The share may differ from that
of the table by FACTOR in both directions; a difference below NEGLIGIBLE of the sum is no difference. Times are compared only
if FRESH is 1: in a used target folder most builds are done. A stage that is missing from the table, and one of the table
that did not run, always fail. A stage that was skipped, because a program could not be installed, is left out.
"""

import pathlib
import sys

TABLE = pathlib.Path(__file__).resolve().parent / "stage-times.tsv"
# Wide, as the table is assembled from partial runs; 2 and 0.02 hold between whole runs of one machine.
FACTOR = 4.0
NEGLIGIBLE = 0.06

HEAD = "stage\twhat\twall, s\tprocessor, s\n"


def read_run(text):
    """Returns the stages of a run: name, wall time, processor time and state by key."""
    rows = [line.split("\t") for line in text.splitlines()]
    return {key: (name, int(wall), int(used), state) for key, name, wall, used, state in rows}


def read_table(text):
    """Returns the processor time of each stage of a table."""
    rows = [line.split("\t") for line in text.splitlines()[1:]]
    return {key: int(used) for key, _, _, used in rows if key != "sum"}


def page(run):
    rows = [f"{key}\t{name}\t{wall}\t{used}" for key, (name, wall, used, _) in run.items()]
    total = f"sum\t\t{sum(row[1] for row in run.values())}\t{sum(row[2] for row in run.values())}"
    return HEAD + "\n".join([*rows, total]) + "\n"


def differences(run, table, is_fresh):
    """Returns one line for each difference."""
    found = [f"{key}: not in tests/stage-times.tsv" for key in run if key not in table]
    found += [f"{key}: in tests/stage-times.tsv, but it did not run" for key in table if key not in run]
    both = [key for key in run if key in table and run[key][3] == "ran"]
    sums = sum(run[key][2] for key in both), sum(table[key] for key in both)
    if not is_fresh or not all(sums):
        return found
    for key in both:
        share, known = run[key][2] / sums[0], table[key] / sums[1]
        if abs(share - known) > NEGLIGIBLE and not known / FACTOR <= share <= known * FACTOR:
            found.append(f"{key}: {100 * share:.1f} % of the processor time, {100 * known:.1f} % in tests/stage-times.tsv")
    return found


def test():
    run = {key: (key, used, used, "ran") for key, used in (("build", 600), ("tests", 300), ("book", 100), ("eds", 3))}
    table = read_table(page(run))
    changed = lambda **used: run | {key: (key, time, time, "ran") for key, time in used.items()}  # noqa: E731
    slower = {key: (name, 5 * wall, 5 * used, state) for key, (name, wall, used, state) in run.items()}
    skipped = run | {"book": ("book", 0, 0, "skipped")}
    less = {key: row for key, row in run.items() if key != "eds"}
    cases = {
        "equal": (differences(run, table, True), 0),
        "a slower machine": (differences(slower, table, True), 0),
        "a stage that takes longer": (differences(changed(book=900), table, True), 1),
        "a stage that takes less": (differences(changed(tests=20), table, True), 1),
        "a used target folder": (differences(changed(build=5), table, False), 0),
        "a small stage": (differences(changed(eds=12), table, True), 0),
        "a skipped stage": (differences(skipped, table, True), 0),
        "a new stage": (differences(changed(new=1), table, False), 1),
        "a stage that did not run": (differences(less, table, False), 1),
        "a run that is read": (sorted(read_run("a\tA b\t3\t2\tran\n").items()), [("a", ("A b", 3, 2, "ran"))]),
    }
    failed = 0
    for name, (found, expected) in cases.items():
        good = (found if isinstance(expected, list) else len(found)) == expected
        failed += not good
        if not good:
            print(f"FAILED {name}: {found}")
    print(f"stage_times: {len(cases) - failed} passed, {failed} failed")
    return failed > 0


def main():
    if sys.argv[1:] == ["test"]:
        return test()
    verb, target, fresh = sys.argv[1:]
    run = read_run((pathlib.Path(target) / "stage-times.tsv").read_text())
    (pathlib.Path(target) / "stage-times-table.tsv").write_text(page(run))
    if verb == "update":
        if fresh != "1":
            print("not written: the target folder was not fresh")
            return True
        TABLE.write_text(page(run))
        return False
    found = differences(run, read_table(TABLE.read_text()), fresh == "1")
    for line in found:
        print(f"FAILED {line}; tests/run --update-times writes the table")
    print(f"times: {int(not found)} passed, {int(bool(found))} failed")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
