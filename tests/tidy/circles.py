#!/usr/bin/env python3
"""Finds circles between the files of each crate.

    tests/tidy/circles.py      prints each circle with the names that tie it, and exits with 1 if there is one

A file depends on another if a path in it (`crate::a::b::Name`, `super::`, `self::`, a child module, or a name imported from
there) resolves to an item of that file. Re-exports are followed to the file that defines the item. Two files form a circle if
each reaches the other. A circle of one module and modules below it is left out, because `mod` ties them in any case.
Tests (`#[cfg(test)]` and the folders `tests`, `examples`, `benches`) are left out too.
"""

import pathlib
import re
import subprocess
import sys
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
COMMENT_OR_TEXT = re.compile(
    r"//[^\n]*|/\*.*?\*/|b?r(#*)\".*?\"\1|b?\"(?:\\.|[^\"\\])*\"|b?'(?:\\.[^']*|[^'\\\n])'", re.S
)
MODULE = re.compile(r"((?:#\[[^\]]*\]\s*)*)(?:pub(?:\([^)]*\))?\s+)?mod\s+(\w+)\s*;")
USE = re.compile(r"(pub(?:\([^)]*\))?\s+)?\buse\s+([^;]+);")
PATH = re.compile(r"\b(?:r#)?[A-Za-z_]\w*(?:\s*::\s*(?:r#)?[A-Za-z_]\w*)+")
ITEM = re.compile(r"\b(?:fn|struct|enum|union|trait|type|const|static|macro_rules!|mod)\s+(?:mut\s+)?(\w+)")
MAX_REEXPORTS = 12


def without_tests(text):
    """Removes items behind `#[cfg(test)]` and the bodies of inline test modules."""
    out, at = [], 0
    for match in re.finditer(r"#\[cfg\((?:all\()?test\b[^\]]*\]", text):
        if match.start() < at:
            continue
        out.append(text[at : match.start()])
        end, depth = match.end(), 0
        while end < len(text):
            if text[end] == "{":
                depth += 1
            elif text[end] == "}":
                depth -= 1
                if depth == 0:
                    end += 1
                    break
            elif text[end] == ";" and depth == 0:
                end += 1
                break
            end += 1
        at = end
    out.append(text[at:])
    return "".join(out)


def use_leaves(tree, prefix=()):
    """Yields (path, name) for each leaf of a use tree; `*` has the name `*`."""
    tree = tree.strip()
    brace = tree.find("{")
    if brace < 0:
        path, _, name = tree.partition(" as ")
        parts = prefix + tuple(part.strip() for part in path.split("::") if part.strip())
        if parts and parts[-1] == "self":
            parts = parts[:-1]
        if parts:
            yield parts, (name.strip() or parts[-1])
        return
    prefix = prefix + tuple(part.strip() for part in tree[:brace].split("::") if part.strip())
    depth, begin = 0, brace + 1
    for at in range(brace, len(tree)):
        if tree[at] == "{":
            depth += 1
        elif tree[at] == "}":
            depth -= 1
        if (tree[at] == "," and depth == 1) or (tree[at] == "}" and depth == 0):
            if tree[begin:at].strip():
                yield from use_leaves(tree[begin:at], prefix)
            begin = at + 1


class Module:
    """A module with a file of its own."""

    def __init__(self, crate, path, file):
        self.crate, self.path, self.file = crate, path, file
        text = COMMENT_OR_TEXT.sub(lambda m: "\n" * m.group().count("\n") + '""', file.read_text(encoding="utf-8"))
        text = without_tests(text)
        self.children = {}
        self.submodules = [m.group(2) for m in MODULE.finditer(text)]
        self.items = set(ITEM.findall(text))
        self.uses, self.imports, self.globs = [], {}, []
        for match in USE.finditer(text):
            for parts, name in use_leaves(match.group(2)):
                self.uses.append(parts)
                if name == "*":
                    self.globs.append(parts[:-1])
                elif name != "_":
                    self.imports[name] = parts
        body = USE.sub("", text)
        self.paths = [tuple(re.split(r"\s*::\s*", m.group())) for m in PATH.finditer(body)]

    def add_children(self):
        stem = self.file.parent if self.file.name in ("lib.rs", "main.rs", "mod.rs") or not self.path else None
        folder = stem or self.file.with_suffix("")
        for name in self.submodules:
            for file in (folder / f"{name}.rs", folder / name / "mod.rs"):
                if file.is_file():
                    child = Module(self.crate, self.path + (name,), file)
                    self.children[name] = child
                    self.crate.append(child)
                    child.add_children()


