#!/usr/bin/env python3
"""The tables of the book that a program makes: an mdBook preprocessor, which docs/book.toml names.

    tests/book/tables.py                prints all tables
    tests/book/tables.py supports html  exit code 0: the preprocessor serves every renderer

A page holds a line `{{table: NAME}}` for each table. A table comes from the source (parameters, faults, CAN objects
and frames, commands, rules, JSON Schemas, statements of tests, bus load), or from a file of figures (`NAME.tsv`): of
target/figures/, where the tests write what they measure (`MEASURED`), else of git. Where a test has not run, the page names the
command that measures.

The lists in the source are macros of one line per entry. They are found by a name that stands in them, because files and
types may be renamed while the names on the bus may not.

A file of figures has blocks, separated by empty lines. A block is a title after `# `, a line of column names, and rows,
with tabs between cells. A line without a tab is a paragraph. `NAME` is such a file without its suffix; `NAME/TITLE` is
one of its blocks, `NAME?COLUMN=VALUE` the rows of all blocks with this value, each with the title of its block.
"""

import json
import pathlib
import re
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "eds"))
import joint_eds

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
BOOK = ROOT / "docs" / "src"
FIGURES = joint_eds.TARGET / "figures"
PLACE = re.compile(r"^\{\{table: ([^}]+)\}\}$", re.M)


