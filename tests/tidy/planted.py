#!/usr/bin/env python3
"""Tests of the checks of this folder: each must find what is planted in a small repository, and nothing else.

    tests/tidy/planted.py      prints each failed test, and "planted: N passed, M failed"
"""

import pathlib
import subprocess
import sys
import tempfile
import tomllib
import traceback

import circles
import edges
import lines
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


def lines_with_tests_in_files_of_any_name_counts_what_ships(root):
    plant(root, {
        "host/Cargo.toml": "[package]\n",
        "host/src/lib.rs": 'mod kept;\n#[cfg(test)]\nmod checks;\n#[cfg(test)]\n#[path = "odd name.rs"]\nmod odd;\nconst A: &str = "\n#[cfg(test)]\n";\n',
        "host/src/kept.rs": "fn a() {}\n#[cfg(test)]\nmod tests {\n    const A: char = '{';\n}\n#[cfg(test)]\nmod kept_tests;\nmod fixtures;\n",
        "host/src/kept/kept_tests.rs": "fn a() {}\n",
        "host/src/kept/fixtures.rs": "fn this_ships() {}\n",
        "host/src/checks.rs": "mod deep;\n",
        "host/src/checks/deep.rs": "fn a() {}\n",
        "host/src/odd name.rs": "fn a() {}\n",
        "host/tests/all.rs": "fn a() {}\n",
    })
    found = lines.count(root)
    # lib.rs without both test modules, of which the attribute's line ends stay: 4 + 2; kept.rs: 2 + 2; fixtures.rs: 1.
    assert found == {"host": 11}, found


BUDGETS = '[a]\npackages = ["host"]\nlines = {}\npurpose = "."\n[b]\npackages = ["fit"]\nlines = {}\npurpose = "."\n'


def budgets(a, b):
    return tomllib.loads(BUDGETS.format(a, b))


def budgets_exceeded_too_large_or_missing_fail(_):
    def wrong(counted, a=1000, b=4000):
        return [text.rsplit(": ", 1)[1] for text in lines.count_violations(counted, budgets(a, b))]

    assert wrong({"host": 1000, "fit": 3900, "lab/papers": 7}) == []
    assert wrong({"host": 1001, "fit": 3900}) == ["remove lines, or see the head of tests/tidy/budgets.toml"]
    assert wrong({"host": 899, "fit": 3799}) == ["lower the budget to 899", "lower the budget to 3799"]
    assert wrong({"host": 1000, "fit": 3900, "log": 1}) == ["0 budgets in tests/tidy/budgets.toml, expected one"]


def budgets_raised_by_a_commit_need_a_reason(root):
    def wrong(a, b, message):
        plant(root, {lines.BUDGETS: BUDGETS.format(a, b)})
        git(root, "commit", "-q", "-m", message)
        change = lines.last_change(root)
        return change and list(lines.raise_violations(*change))

    assert wrong(100, 200, "Begin") is None
    (text,) = wrong(110, 205, "Add a feature\n\nIt needs lines.")
    assert "by 15 lines" in text, text
    assert wrong(130, 185, "Move lines") == []
    assert wrong(140, 185, "Add a feature\n\nBudget: a log of the new tool is read") == []
    assert wrong(140, 100, "Remove a feature") == []
    git(root, "commit", "-q", "--allow-empty", "-m", "Another change")
    assert not list(lines.raise_violations(*lines.last_change(root)))


def edges_in_code_are_found_and_words_of_comments_are_not(root):
    source = "// its own Result<f64, String>\nfn median(own: f64) -> Result<\n    f64,\n    String,\n> {\n    todo(\"own\")\n}\n"
    plant(root, {"src/a.rs": source})
    assert edges.places(edges.UNNAMED, root) == ["src/a.rs:2"]
    # A trailing comma is as rustfmt breaks a long type.
    assert edges.places(edges.TEXT_ERROR, root) == ["src/a.rs:2"]
    assert any("src/a.rs:2: a second" in line for line in edges.violations(root))


TESTS = [
    edges_in_code_are_found_and_words_of_comments_are_not,
    circles_with_two_files_finds_both,
    circles_with_reexport_of_another_crate_at_the_root_finds_the_children,
    circles_with_parent_in_the_component_finds_the_siblings,
    circles_with_a_module_outside_of_the_family_finds_it,
    circles_with_parent_and_children_finds_none,
    circles_with_ties_of_tests_texts_and_reexports_finds_none,
    method_circles_with_calls_both_ways_finds_the_type,
    method_circles_with_calls_one_way_finds_none,
    method_circles_above_and_far_below_the_limit_fail,
    lines_with_tests_in_files_of_any_name_counts_what_ships,
    budgets_exceeded_too_large_or_missing_fail,
    budgets_raised_by_a_commit_need_a_reason,
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