def crate_roots():
    names = subprocess.run(["git", "ls-files", "*Cargo.toml"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    for name in names.split():
        folder = (ROOT / name).parent
        manifest = tomllib.loads((ROOT / name).read_text())
        if "package" not in manifest:
            continue
        roots = {folder / "src/lib.rs", folder / "src/main.rs"}
        roots |= {folder / part["path"] for part in manifest.get("bin", []) if "path" in part}
        yield from sorted(root for root in roots if root.is_file())


def find(root, parts):
    """Returns the module at a path of modules below the crate's root and how many parts it took."""
    at, taken = root, 0
    for part in parts:
        if part not in at.children:
            break
        at, taken = at.children[part], taken + 1
    return at, taken


def resolve(modules, by_path, module, parts, depth=0):
    """Returns the module whose file defines what a path in `module` names, or None outside the crate."""
    root = by_path[()]
    if depth > MAX_REEXPORTS or not parts:
        return None
    head = parts[0]
    if head == "crate":
        base, rest = root, parts[1:]
    elif head in ("self", "super"):
        base, rest = module, parts
        while rest and rest[0] in ("self", "super"):
            base = base if rest[0] == "self" else by_path.get(base.path[:-1], root)
            rest = rest[1:]
    elif head in module.children:
        base, rest = module, parts
    elif head in module.imports and module.imports[head] != parts:
        return resolve(modules, by_path, module, module.imports[head] + parts[1:], depth + 1)
    else:
        return None
    at, taken = find(base, rest)
    rest = rest[taken:]
    if not rest or rest[0] in at.items:
        return at
    if rest[0] in at.imports:
        return resolve(modules, by_path, at, at.imports[rest[0]], depth + 1) or at
    for glob in at.globs:
        found = resolve(modules, by_path, at, glob + rest[:1], depth + 1)
        if found and rest[0] in found.items:
            return found
    return at


def dependencies(root):
    """Returns the crate's files as {module: {module: names}}."""
    modules = []
    top = Module(modules, (), root)
    modules.append(top)
    top.add_children()
    by_path = {module.path: module for module in modules}
    graph = {module: {} for module in modules}
    for module in modules:
        for parts in module.uses + module.paths:
            target = resolve(modules, by_path, module, tuple(part for part in parts if part != "*"))
            if target is not None and target is not module:
                graph[module].setdefault(target, set()).add(parts[-1])
    return graph


def is_one_family(part):
    """Tells whether a circle is one module and modules below it."""
    top = min(part, key=lambda module: len(module.path)).path
    return all(module.path[: len(top)] == top for module in part) and any(module.path == top for module in part)


def circles(graph):
    """Returns the strongly connected components of more than one file (Tarjan)."""
    index, low, stack, found = {}, {}, [], []

    def visit(node):
        index[node] = low[node] = len(index)
        stack.append(node)
        for target in graph[node]:
            if target not in index:
                visit(target)
                low[node] = min(low[node], low[target])
            elif target in stack:
                low[node] = min(low[node], index[target])
        if low[node] == index[node]:
            part = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(part) > 1 and not is_one_family(part):
                found.append(part)

    for node in graph:
        if node not in index:
            visit(node)
    return found


def all_circles():
    """Yields each circle of the repository as lines of text."""
    for root in crate_roots():
        graph = dependencies(root)
        for part in circles(graph):
            lines = [f"{part[0].file.relative_to(ROOT)}:1: a circle of {len(part)} files"]
            for module in part:
                for target, names in graph[module].items():
                    if target in part:
                        names = ", ".join(sorted(names))
                        lines.append(f"    {module.file.relative_to(ROOT)} -> {target.file.relative_to(ROOT)}: {names}")
            yield lines


if __name__ == "__main__":
    sys.setrecursionlimit(10_000)
    count = 0
    for circle in all_circles():
        count += 1
        print("\n".join(circle))
    print(f"circles: {count}")
    sys.exit(count > 0)
