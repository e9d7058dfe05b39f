#!/usr/bin/env python3
"""Counts the tests that expect an English sentence of the product, by package.

    tests/tidy/sentences.py            tests, tests with a sentence, and their share
    tests/tidy/sentences.py --list     each such test, as FILE:LINE: TEST: sentence

Such a test fails at a rewording. Sentences belong in `tests/snapshots` of a package; tests assert kinds, names and
figures. A sentence is a literal of at least WORDS_MIN words, most of them in lower case. It is expected if it
reaches the condition of an assertion or a search in a text, directly, by a variable, a table of cases or a function
of the same file. Messages of assertions and inputs do not count.
"""

import argparse
import collections
import pathlib
import re
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
WORDS_MIN = 4
LOWER_CASE_SHARE = 0.6
# Share of all tests. What remains are names, commands and headings that read like sentences.
SHARE_MAX = 0.02
# Variables and functions on the way from a literal to its comparison.
DEPTH_MAX = 4

TOKEN = re.compile(
    r"""(?P<skip>\s+|//[^\n]*|/\*.*?\*/)
      |(?P<raw>b?r(?P<hash>\#*)".*?"(?P=hash))
      |(?P<string>b?"(?:\\.|[^"\\])*")
      |(?P<char>b?'(?:\\u\{[^}]*\}|\\.|[^\\'\n])')
      |(?P<name>[A-Za-z_]\w*)
      |(?P<other>==|!=|=>|::|->|.)""",
    re.VERBOSE | re.DOTALL,
)
# Symbols and units of one letter are no words.
WORD = re.compile(r"\(?[a-z][a-z'’-]+[.,:;!?)]*|a")
# A list of names is no sentence.
NAMES = re.compile(r"\S+(, \S+)+( (and|or) \S+)?")
# Rust's `\` at the end of a line removes the blanks that follow.
CONTINUATION = re.compile(r"\\\n\s*")
# Functions that look for their argument in a text.
SEARCHES = set(
    "contains starts_with ends_with find rfind matches match_indices split split_once rsplit_once strip_prefix "
    "strip_suffix split_at between eq position".split()
)
# What an expectation passes through unchanged.
WRAPPERS = set("from into to_owned to_string new vec format concat json iter into_iter as_str map chain".split())
PASSING = WRAPPERS | set("as_ref clone copied join zip enumerate lines trim trim_end take skip".split())
# Functions of other files that require their argument to be in a text.
REQUIRES = re.compile(r"assert|shows|wait_for|has_note|refused_with")
OPENING = "([{"


def is_sentence(text):
    tokens = text.strip().split(" ")
    words = sum(re.search("[A-Za-z]{2}", token) is not None for token in tokens)
    lower_case = sum(WORD.fullmatch(token) is not None for token in tokens)
    return words >= WORDS_MIN and lower_case > LOWER_CASE_SHARE * len(tokens) and not NAMES.fullmatch(text.strip())


