"""Reads Rust sources as far as the checks of this folder need: code without comments, text and tests, and the tree of modules.

It is no parser. It knows comments, texts, braces, attributes and `mod`, `use` and item lines as rustfmt writes them. Items that
macros write are invisible to it.
"""

import functools
import pathlib
import re
import subprocess
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
COMMENT_OR_TEXT = re.compile(
    r"//[^\n]*|/\*.*?\*/|b?r(#*)\".*?\"\1|b?\"(?:\\.|[^\"\\])*\"|b?'(?:\\.[^']*|[^'\\\n])'", re.S
)
TEST_ATTRIBUTE = re.compile(r"#\[cfg\((?:all\()?test\b[^\]]*\]")
WHOLE_FILE_TEST = re.compile(r"^\s*#!\[cfg\((?:all\()?test\b", re.M)
MODULE = re.compile(r"((?:#\[[^\]]*\]\s*)*)(?:pub(?:\([^)]*\))?\s+)?\bmod\s+(\w+)\s*;")
PATH_ATTRIBUTE = re.compile(r"#\[path\s*=\s*\"([^\"]+)\"")
USE = re.compile(r"(pub(?:\([^)]*\))?\s+)?\buse\s+([^;]+);")
PATH = re.compile(r"\b(?:r#)?[A-Za-z_]\w*(?:\s*::\s*(?:r#)?[A-Za-z_]\w*)+")
ITEM = re.compile(r"\b(?:fn|struct|enum|union|trait|type|const|static|macro_rules!|mod)\s+(?:mut\s+)?(\w+)")
MAX_REEXPORTS = 12


def tracked(pattern, root=ROOT):
    """Returns the names of the files in git that match a pattern and exist."""
    names = subprocess.run(["git", "ls-files", "-z", pattern], cwd=root, check=True, capture_output=True, text=True).stdout
    return [name for name in names.split("\0") if name and (root / name).is_file()]


def code_of(text):
    """Returns a text of equal length and equal lines in which comments and the contents of texts are blank."""

    def blank(match):
        found = match.group()
        blanked = re.sub(r"[^\n]", " ", found)
        return blanked if found.startswith("/") else '"' + blanked[1:-1] + '"'

    return COMMENT_OR_TEXT.sub(blank, text)


@functools.cache
def source(file):
    """Returns the text of a file and its code, of equal lines."""
    text = file.read_text(encoding="utf-8")
    return text, code_of(text)


def end_of_block(code, at):
    """Returns the end of the item at `at`: behind its closing brace, or behind `;` if it has no body."""
    depth = 0
    for match in re.compile(r"[{}()\[\];]").finditer(code, at):
        if match.group() in "{([":
            depth += 1
        elif match.group() in "})]":
            depth -= 1
        if depth < 0:
            return match.start()  # The last field or arm of a block.
        if depth == 0 and match.group() in "};":
            return match.end()
    return len(code)


def outer_items(code):
    """Returns the names of a module's own items: those outside of bodies. The body of a macro call counts as outside."""
    outer, at, end = [], 0, 0
    for match in re.finditer(r"\{", code):
        if match.start() >= end and not re.search(r"!\s*$", code[at : match.start()]):
            outer.append(code[at : match.start()])
            at = end = end_of_block(code, match.start())
    return set(ITEM.findall(" ".join([*outer, code[at:]])))


def test_spans(code):
    """Yields begin and end of each item behind `#[cfg(test)]`."""
    if WHOLE_FILE_TEST.search(code):
        yield 0, len(code)
        return
    end = 0
    for match in TEST_ATTRIBUTE.finditer(code):
        if match.start() >= end:
            end = end_of_block(code, match.end())
            yield match.start(), end


def shipped(code, text):
    """Returns `text` without the places where its `code` holds tests."""
    out, at = [], 0
    for begin, end in test_spans(code):
        out.append(text[at:begin])
        at = end
    return "".join(out) + text[at:]


def module_file(file, name, attributes, is_root):
    """Returns the file of `mod name;` in `file`, or None if there is none."""
    path = PATH_ATTRIBUTE.search(attributes)
    if path:
        candidates = [file.parent / path.group(1)]
    else:
        folder = file.parent if is_root or file.name == "mod.rs" else file.with_suffix("")
        candidates = [folder / f"{name}.rs", folder / name / "mod.rs"]
    return next((candidate.resolve() for candidate in candidates if candidate.is_file()), None)


