#!/usr/bin/env python3
"""Finds circles between the files of each crate.

    tests/tidy/circles.py      prints each circle with the names that tie it, and exits with 1 if there is one

A file depends on another if a path in it (`crate::a::b::Name`, `super::`, `self::`, a child module, or a name imported from
there) resolves to an item of that file. Re-exports are followed to the file that defines the item, or out of the crate. A file
that only re-exports a name does not depend on it.

A circle is a set of files that reach each other without the module that contains them all. `super::Name` in a child and
`child::Name` in its parent are therefore no circle: every way between the two leads over the parent. Two children that reach
each other without their parent are a circle, and so are a module and a module outside of it, even if the way between them leads
over children. To find them, the check leaves out each module in turn with everything outside of it, and looks for strongly
connected components among the modules below it that lie below more than one of its children.

Tests (`#[cfg(test)]` and the folders `tests`, `examples`, `benches`) are left out.
"""

import re
import sys

import rust


def dependencies(crate):
    """Returns the files of a crate as {module: {module: names}}."""
    graph = {module: {} for module in crate.modules}
    for module in crate.modules:
        words = set(re.findall(r"\w+", module.body))
        used = [parts for parts, name, is_public in module.uses if not is_public or name in words]
        for parts in used + module.paths:
            target = crate.resolve(module, tuple(part for part in parts if part != "*"))
            if target is not None and target is not module:
                graph[module].setdefault(target, set()).add(parts[-1])
    return graph


def components(graph):
    """Returns the strongly connected components of more than one node of {node: nodes} (Tarjan)."""
    index, low, stack, found = {}, {}, {}, []

    def visit(node):
        index[node] = low[node] = len(index)
        stack[node] = True
        for target in graph[node]:
            if target not in index:
                visit(target)
                low[node] = min(low[node], low[target])
            elif target in stack:
                low[node] = min(low[node], index[target])
        if low[node] == index[node]:
            part = []
            while node in stack:
                part.append(stack.popitem()[0])
            if len(part) > 1:
                found.append(part)

    for node in graph:
        if node not in index:
            visit(node)
    return found


def circles(crate):
    """Returns each circle of a crate as {module: {module: names}}."""
    graph = dependencies(crate)
    found = []
    for parent in crate.modules:
        depth = len(parent.path)
        below = [module for module in crate.modules if len(module.path) > depth and module.path[:depth] == parent.path]
        inner = {module: [target for target in graph[module] if target in below] for module in below}
        for part in components(inner):
            if len({module.path[depth] for module in part}) > 1:
                found.append({m: {to: names for to, names in graph[m].items() if to in part} for m in reversed(part)})
    return found


def all_circles(root=rust.ROOT):
    """Yields each circle of the repository as lines of text."""
    for _, crate in rust.crates(root):
        for circle in circles(crate):
            first = next(iter(circle)).file.relative_to(root)
            lines = [f"{first}:1: a circle of {len(circle)} files"]
            for module, targets in circle.items():
                for target, names in targets.items():
                    names = ", ".join(sorted(names))
                    lines.append(f"    {module.file.relative_to(root)} -> {target.file.relative_to(root)}: {names}")
            yield lines


if __name__ == "__main__":
    sys.setrecursionlimit(10_000)
    count = 0
    for circle in all_circles():
        count += 1
        print("\n".join(circle))
    print(f"circles: {count}")
    sys.exit(count > 0)
