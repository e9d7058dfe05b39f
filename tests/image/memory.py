"""Where the bytes of the image are, and the worst stack. limits.tsv has their limits.

The worst stack is a bound by the call graph. A call through a register may reach every function whose address is stored in
the image, apart from handlers. Functions that call each other in a circle are formatting of texts; a text contains at most
`NESTED_TEXTS` others, so each of them counts that often.
"""

import collections
import pathlib
import re

import images

LIMITS = pathlib.Path(__file__).resolve().parent / "limits.tsv"

# Bytes that the core stores at an exception: 8 registers, 18 of the floating-point unit, and alignment (ARM DDI 0403, B1.5.6).
EXCEPTION_FRAME = 4 * (8 + 18) + 4
NESTED_TEXTS = 3
# Handlers that may interrupt each other, one at a time per priority, then a fault. Vectors (16 + number of the interrupt).
HANDLERS = {"receive (FDCAN1_IT0)": 16 + 21, "current loop (ADC1_2)": 16 + 18, "fault (HardFault)": 3}
SMALL = 1024
SUMS = ("start and a fault", "background, all interrupts and a fault")
PARTS = re.compile(r"compensator_core|embassy\w*|firmware|compiler_builtins|libm|defmt\w*|canopen_rs|crc|cortex_m\w*|micromath|heapless|core")


def part(name):
    """Crate and module that a symbol belongs to."""
    found = PARTS.search(name)
    if name.startswith("__aeabi") or not found:
        return "handlers and copies" if name[:4] != "anon" else "constants without a name"
    crate = found.group()
    if crate.startswith(("embassy", "cortex", "defmt")):
        return crate.split("_")[0]
    if crate not in ("firmware", "compensator_core"):
        return crate
    module = re.match(r"(?:\.\.|\d+)([a-z_0-9]+?)(?=\.\.|\d|$)", name[found.end():])
    return f"{crate} {module.group(1)}" if module else crate


def flash(image):
    """Bytes of flash by crate and module, largest first; parts below `SMALL` are added up.

    A function counts for the module that defines it, with all that the compiler inlined into it: the handlers contain the
    current loop, and `firmware background` the driver.
    """
    parts, total = collections.Counter(), sum(len(content) for _, content, _ in image.segments)
    for name, (address, size) in image.symbols.items():
        if any(start <= address < start + len(content) for start, content, _ in image.segments):
            parts["constants without a name" if name.startswith(".L") else part(name)] += size
    parts["constants without a name"] += total - sum(parts.values())
    small = sum(size for size in parts.values() if size < SMALL)
    rows = [(name, size) for name, size in parts.most_common() if size >= SMALL]
    return [*rows, ("parts below 1 KB", small), ("total", total)]


def targets(graph):
    """Functions that a call through a register may reach."""
    handlers = {graph.image.word(graph.image.vectors + 4 * number) & ~1 for number in range(1, 118)}
    stored = set()
    for _, content, _ in graph.image.segments:
        for at in range(0, len(content) - 3, 4):
            stored.add(int.from_bytes(content[at : at + 4], "little"))
    for function in graph.functions.values():
        if "Thunk" not in function.name:
            stored |= function.values
    return {word & ~1 for word in stored if word & 1 and word & ~1 in graph.functions} - handlers


def components(graph, called):
    """Groups of functions that reach each other (Tarjan), callees first."""
    order, low, on, stack, found = {}, {}, set(), [], []
    for root in graph.functions:
        if root in order:
            continue
        order[root] = low[root] = len(order)
        stack.append(root)
        on.add(root)
        work = [(root, iter(called[root]))]
        while work:
            place, left = work[-1]
            following = next(left, None)
            if following is not None:
                if following not in order:
                    order[following] = low[following] = len(order)
                    stack.append(following)
                    on.add(following)
                    work.append((following, iter(called[following])))
                elif following in on:
                    low[place] = min(low[place], order[following])
                continue
            work.pop()
            if work:
                low[work[-1][0]] = min(low[work[-1][0]], low[place])
            if low[place] == order[place]:
                group = []
                while not group or group[-1] != place:
                    group.append(stack.pop())
                    on.discard(group[-1])
                found.append(group)
    return found


