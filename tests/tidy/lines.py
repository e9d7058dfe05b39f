#!/usr/bin/env python3
"""Counts the lines of Rust that ship, and compares them with the budgets in tests/tidy/budgets.toml.

    tests/tidy/lines.py      prints budget, lines and room of each group; exits with 1 if a rule is broken

What ships is every Rust file of a package outside the folders `tests`, `examples`, `benches` and `fuzz`, without what
`#[cfg(test)]` guards: items, inline modules, and the files of `mod name;` with all files below them. Comments and blank lines
count. Packages below lab/ and tests/ evaluate what ships; they are printed without a budget.

The rules:

- Each package that ships belongs to one budget, and no budget is exceeded. A module that a feature adds to a package may have a
  budget of its own, by the path of its file without `.rs`.
- A budget that has more room than ROOM is lowered.
- A commit that raises a budget lowers others by as many lines, or its message has a line `Budget: WHAT THE USER GETS FOR IT`.
  The check compares the last commit that changed the budgets with its parent.
"""

import collections
import pathlib
import re
import subprocess
import sys
import tomllib

import rust

BUDGETS = "tests/tidy/budgets.toml"
# Greatest share of a budget that is free, and the number of lines that may be free in any case.
ROOM = 0.05
ROOM_LINES = 100
NOT_SHIPPED = re.compile(r"(^|/)(tests|examples|benches|fuzz|fuzz_targets)/")
REASON = re.compile(r"^Budget: \S", re.M)


def packages(root):
    """Returns the folders of the packages, inner ones first."""
    folders = (str(pathlib.PurePath(name).parent) for name in rust.tracked("*Cargo.toml", root))
    return sorted((folder for folder in folders if folder != "."), key=len, reverse=True)


def test_files(files):
    """Returns the files that only tests contain: those of modules behind `#[cfg(test)]`, and of the modules below these."""
    found, new = set(), [(file, False) for file in files]
    while new:
        file, is_test = new.pop()
        text, code = rust.source(file)
        spans = [(0, len(code))] if is_test else list(rust.test_spans(code))
        if is_test or spans[:1] == [(0, len(code))]:
            found.add(file)
        for attributes, name, at in rust.module_lines(text, code):
            if any(begin <= at < end for begin, end in spans):
                child = rust.module_file(file, name, attributes, is_root=file.name in ("lib.rs", "main.rs"))
                if child is not None and child not in found:
                    new.append((child, True))
    return found


def count(root=rust.ROOT, budgets=None):
    """Returns the lines that ship by the folder of the package, or by the module that has a budget of its own."""
    named = [folder for budget in (budgets or {}).values() for folder in budget["packages"]]
    folders, lines, files = packages(root), collections.Counter(), {}
    folders = [folder for folder in named if folder not in folders] + folders
    for name in rust.tracked("*.rs", root):
        folder = next((folder for folder in folders if name.startswith((folder + "/", folder + ".rs"))), "")
        if not NOT_SHIPPED.search(name.removeprefix(folder + "/")) and "/examples/" not in folder:
            files[(root / name).resolve()] = folder
    tests = test_files(files)
    for file, folder in files.items():
        if file not in tests:
            text, code = rust.source(file)
            lines[folder] += rust.shipped(code, text).count("\n")
    return lines


def is_shipped(folder):
    return not folder.startswith(("lab/", "tests/"))


def lines_of(budget, lines):
    return sum(lines.get(folder, 0) for folder in budget["packages"])


def count_violations(lines, budgets):
    """Yields each budget that is exceeded or too large, and each package without one budget."""
    uses = collections.Counter(folder for budget in budgets.values() for folder in budget["packages"])
    for folder in sorted(lines):
        if is_shipped(folder) and uses[folder] != 1:
            yield f"{folder}: {uses[folder]} budgets in {BUDGETS}, expected one"
    for name, budget in budgets.items():
        now, most = lines_of(budget, lines), budget["lines"]
        if now > most:
            yield f"{name}: {now} lines, the budget is {most}: remove lines, or see the head of {BUDGETS}"
        elif most - now > max(ROOM * most, ROOM_LINES):
            yield f"{name}: {now} lines, the budget is {most}: lower the budget to {now}"


def raise_violations(before, after, message):
    """Yields a line if the sum of the budgets rises without a reason in the commit's message."""
    rise = sum(budget["lines"] for budget in after.values()) - sum(budget["lines"] for budget in before.values())
    if rise > 0 and not REASON.search(message):
        reason = "'Budget: WHAT THE USER GETS FOR IT'"
        yield f"the last change of the budgets raises their sum by {rise} lines: its message needs a line {reason}"


def last_change(root):
    """Returns the budgets before and after the last commit that changed them, and its message; None without such a history."""

    def git(*words):
        done = subprocess.run(["git", *words], cwd=root, capture_output=True, text=True)
        return done.stdout if done.returncode == 0 else ""

    commit = git("log", "-1", "--format=%H", "--", BUDGETS).strip()
    versions = [git("show", f"{at}:{BUDGETS}") for at in (f"{commit}^", commit)] if commit else [""]
    if not all(versions):
        return None
    return *map(tomllib.loads, versions), git("log", "-1", "--format=%b", commit)


def violations(root=rust.ROOT):
    budgets = tomllib.loads((root / BUDGETS).read_text())
    yield from count_violations(count(root, budgets), budgets)
    change = last_change(root)
    if change is not None:
        yield from raise_violations(*change)


def table(lines, budgets):
    """Returns the lines of the printed table."""
    text = [f"{'budget':>8} {'lines':>8} {'room':>6}"]
    for name, budget in budgets.items():
        now = lines_of(budget, lines)
        text.append(f"{budget['lines']:8} {now:8} {budget['lines'] - now:6}  {name}: {budget['purpose']}")
    both = sum(budget["lines"] for budget in budgets.values()), sum(lines_of(budget, lines) for budget in budgets.values())
    text.append(f"{both[0]:8} {both[1]:8} {both[0] - both[1]:6}  all that ships")
    text += [f"{'':8} {value:8} {'':6}  {folder}" for folder, value in sorted(lines.items()) if not is_shipped(folder)]
    return text


if __name__ == "__main__":
    budgets = tomllib.loads((rust.ROOT / BUDGETS).read_text())
    print(*table(count(budgets=budgets), budgets), sep="\n")
    found = list(violations())
    print(*found, sep="\n")
    sys.exit(bool(found))
