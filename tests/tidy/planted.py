#!/usr/bin/env python3
"""Tests of the checks of this folder: each must find what is planted in a small repository, and nothing else.

    tests/tidy/planted.py      prints each failed test, and "planted: N passed, M failed"
"""

import pathlib
import subprocess
import sys
import tempfile
import traceback

import circles
import method_circles
import rust


def git(root, *words):
    identity = ["-c", "user.name=test", "-c", "user.email=test@localhost", "-c", "commit.gpgsign=false"]
    subprocess.run(["git", *identity, *words], cwd=root, check=True, capture_output=True)


def plant(root, files):
    """Writes files into the repository at `root`, and adds them."""
    if not (root / ".git").exists():
        git(root, "init", "-q")
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    git(root, "add", "-A")


def circles_of(root, files):
    """Returns the circles of a package with these files below src, as sets of names."""
    plant(root, {"Cargo.toml": "[package]\n"} | {f"src/{name}.rs": text for name, text in files.items()})
    ((_, crate),) = rust.crates(root)
    return [{"::".join(module.path) or "lib" for module in circle} for circle in circles.circles(crate)]


def circles_with_two_files_finds_both(root):
    found = circles_of(root, {"lib": "mod a;\nmod b;\n", "a": "use crate::b::B;\npub struct A(B);", "b": "pub struct B(crate::a::A);"})
    assert found == [{"a", "b"}], found


def circles_with_reexport_of_another_crate_at_the_root_finds_the_children(root):
    files = {
        "lib": "mod a;\nmod b;\nmod c;\npub use a::A;\npub use other::Quantity;\n",
        "a": "use crate::Quantity;\nuse crate::b::B;\npub struct A(Quantity, B);",
        "b": "pub struct B(crate::A);",
        "c": "use crate::{A, Quantity};\nfn c(_: A, _: Quantity) {}",
    }
    found = circles_of(root, files)
    assert found == [{"a", "b"}], found
    ((_, crate),) = rust.crates(root)
    targets = {to.path for names in circles.dependencies(crate).values() for to in names}
    assert () not in targets, "a name of another crate is no item of the root"


def circles_with_parent_in_the_component_finds_the_siblings(root):
    files = {
        "lib": "mod p;\n",
        "p": "mod x;\nmod y;\npub struct Name;\npub fn p() { x::x(); y::y(); }",
        "p/x": "use super::{Name, y::y};\npub fn x(_: Name) { y(Name) }",
        "p/y": "use super::Name;\npub fn y(_: Name) { super::x::x(Name) }",
    }
    found = circles_of(root, files)
    assert found == [{"p::x", "p::y"}], found


def circles_with_a_module_outside_of_the_family_finds_it(root):
    files = {
        "lib": "mod p;\nmod q;\n",
        "p": "mod x;\npub struct Name;\npub fn p() { x::x() }",
        "p/x": "pub fn x() { crate::q::q(crate::p::Name) }",
        "q": "use crate::p::Name;\npub fn q(_: Name) {}",
    }
    found = circles_of(root, files)
    assert found == [{"p", "p::x", "q"}], found


def circles_with_parent_and_children_finds_none(root):
    files = {
        "lib": "mod p;\npub struct Error;\npub fn run() { p::p() }",
        "p": "mod x;\nmod y;\npub struct Name(crate::Error);\npub fn p() { x::x(Name(crate::Error)) }",
        "p/x": "use super::{Name, y};\npub fn x(name: Name) { y::y(name) }",
        "p/y": "pub fn y(_: super::Name) {}",
    }
    assert circles_of(root, files) == []


def circles_with_ties_of_tests_texts_and_reexports_finds_none(root):
    files = {
        "lib": "mod p;\nmod q;\nmod r;\n",
        "p": "mod x;\npub use x::x;\npub struct Name;\n",
        "p/x": "pub fn x() { crate::q::q(crate::p::Name) }",
        "q": "pub fn q(_: crate::p::Name) {}\n// crate::r::r()\nconst TEXT: &str = \"crate::r::r()\";\n#[cfg(test)]\nmod tests { use crate::r::r; }",
        "r": "pub fn r() { crate::q::q(crate::p::Name) }",
    }
    assert circles_of(root, files) == []


def method_figures_of(root, second):
    plant(root, {
        "joint/Cargo.toml": "[package]\n",
        "joint/src/lib.rs": "mod a;\npub struct Machine<const N: usize>;\n",
        "joint/src/a.rs": "mod b;\nuse crate::Machine;\nimpl<const N: usize> Machine<N> {\n    pub fn a(&mut self) { self.b::<u8>(1) }\n    fn c() {}\n}",
        "joint/src/a/b.rs": f"use super::*;\nimpl<const N: usize> Machine<N> {{ pub(super) fn b<T>(&mut self, x: impl Into<T>) {{ {second} }} }}",
    })
    return method_circles.all_figures(root)


def method_circles_with_calls_both_ways_finds_the_type(root):
    found = method_figures_of(root, "Self::c()")
    assert found == {"joint: Machine": {"files": 2, "methods": 3}}, found


def method_circles_with_calls_one_way_finds_none(root):
    found = method_figures_of(root, "self.a.c(); other.a()")
    assert found == {}, found


def method_circles_above_and_far_below_the_limit_fail(_):
    def wrong(files, methods):
        found = method_circles.violations({"T": {"files": files, "methods": methods}}, {"T": {"files": 6, "methods": 40}})
        return [text.rsplit(": ", 1)[1] for text in found]

    assert wrong(6, 40) == wrong(4, 32) == []
    assert wrong(7, 40) == wrong(6, 41) == ["give the method to a part of the type"]
    assert wrong(3, 40) == ["lower the limit to 3"] and wrong(6, 31) == ["lower the limit to 31"]
    assert len(list(method_circles.violations({"New": {"files": 2, "methods": 4}}, {"Gone": {"files": 2}}))) == 2


TESTS = [
    circles_with_two_files_finds_both,
    circles_with_reexport_of_another_crate_at_the_root_finds_the_children,
    circles_with_parent_in_the_component_finds_the_siblings,
    circles_with_a_module_outside_of_the_family_finds_it,
    circles_with_parent_and_children_finds_none,
    circles_with_ties_of_tests_texts_and_reexports_finds_none,
    method_circles_with_calls_both_ways_finds_the_type,
    method_circles_with_calls_one_way_finds_none,
    method_circles_above_and_far_below_the_limit_fail,
]


def run():
    """Runs the tests, prints their counts and returns the number of failed ones."""
    failed = 0
    for test in TESTS:
        with tempfile.TemporaryDirectory() as folder:
            try:
                test(pathlib.Path(folder).resolve())
            except Exception:
                failed += 1
                print(f"FAILED {test.__name__}", traceback.format_exc(), sep="\n")
    print(f"planted: {len(TESTS) - failed} passed, {failed} failed")
    return failed


if __name__ == "__main__":
    sys.exit(run() > 0)
