"""What a reader of the shipped sources cannot take at its word: errors that are texts, names that say nothing, and functions of
statistics that exist twice. None of them is wanted.

An error that is a text has no kind: its caller can print it, and nothing else. `own` says whose a value is, and not what it is.
"""

import re

import rust

# An error without a kind, at the end of a `Result`.
TEXT_ERROR = re.compile(r"\bResult<[^;{}]*?,\s*(?:std::string::)?String,?\s*>")
UNNAMED = re.compile(r"\bown\b")
STATISTIC = re.compile(r"\bfn (median|quantile|percentile)\b")
HOME_OF_STATISTICS = "host-sim/log/src/statistics.rs"
# Tests, and what is not shipped.
OTHER = re.compile(r"^(lab|tests)/|/(tests|examples)/|(^|[/_])tests\.rs$")


def places(pattern, root=rust.ROOT):
    """Returns all matches in the code of the shipped sources, as texts `FILE:LINE`, without comments, texts and tests in a file."""
    found = []
    for name in rust.tracked("*.rs", root):
        if OTHER.search(name):
            continue
        code = rust.source(root / name)[1].split("#[cfg(test)]\nmod tests {")[0]
        found += [f"{name}:{code.count(chr(10), 0, match.start()) + 1}" for match in pattern.finditer(code)]
    return found


def violations(root=rust.ROOT):
    for pattern, reason in [
        (TEXT_ERROR, "an error that is a text, expected a type with kinds"),
        (UNNAMED, "a value named own, expected the name of what it is"),
    ]:
        yield from (f"{place}: {reason}" for place in places(pattern, root))
    for place in places(STATISTIC, root):
        if not place.startswith(HOME_OF_STATISTICS):
            yield f"{place}: a second function of statistics, expected {HOME_OF_STATISTICS}"