class Source:
    """The tokens of a file, with the opening bracket around each and the functions."""

    def __init__(self, text):
        self.tokens, self.lines, self.kinds = [], [], []
        line = 1
        for match in TOKEN.finditer(text):
            kind = match.lastgroup if match.lastgroup != "hash" else "raw"
            if kind != "skip":
                self.tokens.append(match.group())
                self.lines.append(line)
                self.kinds.append(kind)
            line += match.group().count("\n")
        self.parents, self.ends = [], {}
        stack = [-1]
        for at, token in enumerate(self.tokens):
            is_bracket = self.kinds[at] == "other"
            if is_bracket and token in ")]}" and len(stack) > 1:
                self.ends[stack.pop()] = at
            self.parents.append(stack[-1])
            if is_bracket and token in OPENING:
                stack.append(at)
        self.functions = dict(self.closures()) | dict(self.all_functions())
        self.bodies = {first for _, first, _, _ in self.functions.values()}

    def closures(self):
        """Yields `let NAME = |PARAMETERS| BODY;` as all_functions does."""
        for at in range(len(self.tokens) - 4):
            if self.tokens[at] != "let" or self.tokens[at + 2 : at + 4] != ["=", "|"]:
                continue
            bar = self.tokens.index("|", at + 4)
            is_first = [self.kinds[i] == "name" and self.tokens[i - 1] in ("|", ",", "&") for i in range(at + 4, bar)]
            parameters = [self.tokens[at + 4 + i] for i, first in enumerate(is_first) if first]
            end = next((i for i in range(bar, len(self.tokens)) if self.tokens[i] == ";" and self.parents[i] == self.parents[at]), bar)
            yield self.tokens[at + 1], (parameters, bar, end, False)

    def all_functions(self):
        """Yields (name, (parameters, first token of the body, last, is a test))."""
        for at, token in enumerate(self.tokens):
            if token != "fn" or self.kinds[at + 1] != "name":
                continue
            opening = self.tokens.index("(", at)
            body = next((i for i in range(self.ends.get(opening, at), len(self.tokens)) if self.tokens[i] in "{;"), None)
            if body is None or self.tokens[body] == ";":
                continue
            parts = self.arguments(opening)
            names = [[t for t in self.tokens[first:end] if t.isidentifier() and t != "mut"] for first, end in parts]
            parameters = [name[0] for name in names if name]
            is_test = "#[test]" in "".join(self.tokens[max(0, at - 24) : at]).split("}")[-1].split(";")[-1]
            yield self.tokens[at + 1], (parameters, body, self.ends.get(body, len(self.tokens)), is_test)

    def arguments(self, opening):
        """The ranges of tokens between the commas of a bracket."""
        parts, first = [], opening + 1
        for at in range(opening + 1, self.ends.get(opening, opening) + 1):
            is_end = at == self.ends[opening]
            if (self.tokens[at] == "," and self.parents[at] == opening and self.kinds[at] == "other") or is_end:
                if at > first:
                    parts.append((first, at))
                first = at + 1
        return parts

    def argument_index(self, opening, at):
        return next((i for i, (first, end) in enumerate(self.arguments(opening)) if first <= at < end), 0)

    def caller(self, opening):
        """The name before a bracket and whether it is a macro."""
        before = opening - 1
        if before >= 0 and self.tokens[before] == "!":
            return self.tokens[before - 1], True
        return (self.tokens[before], False) if before >= 0 and self.kinds[before] == "name" else ("", False)

    def literal(self, at):
        token = self.tokens[at]
        if self.kinds[at] == "raw":
            return token[token.index('"') + 1 : token.rindex('"')]
        return CONTINUATION.sub("", token[token.index('"') + 1 : -1])


def is_expected(source, at, depth=0):
    """Whether the value of token `at` is compared with a text of the product."""
    if depth > DEPTH_MAX:
        return False
    tokens = source.tokens
    if tokens[at + 1] == "." and tokens[at + 3] == "(" and tokens[at + 2] not in PASSING:
        return False  # the text that is searched, or the object that makes it
    neighbours = {tokens[at - 1], tokens[at - 2] if tokens[at - 1] == "&" else "", tokens[at + 1]}
    if neighbours & {"==", "!="}:
        return True
    positions = []
    inner, opening = at, source.parents[at]
    while opening >= 0:
        name, is_macro = source.caller(opening)
        index = source.argument_index(opening, inner) if tokens[opening] != "{" else 0
        if is_macro and name.startswith("assert"):
            return index < (2 if name in ("assert_eq", "assert_ne") else 1)
        if tokens[opening] == "{":
            if name[:1].isupper() and opening not in source.bodies and tokens[opening - 2] != "impl":
                inner, opening = opening, source.parents[opening]
                continue
            return reaches_by_statement(source, at, opening, positions, depth)
        if tokens[opening] == "(" and name and name != "in":
            if name in source.functions and not (tokens[opening - 2] == "." and name in SEARCHES):
                return parameter_is_expected(source, name, index, depth)
            if name in SEARCHES or REQUIRES.match(name):
                return True
            if not (name in WRAPPERS or name[0].isupper()):
                return False
        if not is_macro and name in ("", "in", "for", "return") and tokens[opening] == "(":
            positions.append(index)
        inner, opening = opening, source.parents[opening]
    return reaches_by_statement(source, at, -1, positions, depth)


def parameter_is_expected(source, name, index, depth):
    parameters, first, end, _ = source.functions[name]
    named = [p for p in parameters if p != "self"]
    return index < len(named) and name_is_expected(source, named[index], first, end, depth + 1)


def name_is_expected(source, name, first, end, depth):
    captured = re.compile(r"\{" + name + r"[:}]")
    return any(
        (source.tokens[at] == name and source.tokens[at - 1] != "." or source.kinds[at] == "string" and captured.search(source.tokens[at]))
        and is_expected(source, at, depth)
        for at in range(first, end)
    )