def module_lines(text, code):
    """Yields attributes, name and position of each `mod name;`; the attributes are those of the source, with their texts."""
    for match in MODULE.finditer(code):
        yield text[match.start(1) : match.end(1)], match.group(2), match.start()


def crate_roots(root=ROOT):
    """Yields the root file of each library and program of the repository."""
    for name in tracked("*Cargo.toml", root):
        folder = (root / name).parent
        manifest = tomllib.loads((root / name).read_text())
        if "package" not in manifest:
            continue
        roots = {folder / manifest.get("lib", {}).get("path", "src/lib.rs"), folder / "src/main.rs"}
        roots |= {folder / part["path"] for part in manifest.get("bin", []) if "path" in part}
        roots |= {*folder.glob("src/bin/*.rs"), *folder.glob("src/bin/*/main.rs")}
        yield from sorted(file.resolve() for file in roots if file.is_file())


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
    """A module with a file of its own, and the modules below it."""

    def __init__(self, tree, path, file):
        self.tree, self.path, self.file = tree, path, file
        text, code = source(file)
        self.code, text = shipped(code, code), shipped(code, text)
        self.children, self.imports, self.globs, self.uses = {}, {}, [], []
        self.items = outer_items(self.code)
        for match in USE.finditer(self.code):
            for parts, name in use_leaves(match.group(2)):
                self.uses.append((parts, name, bool(match.group(1))))
                if name == "*":
                    self.globs.append(parts[:-1])
                elif name != "_":
                    self.imports[name] = parts
        self.body = MODULE.sub("", USE.sub("", self.code))
        self.paths = [tuple(re.split(r"\s*::\s*", match.group())) for match in PATH.finditer(self.body)]
        tree.append(self)
        for attributes, name, _ in module_lines(text, self.code):
            child = module_file(file, name, attributes, is_root=not path)
            if child is not None:
                self.children[name] = Module(tree, (*path, name), child)


class Crate:
    """The modules of a library or program, by their paths."""

    def __init__(self, root):
        self.modules = []
        Module(self.modules, (), root)
        self.by_path = {module.path: module for module in self.modules}

    def resolve(self, module, parts, depth=0):
        """Returns the module whose file defines what a path in `module` names, or None if it is outside the crate."""
        if depth > MAX_REEXPORTS or not parts:
            return None
        head = parts[0]
        if head == "crate":
            at, rest = self.by_path[()], parts[1:]
        elif head in ("self", "super"):
            at, rest = module, parts
            while rest and rest[0] in ("self", "super"):
                at = at if rest[0] == "self" else self.by_path[at.path[:-1]]
                rest = rest[1:]
        elif head in module.children:
            at, rest = module, parts
        elif head in module.imports and module.imports[head] != parts:
            return self.resolve(module, module.imports[head] + parts[1:], depth + 1)
        elif head in module.items:
            return module
        else:
            return self.in_globs(module, parts, depth)
        while rest and rest[0] in at.children:
            at, rest = at.children[rest[0]], rest[1:]
        if not rest or rest[0] in at.items:
            return at
        if rest[0] in at.imports:
            return self.resolve(at, at.imports[rest[0]] + rest[1:], depth + 1)
        found = self.in_globs(at, rest, depth)
        if found is None and not any(self.resolve(at, glob, depth + 1) is None for glob in at.globs):
            # A macro writes the item.
            return at
        return found

    def in_globs(self, module, parts, depth):
        """Returns the module that defines a name which `module` imports with `*`, or None."""
        for glob in module.globs:
            source = self.resolve(module, glob, depth + 1) if glob else None
            if source is None or source is module:
                continue
            if parts[0] in source.items:
                return source
            if parts[0] in source.imports or parts[0] in source.children or source.globs:
                found = self.resolve(source, ("self", *parts), depth + 1)
                if found is not None:
                    return found
        return None


@functools.cache
def crates(root=ROOT):
    """Returns the root file and the modules of each library and program of the repository."""
    return [(file, Crate(file)) for file in crate_roots(root)]