def sources():
    listed = subprocess.run(["git", "ls-files", "*.rs"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return [(ROOT / name).read_text() for name in listed.split() if "/src/" in name and (ROOT / name).exists()]


def block(texts, opening, entry):
    """Body of the macro call that starts with `opening` and holds `entry`."""
    for text in texts:
        for found in re.finditer(rf"^(?:[\w:]+::)?{opening}! \{{\n(.*?)^\}}", text, re.S | re.M):
            if entry in found[1]:
                return found[1]
    raise AssertionError(f"no {opening}! list with {entry}")


def entries(body):
    """Doc comment and text of every entry, which ends with a semicolon."""
    for found in re.finditer(r"((?:^ *///.*\n)+)(?: *#\[.*\n)*((?:^ *(?!///).*\n)*?^ *.*;) *\n", body, re.M):
        doc = " ".join(line.strip().removeprefix("///").strip() for line in found[1].splitlines())
        yield doc, " ".join(found[2].split())


def number(text):
    """A Rust literal, in the shortest form that a reader knows."""
    text = text.strip().replace("_", "")
    if text.endswith("ANY") or text.endswith("f64::MAX"):
        return "any"
    try:
        value = float(text.removesuffix("f32").removesuffix("f64"))
    except ValueError:
        # A named constant.
        return "last column" if "COLUMN" in text else text
    return f"{value:.6g}".replace("e+0", "e").replace("e-0", "e-").replace("e+", "e")


def cell(text):
    """A cell of a table: identifiers of the source become parameter names."""
    snake = lambda found: "`" + re.sub(r"(?<!^)(?=[A-Z])", "_", found[1]).lower() + "`"
    text = re.sub(r"\[?`([A-Z][a-z]\w+)`\]?", snake, text)
    return re.sub(r"\[(`[^`]+`)\](?:\([^)]*\))?", r"\1", text).replace("|", "\\|")


def rows(head, lines):
    return "\n".join([f"| {' | '.join(head)} |", "|" + "---|" * len(head), *(f"| {' | '.join(line)} |" for line in lines)])


def friction(texts):
    lines = []
    constants = {"TINY": "1e-9"}
    for doc, text in entries(block(texts, "parameters", '"coulomb_torque"')):
        name, unit, _, lower, upper, default = (part.strip() for part in text.rstrip(";").split("=", 1)[1].split(","))
        lower, upper = constants.get(lower, lower), constants.get(upper, upper)
        unit = unit.strip('"')
        lines.append([f"`{name.strip(chr(34))}`", "–" if unit == "1" else unit, "any" if number(lower) == "any" else f"{number(lower)} to {number(upper)}", number(default), cell(doc)])
    return rows(["parameter", "unit", "range", "default", "meaning"], lines)


def fields(entry):
    def made(texts):
        lines = []
        for doc, text in entries(block(texts, "named_fields", entry).split("pub struct", 1)[1].split("{\n", 1)[1]):
            found = re.match(r"(\w+): \w+ = (\S+?)(?:, (\S+?)\.\.=(\S+?), \".*\")?;", text)
            span = f"{number(found[3])} to {number(found[4])}" if found[3] else "see below"
            lines.append([f"`{found[1]}`", number(found[2]), span, cell(doc)])
        head = ["parameter", "default", "range", "meaning, unit"]
        if all(line[2] == "see below" for line in lines):
            head, lines = [head[0], head[1], head[3]], [[line[0], line[1], line[3]] for line in lines]
        return rows(head, lines)

    return made


def codes(is_fault):
    effects = {"Stops": "stops", "DropsCompensation": "no compensation", "Limits": "limits"}

    def made(texts):
        lines = []
        pattern = r"(\d+) \w+ \"([\w-]+)\" (0x\w+) \[\w*\] (\w+) (\w+) (\d+) (\d+)\s+\"(.*?)\",\s+\"(.*?)\";"
        for found in re.finditer(pattern, block(texts, "codes", '"command-timeout"'), re.S):
            number_, name, emergency, effect, watched, _, _, raised, cleared = found.groups()
            if (int(number_) <= 32) != is_fault:
                continue
            kind = ("always" if watched == "Always" else "while armed") if is_fault else effects[effect]
            lines.append([number_, f"`{name}`", emergency, kind, cell(raised), cell(cleared)])
        head = ["no.", "name", "EMCY code", "watched" if is_fault else "effect", "raised by", "cleared by"]
        return rows(head, lines)

    return made


def flags(texts):
    """Bits of the compensator's flags."""
    text = next(text for text in texts if "const VELOCITY_INVALID = 1 << 1;" in text)
    lines = []
    for found in re.finditer(r"((?: *///.*\n)+) *const (\w+) = 1 << (\d+);", text):
        doc = " ".join(line.strip().removeprefix("///").strip() for line in found[1].splitlines())
        lines.append([found[3], f"`{found[2]}`", cell(doc)])
    return rows(["bit", "flag", "meaning"], lines)


def text_with(texts, place):
    return next(text for text in texts if place in text)


def sentence(doc):
    """The paragraphs of a comment as one text."""
    lines = [line.strip().removeprefix("///").strip() for line in doc.splitlines()]
    return ". ".join(paragraph.replace("\n", " ") for paragraph in "\n".join(lines).split("\n\n"))


def commands(texts):
    """Commands of host-sim by the enumeration of the command line. One that a feature adds has two entries."""
    body = text_with(texts, "enum Command {").split("enum Command {\n", 1)[1].split("\n}\n", 1)[0]
    found = {}
    for doc, name in re.findall(r"((?: *///.*\n)+)(?: *#\[.*\n)* *(\w+)\(", body):
        found.setdefault(name.lower(), sentence(doc))
    return rows(["command", "does"], [[f"`{name}`", cell(doc)] for name, doc in sorted(found.items())])


def options(name):
    """Options of a structure of the command line."""

    def made(texts):
        body = text_with(texts, f"pub struct {name} {{").split(f"pub struct {name} {{\n", 1)[1].split("\n}\n", 1)[0] + "\n"
        lines = []
        for found in re.finditer(r"((?: *///.*\n)+)((?: *#\[(?:.*\n)*?.*?\]\n)?) *(?:pub )?(\w+): .*,\n", body):
            doc, attribute, field = found.groups()
            if "arg(long" not in attribute:
                continue
            long = re.search(r'long = "([^"]+)"', attribute)
            value = re.search(r'value_name = "([^"]+)"', attribute)
            default = re.search(r'default_value = "([^"]+)"', attribute)
            option = f"--{long[1] if long else field.replace('_', '-')}" + (f" {value[1]}" if value else "")
            lines.append([f"`{option}`", cell(sentence(doc)) + (f"; default {default[1]}" if default else "")])
        return rows(["option", "meaning"], lines)

    return made


def rules(texts):
    """Hard rules of the diagnosis: what each requires, its limit and the reason for it."""
    pattern = r'((?:^///.*\n)+)pub const \w+: Rule = Rule \{\s+name: "(.*?)",\s+limit: (\S+),\s+reason: "((?:.*\\\n)*.*?)",'
    lines = []
    for doc, name, limit, reason in re.findall(pattern, text_with(texts, "pub const SHORT_WAVE: Rule"), re.M):
        value = "–" if "NAN" in limit else number(limit)
        lines.append([f"`{name}`", cell(sentence(doc)), value, cell(re.sub(r"\\\n\s*", "", reason))])
    return rows(["rule", "requirement", "limit", "what the limit is"], lines)


def tests_that_state(kind):
    """Statement, bound and name of each test whose documentation has a line of this kind, by statement."""
    listed = subprocess.run(["git", "grep", "-l", f"/// {kind}: ", "--", "*.rs"], cwd=ROOT, capture_output=True, text=True).stdout
    pattern = rf"^ */// {kind}: (.*?)\.(?: Bound: (.*?)\.)?\n(?: *///.*\n| *#\[.*\n)* *fn (\w+)"
    found = [statement for name in listed.split() for statement in re.findall(pattern, (ROOT / name).read_text(), re.M)]
    return [[cell(what), cell(bound) or "–", f"`{test}`"] for what, bound, test in found]


def attacks(_):
    """What an attacker on the bus can do: the tests whose documentation states an attack."""
    return rows(["an attacker can", "bounded by", "test"], tests_that_state("Attack"))


def defences(_):
    """What an attacker on the bus cannot do: the tests whose documentation states what they exclude."""
    return rows(["an attacker cannot", "test"], [[what, test] for what, _, test in tests_that_state("Excluded")])


TYPES = {1: "bool", 2: "i8", 3: "i16", 4: "i32", 5: "u8", 6: "u16", 7: "u32", 8: "f32", 9: "text", 15: "bytes"}


def value_kind(values):
    """Type and access of an entry of the EDS; its level stands in a comment before it."""
    access = values.get("AccessType", "")
    level = " **service**" if values.get(";AccessLevel") == "service" else ""
    return TYPES.get(int(values.get("DataType", "0"), 16), "?"), access + level


def objects(_):
    """One row for each object of the EDS; its entries are listed, numbered ones together."""
    found = {}
    for section in joint_eds.write().read_text().split("\n\n"):
        head = re.search(r"^\[([0-9A-F]{4})(?:sub([0-9A-F]+))?\]", section, re.MULTILINE)
        if not head:
            continue
        values = dict(line.split("=", 1) for line in section.splitlines() if "=" in line)
        found.setdefault(head[1], {})[int(head[2], 16) if head[2] else None] = values
    lines = []
    for index, subs in sorted(found.items()):
        name = subs[None]["ParameterName"]
        parts = []
        for sub, values in sorted((key, value) for key, value in subs.items() if key):
            base = re.sub(r"_\d+$", "", values["ParameterName"])
            kind = value_kind(values)
            if parts and parts[-1][0] == base and parts[-1][3] == kind:
                parts[-1][2] = sub
            else:
                parts.append([base, sub, sub, kind])
        if not parts:
            values = subs[None]
            parts = [[None, 0, 0, value_kind(values)]]
        kinds = {part[3] for part in parts}
        shared = " ".join(kinds.pop()) if len(kinds) == 1 else ""

        def words(part):
            base, first, last, kind = part
            place = f":{first}" if first == last else f":{first}–{last}"
            return f"{place} `{base}`" + ("" if shared else f" ({' '.join(kind)})")

        listed = ", ".join(words(part) for part in parts if part[0])
        if 0x2021 <= int(index, 16) <= 0x2026:
            listed = f":1–{parts[-1][2]}, in the order of [the table](parameters.md)"
        lines.append([f"{index}h", f"`{name}`", shared or "mixed", listed or "–"])
    return rows(["index", "object", "type, access", "entries"], lines)


def record(field):
    """Entries of the object whose record has this field: sub-index, name and meaning."""

    def made(texts):
        body = block(texts, "record", f" {field}: ").split("{\n", 1)[1]
        lines = [[f":{place}", f"`{text.split(':')[0]}`", cell(doc)] for place, (doc, text) in enumerate(entries(body), 1)]
        assert len(lines) == body.count(";\n"), f"an entry beside {field} has no comment"
        return rows(["entry", "name", "meaning"], lines)

    return made


def frames(_):
    """Process frames of a joint by its DBC file, which has those of joint 1: identifier, sender, signals and comment."""
    text = (ROOT / "compensator-core" / "joint.dbc").read_text()
    comments = dict(re.findall(r'^CM_ BO_ (\d+) "(.*)";$', text, re.M))
    lines = []
    for number_, name, sender, body in re.findall(r"^BO_ (\d+) (\w+): \d+ (\w+)\n((?: SG_ .*\n)*)", text, re.M):
        signals = re.findall(r'^ SG_ (\w+).*? : .* "(.*?)" \w+$', body, re.M)
        # More than these are the bits of one word of flags, which has its own table.
        listed = ", ".join(f"{signal} {unit}".strip() for signal, unit in signals) if len(signals) < 8 else "flags, sequence"
        identifier = f"{int(number_):03X}h" if int(number_) == 0x80 else f"{int(number_) - 1:03X}h + node"
        lines.append([identifier, name, "to the joint" if sender == "Host" else "from the joint", listed, cell(comments[number_])])
    return rows(["identifier", "frame", "direction", "content", "meaning"], lines)


def schema_keys(name):
    """Keys of a result file that its JSON Schema describes."""

    def described(node, path):
        for key, value in node.get("properties", {}).items():
            place = f"{path}.{key}" if path else key
            if "description" in value:
                yield [f"`{place}`", cell(value["description"])]
            yield from described(value, place)
        for part, suffix in (("items", "[]"), ("additionalProperties", ".*")):
            if isinstance(node.get(part), dict):
                yield from described(node[part], path + suffix)

    def made(_):
        schema = json.loads((ROOT / "host-sim" / "schemas" / f"{name}.schema.json").read_text())
        return rows(["key", "meaning"], described(schema, ""))

    return made


def documented_names(entry):
    """Names of a list whose entries `Type = "name" in file` have a comment: formula and meaning where it has both."""

    def made(texts):
        body = text_with(texts, entry)
        lines = []
        for doc, name in re.findall(r'((?: *///.*\n)+) *\w+ = (?:\d+, )?"([\w-]+)" in ', body):
            doc = " ".join(line.strip().removeprefix("///").strip() for line in doc.splitlines())
            formula, _, meaning = doc.partition(": ") if doc.startswith("`") and ": " in doc else ("–", "", doc)
            lines.append([f"`{name}`", cell(formula), cell(meaning.rstrip("."))])
        if all(line[1] == "–" for line in lines):
            return rows(["name", "meaning"], [[name, meaning] for name, _, meaning in lines])
        return rows(["name", "formula", "meaning"], lines)

    return made


def frame_bits(data_bytes):
    """Longest classic frame with an 11-bit identifier, bits: 34 bits of head and checksum and the data can be stuffed,
    one bit after every four; 10 bits of trailer and 3 between two frames cannot."""
    stuffable = 34 + 8 * data_bytes
    return stuffable + (stuffable - 1) // 4 + 10 + 3


def fd_frame_seconds(data_bit_rate):
    """Longest CAN FD frame of 64 bytes with an 11-bit identifier and switched bit rate, s: 17 bits of head that can be
    stuffed, 9 bits of trailer and 3 between two frames at 1 Mbit/s. At the data bit rate: 5 bits of head and the data,
    which can be stuffed; stuff count and checksum of 25 bits with 7 fixed stuff bits; a delimiter."""

    def stuffed(bits):
        return bits + (bits - 1) // 4

    return (stuffed(17) + 9 + 3) / BIT_RATE + (stuffed(5 + 8 * 64) + 25 + 7 + 1) / data_bit_rate


# SYNCs between two frames of the other transmit PDOs than Motion: SLOW_TYPE of the driver.
SLOW_SYNCS = 10
# Bytes of the frames in a cycle: of the SYNC, from the master to a joint, from a joint, and from a joint at every
# SLOW_SYNCS-th SYNC.
CYCLES = {
    # SYNC with counter, receive PDO 1, transmit PDO 4 (Motion), transmit PDOs 1, 2, 3 and 5.
    "bus-load-default": (1, [8], [8], [8] * 4),
    # The same with all of them at each SYNC.
    "bus-load-whole": (1, [8], [8] * 5, []),
    # Plain SYNC, the PDOs of tests/eds/bus/drive.yml that are sent at each SYNC.
    "bus-load-drive": (0, [3, 6], [3, 8], []),
    # Plain SYNC; controlword and target torque, statusword, torque and position.
    "bus-load-least": (0, [4], [8], []),
}
# Data bit rates of the cycle with one CAN FD frame from a joint, bit/s.
FD_CYCLES = {"bus-load-fd-2": 2_000_000, "bus-load-fd-5": 5_000_000}
BIT_RATE = 1_000_000
RATES_HZ = [100, 200, 500, 1000]
HEARTBEATS_HZ = 10


def bus_load(name):
    """Share of the time at 1 Mbit/s that the frames of a cycle and the heartbeats take, for 1 to 8 joints."""

    def made(_):
        sync, received, sent, slow = CYCLES["bus-load-default" if name in FD_CYCLES else name]
        if name in FD_CYCLES:
            of_joint = sum(map(frame_bits, received)) / BIT_RATE + fd_frame_seconds(FD_CYCLES[name])
        else:
            of_joint = (sum(map(frame_bits, received + sent)) + sum(map(frame_bits, slow)) / SLOW_SYNCS) / BIT_RATE
        lines = []
        for joints in range(1, 9):
            cycle = frame_bits(sync) / BIT_RATE + joints * of_joint
            heartbeats = HEARTBEATS_HZ * (joints + 1) * frame_bits(1) / BIT_RATE
            loads = [100 * (rate * cycle + heartbeats) for rate in RATES_HZ]
            lines.append([str(joints)] + ["–" if load > 100 else f"{load:.0f} %" for load in loads])
        return rows(["joints"] + [f"{rate} Hz" for rate in RATES_HZ], lines)

    return made


MADE = {
    "friction": friction,
    "motor": fields("pole_pairs:"),
    "thresholds": fields("command_timeout_us:"),
    "compensator": fields("slew_limit_nm_per_s:"),
    "envelope": fields("campaign_max_h:"),
    "watch": fields("band_nm:"),
    "sensors": fields("strain_zero:"),
    "faults": codes(True),
    "limits": codes(False),
    "flags": flags,
    "laws": documented_names('"lugre-asymmetric" in lugre_asymmetric'),
    "terms": documented_names('"radial-force-coulomb" in radial_force_coulomb'),
    "objects": objects,
    "frames": frames,
    "object-200Ah": record("wiring_crc"),
    "object-200Bh": record("outside_count"),
    "object-200Ch": record("dead_time_current_a"),
    "object-2027h": record("staged_crc"),
    "object-2030h": record("release_delay_ms"),
    "object-2032h": record("difference_rad"),
    "object-2040h": record("rollback_counter"),
    "object-2041h": record("wrong_responses"),
    "object-2042h": record("deadline_ms"),
    "object-2043h": record("set_before_crc"),
    "object-2044h": record("least_gain_permille"),
    "commands": commands,
    "options-output": options("OutputArguments"),
    "options-bus": options("BusArguments"),
    "options-log": options("LogArguments"),
    "options-fit": options("FitArguments"),
    "options-scope": options("ScopeArguments"),
    "options-tune": options("TuneArguments"),
    "options-motion": options("MotionArguments"),
    "options-move": options("RequestedMotion"),
    "rules": rules,
    "attacks": attacks,
    "defences": defences,
    **{f"{name}.json": schema_keys(name) for name in ("compare", "diagnosis", "fleet", "trend", "tune")},
    **{name: bus_load(name) for name in CYCLES | FD_CYCLES},
}


# Figures that no file of git has: the command that writes them to target/figures/.
CLOSED_LOOP = "cargo test -p joint-rig --test all closed_loop::"
MEASURED = {
    "closed-loop": CLOSED_LOOP,
    **dict.fromkeys(("interrupt-cycles", "interrupt-cycles-esc1", "pdo-timing"), "tests/emulator/run"),
    **dict.fromkeys(("tuning", "adaptation"), "tests/emulator/run --all"),
}


def figure_file(name):
    """Text of the file of figures with this name, which a test has measured, else that in git; None if there is neither."""
    path = FIGURES / f"{name}.tsv"
    if path.exists():
        return path.read_text()
    if name in MEASURED:
        return None
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", f"*/{name}.tsv"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    names = listed.split()
    assert len(names) == 1, f"{name}.tsv: expected one file, found {names}"
    return (ROOT / names[0]).read_text()


def blocks_of(text):
    """Lines of each block of a file of figures."""
    return [block.splitlines() for block in text.strip("\n").split("\n\n")]


def figures(name):
    """Markdown of a file of figures, or of one of its blocks without the title."""
    name, _, title = name.partition("/")
    text = figure_file(name)
    if text is None:
        return f"*Not measured in this work tree: `{MEASURED[name]}`. A release has the figures.*"
    blocks = blocks_of(text)
    if title:
        blocks = [block[1:] for block in blocks if block[0] == f"# {title}"]
        assert len(blocks) == 1, f"{name}.tsv: {len(blocks)} blocks with the title {title!r}"
    return "\n\n".join(map(figure_block, blocks))


def selected_rows(selection):
    """Rows of all blocks of `NAME?COLUMN=VALUE`, without the column; an empty first cell repeats the one above."""
    name, column, value = re.fullmatch(r"(.+)\?(.+)=(.+)", selection).groups()
    text, lines = figure_file(name), []
    if text is None:
        return figures(name)
    for title, head, *data in (block.splitlines() for block in text.strip("\n").split("\n\n")):
        names, above = head.split("\t"), ""
        place = names.index(column)
        for line in data:
            cells = line.split("\t")
            above = cells[0] = cells[0] or above
            if cells[place].strip("*") == value:
                lines.append([title.removeprefix("# "), *cells[:place], *cells[place + 1 :]])
    assert lines, f"no row with {column} = {value}"
    return rows(["block", *names[:place], *names[place + 1 :]], lines)


def figure_block(lines):
    parts, table = [], []
    for line in lines:
        if line.startswith("# "):
            parts.append(f"#{line}")
        elif "\t" in line:
            # Text such as `Compensator<f32>`, which is no tag of HTML.
            table.append([cell if "`" in cell else cell.replace("<", "&lt;") for cell in line.split("\t")])
        else:
            parts.append(line)
    if table:
        assert all(len(row) == len(table[0]) for row in table), f"rows of different length: {table[0]}"
        parts.append(rows(table[0], table[1:]))
    return "\n\n".join(parts)


def closed_loop_rows(text):
    """Rows of each block by its title: procedure, quantity, result, limits, met. A row without a procedure has that above."""
    blocks = {}
    for title, _, *lines in blocks_of(text):
        above = ""
        for line in lines:
            procedure, *rest = line.split("\t")
            above = procedure or above
            blocks.setdefault(title, []).append((above, *rest))
    return blocks


def closed_loop():
    """Results of the library with those of the image beside them, which may have limits of its own."""
    library = figure_file("closed-loop")
    if library is None:
        return figures("closed-loop")
    image = FIGURES / "closed-loop-image.tsv"
    by_image = closed_loop_rows(image.read_text()) if image.exists() else {}
    parts = []
    for title, lines in closed_loop_rows(library).items():
        found = {(procedure, quantity): rest for procedure, quantity, *rest in by_image.get(title, [])}
        table, above = [], None
        for procedure, quantity, result, limits, met in lines:
            on_image, own_limits, met_by_image = found.get((procedure, quantity), ("–", limits, met))
            limits += f"; image {own_limits}" if own_limits != limits else ""
            met = met if met_by_image == met else f"{met}; image {met_by_image}"
            table.append(["" if procedure == above else procedure, quantity, result, on_image, limits, met])
            above = procedure
        parts += [f"#{title}", rows(["procedure", "quantity", "library", "image", "limits", "met"], table)]
    return "\n\n".join(parts)


def made(name, texts):
    """Markdown of the table with this name."""
    if "?" in name:
        return selected_rows(name)
    if name == "closed-loop":
        return closed_loop()
    return MADE[name](texts) if name in MADE else figures(name)


def fill(text, texts):
    """Replaces the places of tables in a page."""
    return PLACE.sub(lambda found: made(found[1], texts), text)


def fill_chapters(items, texts):
    for item in items:
        if isinstance(item, dict) and "Chapter" in item:
            chapter = item["Chapter"]
            chapter["content"] = fill(chapter["content"], texts)
            fill_chapters(chapter["sub_items"], texts)


def preprocess():
    """Fills the book that mdBook writes to the standard input."""
    _, book = json.load(sys.stdin)
    fill_chapters(book.get("items", book.get("sections", [])), sources())
    json.dump(book, sys.stdout)


def main():
    if sys.argv[1:2] == ["supports"]:
        return
    if not sys.stdin.isatty():
        preprocess()
        return
    for name in MADE:
        print(f"## {name}\n\n{made(name, sources())}\n")


if __name__ == "__main__":
    main()
