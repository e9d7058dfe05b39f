#!/usr/bin/env python3
"""Finds circles of calls between the files of one type, and compares them with tests/tidy/method_circles.toml.

    tests/tidy/method_circles.py      prints each type with a circle; exits with 1 if one left its limits

The methods of a type may stand in several files. Each file sees all of them without an import, so circles.py cannot see these
ties. A file depends on another if a method in it calls `self.name(..)`, `Self::name` or `Type::name` of the same type and the other
file defines `name`. The figure of a type is the number of files in its largest circle: those in which each reaches the others.

The figure may only fall, and so may the number of methods where it has a limit. A limit that is more than ROOM above the true
value fails too, so that the limits follow downwards. A circle of a type without limits fails: no new one may form. Methods of
traits, of macros and of tests do not count.
"""

import collections
import pathlib
import re
import sys
import tomllib

import rust
from circles import components

LIMITS = pathlib.Path(__file__).resolve().parent / "method_circles.toml"
# How far a limit may stand above the true value.
ROOM = {"files": 2, "methods": 8}
METHOD = re.compile(r"\bfn\s+(\w+)")
IMPL = re.compile(r"\bimpl\b")


def after_generics(code, at):
    """Returns the position behind `<...>` at `at`, or `at` if there is none."""
    begin = re.compile(r"\s*<").match(code, at)
    if not begin:
        return at
    depth = 0
    for match in re.compile(r"->|[<>]").finditer(code, begin.end() - 1):
        depth += {"<": 1, ">": -1}.get(match.group(), 0)
        if depth == 0:
            return match.end()
    return at


def inherent_impls(code):
    """Yields the type's path, and begin and end of the body, of each `impl` block without a trait."""
    for match in IMPL.finditer(code):
        before = code[: match.start()].rstrip()
        if before and before[-1] not in "};]{" and not before.endswith("unsafe"):
            continue  # `impl Trait` as a type.
        begin = code.find("{", match.end())
        head = re.split(r"\bwhere\b", code[after_generics(code, match.end()) : begin])[0]
        path = re.match(r"\s*((?:\w+\s*::\s*)*\w+)", head)
        if path and not re.search(r"\bfor\b(?!\s*<)", head):
            yield tuple(re.split(r"\s*::\s*", path.group(1))), begin, rust.end_of_block(code, begin)


def methods(code, begin, end):
    """Yields the name and body of each function of an `impl` block."""
    at = begin + 1
    while match := METHOD.search(code, at, end):
        body = code.find("{", match.end(), end)
        at = rust.end_of_block(code, body)
        yield match.group(1), code[body:at]


def calls(body, type_name):
    """Returns the names that a body calls on its own type."""
    own = rf"\bself\s*\.\s*(\w+)\s*(?:::\s*<[^()]*>\s*)?\(|\b(?:Self|{type_name})\s*::\s*(\w+)"
    return {match.group(1) or match.group(2) for match in re.finditer(own, body)}


def types(crate):
    """Returns {(module, type): {file: {method: calls}}} of the types whose methods stand in more than one file."""
    found = collections.defaultdict(lambda: collections.defaultdict(dict))
    for module in crate.modules:
        for path, begin, end in inherent_impls(module.code):
            owner = crate.resolve(module, path)
            for name, body in methods(module.code, begin, end) if owner else ():
                found[owner, path[-1]][module][name] = calls(body, path[-1])
    return {owner: files for owner, files in found.items() if len(files) > 1}


def figures(crate):
    """Returns {name of a type: its largest circle of files and its methods}, for types that have a circle."""
    found = {}
    for (owner, name), files in types(crate).items():
        file_of = {method: file for file, own in files.items() for method in own}
        graph = {
            file: {file_of[called] for names in own.values() for called in names if called in file_of}
            for file, own in files.items()
        }
        largest = max(components(graph), key=len, default=[])
        if largest:
            found["::".join((*owner.path, name))] = {"files": len(largest), "methods": sum(map(len, files.values()))}
    return found


def all_figures(root=rust.ROOT):
    """Returns the figures of the repository, with the folder of the package before the name of each type."""
    found = {}
    for file, crate in rust.crates(root):
        package = file.relative_to(root).as_posix().split("/src/")[0]
        for name, values in figures(crate).items():
            found.setdefault(f"{package}: {name}", values)
    return found


def violations(found, limits):
    """Yields each type whose figures left their limits."""
    for name in sorted(found.keys() | limits.keys()):
        now, limit = found.get(name), limits.get(name)
        if now is None:
            yield f"{name} has no circle of files: remove it from {LIMITS.name}"
        elif limit is None:
            yield f"{name}: calls between its methods form a circle of {now['files']} files, expected none"
        else:
            for what, most in limit.items():
                if now[what] > most:
                    yield f"{name}: {now[what]} {what}, expected at most {most}: give the method to a part of the type"
                elif now[what] < most - ROOM[what]:
                    yield f"{name}: {now[what]} {what}, at most {most} are allowed: lower the limit to {now[what]}"


def all_violations():
    return list(violations(all_figures(), tomllib.loads(LIMITS.read_text())))


if __name__ == "__main__":
    sys.setrecursionlimit(10_000)
    current = all_figures()
    for name, values in sorted(current.items(), key=lambda row: -row[1]["files"]):
        print(f'"{name}" = {{ files = {values["files"]}, methods = {values["methods"]} }}')
    wrong = list(violations(current, tomllib.loads(LIMITS.read_text())))
    print(*wrong, sep="\n")
    sys.exit(bool(wrong))
