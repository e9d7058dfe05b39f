#!/usr/bin/env python3
"""Counts the lines of Rust that ship, by package, and compares them with tests/tidy/lines.tsv.

    tests/tidy/lines.py             prints the table; exits with 1 if a package left its limits
    tests/tidy/lines.py --update    writes the table

What ships is every Rust file of a package outside `tests`, `examples`, `benches` and `fuzz`, without what `#[cfg(test)]` guards.
Comments and blank lines count. Packages below lab/ and tests/ evaluate what ships; they stand in the table, but not in the sum.
"""

import collections
import pathlib
import re
import subprocess
import sys

import rust

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
TABLE = pathlib.Path(__file__).resolve().parent / "lines.tsv"
# Shipped lines in all; the aim is 100,000.
MOST = 140_500
BAND = 0.05  # of a package's lines, either way; at least 100 lines
NOT_SHIPPED = re.compile(r"(^|/)(tests|examples|benches|fuzz|fuzz_targets)/")


def packages():
    names = subprocess.run(["git", "ls-files", "*Cargo.toml"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    folders = (str(pathlib.PurePath(name).parent) for name in names.split())
    return sorted((folder for folder in folders if folder != "."), key=len, reverse=True)


def count():
    folders = packages()
    names = subprocess.run(["git", "ls-files", "*.rs"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    lines = collections.Counter()
    for name in names.split():
        folder = next((folder for folder in folders if name.startswith(folder + "/")), "")
        rest = name.removeprefix(folder + "/")
        is_test_file = rest.endswith("/tests.rs") or rest.endswith("/fixtures.rs")
        if NOT_SHIPPED.search(rest) or is_test_file or "/examples/" in folder:
            continue
        text, code = rust.source(ROOT / name)
        lines[folder] += rust.shipped(code, text).count("\n")
    return lines


def is_shipped(folder):
    return not folder.startswith(("lab/", "tests/"))


def shipped_sum(lines):
    return sum(value for folder, value in lines.items() if is_shipped(folder))


def table(lines):
    text = ["package\tlines\tships"]
    for folder, value in sorted(lines.items(), key=lambda row: -row[1]):
        text.append(f"{folder}\t{value}\t{'yes' if is_shipped(folder) else 'no'}")
    return "\n".join(text) + "\n"


def violations():
    """Yields each package outside its limits, and the sum if it is too large."""
    lines = count()
    stored = dict(re.findall(r"^(\S+)\t(\d+)\t", TABLE.read_text(), re.M)) if TABLE.exists() else {}
    for folder in sorted(lines.keys() | stored.keys()):
        now, before = lines.get(folder, 0), int(stored.get(folder, 0))
        if abs(now - before) > max(BAND * before, 100):
            yield f"{folder}:1: {now} lines, {before} in {TABLE.name}: tests/tidy/lines.py --update"
    if shipped_sum(lines) > MOST:
        yield f"{shipped_sum(lines)} lines ship, at most {MOST} should"


if __name__ == "__main__":
    if sys.argv[1:] == ["--update"]:
        TABLE.write_text(table(count()))
    else:
        print(table(count()))
        print(f"{shipped_sum(count())} lines ship, at most {MOST} should; the aim is 100000")
        found = list(violations())
        print(*found, sep="\n")
        sys.exit(bool(found))
