"""Examples in the documentation of a library run only if its manifest permits them.

Rustdoc reads and expands a whole library to find its examples, so a library without any has `doctest = false`. This rule
fails where an example would not run, and where libraries are read in vain.
"""

import pathlib
import re
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
FENCE = re.compile(r"^\s*//[/!] ?```(.*)$")
# What rustdoc compiles: no word, or words of its own.
RUST = re.compile(r"^(rust|no_run|should_panic|compile_fail|edition\d+|,|\s)*$")


def examples(text):
    """Yields the lines at which Rust examples begin."""
    is_open = False
    for number, line in enumerate(text.splitlines(), 1):
        fence = FENCE.match(line)
        if fence:
            if not is_open and RUST.match(fence[1]):
                yield number
            is_open = not is_open


def disagreements(files):
    """Yields each library whose manifest and examples disagree."""
    assert list(examples("/// ```text\n/// a\n/// ```\n//! ```\n//! a();\n//! ```\n")) == [4]
    for manifest in files:
        folder = pathlib.PurePath(manifest).parent
        if not manifest.endswith("Cargo.toml") or f"{folder}/src/lib.rs" not in files:
            continue
        runs = tomllib.loads((ROOT / manifest).read_text()).get("lib", {}).get("doctest", True)
        sources = [name for name in files if name.startswith(f"{folder}/src/") and name.endswith(".rs")]
        found = [f"{name}:{number}" for name in sources for number in examples((ROOT / name).read_text())]
        if found and not runs:
            yield f"{found[0]}: an example, but {manifest} has doctest = false"
        if runs and not found:
            yield f"{manifest}:1: no example in the documentation, expected doctest = false"