def reaches_by_statement(source, at, block, positions, depth):
    """Whether a name is expected that `let NAMES = ...`, `for NAMES in ...` or `const NAME` gives to the value."""
    tokens = source.tokens
    start = at
    while start - 1 > block and not (source.parents[start - 1] == block and tokens[start - 1] in (";", "}")):
        start -= 1
    end = source.ends.get(block, len(tokens)) if block >= 0 else len(tokens)
    while start < at and tokens[start] not in ("let", "for", "const", "static"):
        start += 1
    if start >= at:
        return False
    stop = start + 1
    while tokens[stop] not in ("=", "in", ":") or source.parents[stop] != source.parents[start]:
        stop += 1
        if stop >= at:
            return False
    pattern = range(start + 1, stop)
    names = [tokens[i] for i in pattern if source.kinds[i] == "name" and tokens[i] not in ("mut", "ref", "_")]
    if tokens[start + 1] == "(" and positions:
        index = positions[0] if len(positions) == 1 else positions[-1]
        parts = source.arguments(start + 1)
        if index < len(parts):
            names = [tokens[i] for i in range(*parts[index]) if source.kinds[i] == "name"]
    first = next((i for i in range(at, end) if tokens[i] in (";", "{") and source.parents[i] == block), end)
    return any(name_is_expected(source, name, first, end, depth + 1) for name in names)


def expectations(source):
    """Yields (token, sentence) of each expected sentence."""
    for at, kind in enumerate(source.kinds):
        if kind in ("string", "raw") and is_sentence(source.literal(at)) and is_expected(source, at):
            yield at, source.literal(at)


def tests_of(source):
    """Yields (line, test, sentence or None) of each test; a function of the file passes its sentences to its callers."""
    within = collections.defaultdict(list)
    for at, sentence in expectations(source):
        inside = [n for n, (_, first, end, _) in source.functions.items() if first < at < end]
        for name in inside or ["(file)"]:
            within[name].append((source.lines[at], sentence))

    def found(name, seen):
        _, first, end, _ = source.functions[name]
        if within[name]:
            return within[name]
        called = {t for t in source.tokens[first:end] if t in source.functions and t not in seen}
        return [one for other in sorted(called) if not source.functions[other][3] for one in found(other, seen | called)]

    for name, (_, first, _, is_test) in source.functions.items():
        if is_test:
            yield source.lines[first], name, found(name, {name})
    yield from ((line, "(file)", [(line, sentence)]) for line, sentence in within["(file)"])


def package_of(path):
    for folder in path.parents:
        manifest = folder / "Cargo.toml"
        if manifest.is_file() and (name := re.search(r'^name = "([^"]+)"', manifest.read_text(), re.MULTILINE)):
            return name.group(1)
    return "?"


def measure():
    """{package: [tests, [(place, test, sentence)]]}"""
    names = subprocess.run(["git", "ls-files", "*.rs"], cwd=ROOT, check=True, capture_output=True, text=True).stdout.split()
    counts = collections.defaultdict(lambda: [0, []])
    for name in names:
        path = ROOT / name
        if not path.is_file() or "#[test]" not in (text := path.read_text(encoding="utf-8")):
            continue
        entry = counts[package_of(path)]
        for _, test, sentences in tests_of(Source(text)):
            entry[0] += test != "(file)"
            if sentences and test != "(file)":
                line, sentence = sentences[0]
                entry[1].append((f"{name}:{line}", test, sentence))
    return counts


def sums(counts):
    return sum(tests for tests, _ in counts.values()), sum(len(places) for _, places in counts.values())


def stale_sections():
    """Yields each stored section whose name stands in no test of its package."""
    names = subprocess.run(["git", "ls-files", "*/tests/snapshots/*.txt"], cwd=ROOT, check=True, capture_output=True, text=True)
    for name in names.stdout.split():
        folder = (ROOT / name).parent.parent.parent
        sources = "".join(path.read_text(encoding="utf-8") for part in ("src", "tests") for path in (folder / part).rglob("*.rs"))
        for number, line in enumerate((ROOT / name).read_text(encoding="utf-8").splitlines(), 1):
            if line.startswith("== ") and f'"{line[3:]}"' not in sources:
                yield f"{name}:{number}: no test has the section {line[3:]!r}: tests/snapshots"


def violations():
    """Yields each stale section, and the tests with a sentence if they are too many."""
    yield from stale_sections()
    counts = measure()
    tests, with_sentence = sums(counts)
    if with_sentence > SHARE_MAX * tests:
        yield f"{with_sentence} of {tests} tests expect a sentence, at most {SHARE_MAX:.1%} may: tests/tidy/sentences.py --list"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", action="store_true", help="each test, with its first sentence")
    arguments = parser.parse_args()
    counts = measure()
    for package, (_, places) in sorted(counts.items()):
        if arguments.list:
            for place, test, sentence in places:
                print(f"{place}: {test}: {sentence[:100]!r}")
    total, with_sentence = sums(counts)
    if not arguments.list:
        for package, (tests, places) in sorted(counts.items()):
            print(f"{package:24} {tests:5} {len(places):4} {len(places) / tests:6.1%}")
        print(f"{'all':24} {total:5} {with_sentence:4} {with_sentence / total:6.1%}")


if __name__ == "__main__":
    main()
