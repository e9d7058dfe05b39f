"""Limits for what a reader of the sources cannot take at its word: errors that are texts, names that say nothing, and functions of
statistics that exist twice.

An error that is a text has no kind: its caller can print it, and nothing else. `own` says whose a value is, and not what it is.
"""

import re

import rust

# An error without a kind, at the end of a `Result`.
TEXT_ERROR = re.compile(r"\bResult<[^;{}]*?,\s*(?:std::string::)?String,?\s*>")
TEXT_ERRORS_MAX = 0
UNNAMED = re.compile(r"\bown\b")
UNNAMED_MAX = 0
STATISTIC = re.compile(r"\bfn (median|quantile|percentile)\b")
HOME_OF_STATISTICS = "host-sim/log/src/statistics.rs"


def places(pattern, root=rust.ROOT):
    """Returns all matches in the code of the tracked sources, as texts `FILE:LINE`, without comments and texts."""
    found = []
    for name in rust.tracked("*.rs", root):
        code = rust.source(root / name)[1]
        found += [f"{name}:{code.count(chr(10), 0, match.start()) + 1}" for match in pattern.finditer(code)]
    return found


def above(pattern, most, reason, root):
    found = places(pattern, root)
    if len(found) > most:
        yield f"{len(found)} {reason}, expected at most {most}:"
        yield from found


def violations(root=rust.ROOT):
    yield from above(TEXT_ERROR, TEXT_ERRORS_MAX, "errors that are texts", root)
    yield from above(UNNAMED, UNNAMED_MAX, "values named own", root)
    for place in places(STATISTIC, root):
        if not place.startswith(HOME_OF_STATISTICS):
            yield f"{place}: a second function of statistics, expected {HOME_OF_STATISTICS}"
