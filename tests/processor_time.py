#!/usr/bin/env python3
"""The limit of tests/run: processor seconds of all stages in a fresh target folder.

    tests/processor_time.py pace                     prints how long this machine takes for a unit of work, s
    tests/processor_time.py check TABLE PACE...      compares the sum of TABLE (target/stage-times.tsv) with the limit
    tests/processor_time.py test                     tests this script

LIMIT_S holds on a machine for which `pace` prints REFERENCE_S with both processors busy. A slower or busier machine must not fail,
so the sum is divided by the mean pace of the run over REFERENCE_S; a faster machine has the same limit. The limit may only fall.
The unit of work is a compression by zlib, one on each processor. `PACE` is what `pace` printed during the run.
"""

import os
import pathlib
import sys
import time
import zlib

# A quarter above the sum of the stages at this pace, each measured with little beside it, as stages that share the processors share
# their caches. The aim is 1,700 s on a machine that needs half the time: a quarter of an hour on two processors.
LIMIT_S = 8000
REFERENCE_S = 0.77
BYTES = 6_000_000


def unit():
    """Compresses text that neither repeats itself nor is random; returns the processor time, s."""
    state, words = 1, []
    while len(words) * 6 < BYTES:
        state = (1_103_515_245 * state + 12_345) % (1 << 31)
        words.append(f"{state >> 15:05d} ")
    text = "".join(words).encode()
    begin = time.process_time()
    zlib.compress(text, 9)
    return time.process_time() - begin


def pace():
    """Returns the mean processor time of one unit for each processor, all at the same time."""
    children = []
    for _ in range(os.cpu_count() or 1):
        reader, writer = os.pipe()
        child = os.fork()
        if child == 0:
            os.write(writer, repr(unit()).encode())
            os._exit(0)
        os.close(writer)
        children.append((child, reader))
    taken = []
    for child, reader in children:
        with os.fdopen(reader) as answer:
            taken.append(float(answer.read()))
        os.waitpid(child, 0)
    return sum(taken) / len(taken)


def violations(text, paces):
    """Returns the sum over all stages, the sum on the reference, and one line if the latter exceeds the limit."""
    used = sum(int(line.split("\t")[3]) for line in text.splitlines())
    slowness = max(1.0, sum(paces) / len(paces) / REFERENCE_S)
    on_reference = used / slowness
    excess = [] if on_reference <= LIMIT_S else [f"{on_reference:.0f} s of processor time, expected at most {LIMIT_S}"]
    return used, on_reference, excess


def test():
    table = f"build\tbuild\t500\t600\tran\ntests\ttests\t300\t{LIMIT_S - 600}\tran\n"
    more = table + "long\tlong\t90\t1\tran\n"
    cases = {
        "within the limit": (violations(table, [REFERENCE_S]), (LIMIT_S, LIMIT_S, 0)),
        "above the limit": (violations(more, [REFERENCE_S]), (LIMIT_S + 1, LIMIT_S + 1, 1)),
        "above the limit on a fast machine": (violations(more, [0.5 * REFERENCE_S]), (LIMIT_S + 1, LIMIT_S + 1, 1)),
        "within the limit on a slow machine": (violations(more, [REFERENCE_S, 3 * REFERENCE_S]), (LIMIT_S + 1, (LIMIT_S + 1) / 2, 0)),
    }
    failed = 0
    for name, ((used, on_reference, excess), expected) in cases.items():
        good = (used, on_reference, len(excess)) == expected
        failed += not good
        if not good:
            print(f"FAILED {name}: {used} {on_reference} {excess}, expected {expected}")
    print(f"processor_time: {len(cases) - failed} passed, {failed} failed")
    return failed > 0


def main():
    verb, *rest = sys.argv[1:] or [""]
    if verb == "pace":
        print(f"{pace():.3f}")
        return False
    if verb == "test":
        return test()
    if verb != "check" or len(rest) < 2:
        sys.exit(__doc__)
    used, on_reference, excess = violations(pathlib.Path(rest[0]).read_text(), [float(each) for each in rest[1:]])
    print(f"measured: {used} s of processor time, {on_reference:.0f} s at the reference's pace, limit {LIMIT_S} s")
    print(*(f"FAILED {line}" for line in excess), sep="\n", end="\n" if excess else "")
    print(f"processor time: {int(not excess)} passed, {len(excess)} failed")
    return bool(excess)


if __name__ == "__main__":
    sys.exit(main())