def depths(graph):
    """Worst stack of every function in bytes, with all that it calls."""
    indirect = targets(graph)
    called = {}
    for address, function in graph.functions.items():
        places = set(function.calls) | (indirect if function.indirect else set())
        called[address] = {graph.at(place).address for place in places if graph.at(place)}
    worst = {}
    for group in components(graph, called):
        below = max((worst[place] for one in group for place in called[one] if place in worst), default=0)
        frames = sum(graph.functions[one].frame for one in group)
        times = NESTED_TEXTS if len(group) > 1 or group[0] in called[group[0]] else 1
        for one in group:
            worst[one] = below + times * frames
    return worst


def stack(image, graph):
    """Rows of the worst stack in bytes: each level, their sum, and what RAM leaves for it."""
    unknown = [function.name for function in graph.functions.values() if function.unbounded]
    assert not unknown, f"stack frames of unknown length: {unknown}"
    worst = depths(graph)

    def of(part):
        return max(size for address, size in worst.items() if part in graph.functions[address].name)

    rows = {name: EXCEPTION_FRAME + worst[image.word(image.vectors + 4 * number) & ~1] for name, number in HANDLERS.items()}
    start, background, fault = of("__rtic_init_resources"), of("3app4idle"), rows["fault (HardFault)"]
    # firmware/src/stack_guard.rs: sixteen words, and above them a region of 512 bytes that is aligned to its length.
    guard_end = -(-(image.symbols["_stack_end"][0] + 64) // 512) * 512 + 512
    available = image.symbols["_stack_start"][0] - guard_end
    return [
        ("start, interrupts off", start), ("background", background), *rows.items(),
        (SUMS[0], start + fault), (SUMS[1], background + sum(rows.values())),
        ("available", available),
    ]


def ram(image):
    """Rows of RAM in bytes. Without code in CCM, CCM is a part of the RAM."""
    statics = image.symbols["_stack_end"][0] - 0x2000_0000
    length = image.symbols["_stack_start"][0] - 0x2000_0000
    if "__efast" not in image.symbols:
        return [(f"statics, of {length}", statics)]
    code = image.symbols["__efast"][0] - image.symbols["__sfast"][0]
    return [("CCM: code and tables of the current loop, of 32768", code), (f"SRAM: statics, of {length}", statics)]


def page(image, graph):
    """Lines of the three tables with titles."""
    tables = {
        "Flash, bytes": flash(image),
        "RAM, bytes": ram(image),
        "Worst stack, bytes": stack(image, graph),
    }
    lines = []
    for title, rows in tables.items():
        lines += [f"# {title}", "part\tbytes", *(f"{name}\t{size}" for name, size in rows), ""]
    return lines[:-1]


def numbers(lines):
    cells = [line.split("\t") for line in lines if "\t" in line and not line.startswith("part\t")]
    return {name: int(size) for name, size in cells}


def limits(name):
    """Limits of an image: figure, least and most."""
    lines = [line.split("\t") for line in LIMITS.read_text().splitlines()[1:]]
    found = [(figure, int(least), int(most)) for image, figure, least, most, _ in lines if image == name]
    assert len(found) > 3, f"{name}: {len(found)} limits"
    return found


def check(image, graph, name):
    """Compares with the limits of the image of this name and writes the tables to target/figures/; returns the worst stack and
    what is available, bytes."""
    now = dict(stack(image, graph))
    lines = page(image, graph)
    images.write_figures("memory.tsv" if name == "stm32g474" else f"memory-{name}.tsv", "\n".join(lines) + "\n")
    for figure in SUMS:
        assert now[figure] <= now["available"], f"{figure}: {now[figure]} bytes of stack, available {now['available']}"
    found = numbers(lines)
    outside = [f"{figure}: {found.get(figure)} bytes, limits {least} to {most}" for figure, least, most in limits(name)
               if not least <= found.get(figure, -1) <= most]
    assert not outside, "; ".join(outside)
    return max(now[figure] for figure in SUMS), now["available"]
