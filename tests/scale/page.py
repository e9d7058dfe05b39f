"""The measured cost of a fleet, of which the build of the book makes docs/src/reference/fleet-scale.md: written, read, checked."""

import datetime
import pathlib

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
FILE = ROOT / "tests" / "scale" / "fleet-scale.tsv"

#: Joints of the extrapolation.
FLEET = 100_000
#: Joints of the small fleets for the time of an engine.
NUMBERS = (40, 200, 2000)
#: Goals: share of the shortest diagnosis that an engine may take for a joint, memory of a worker in MB, and size of the page of
#: ten thousand rows in MB.
LIMITS = {"overhead": 0.1, "memory": 500, "page": 10}
#: Goal for the time until a browser shows that page, s. It is reported but not checked, because it depends on the machine's load.
BROWSER_GOAL_S = 10
#: Factors by which a new measurement may differ from the file, either way: times of another machine, and sizes.
BANDS = {"time": 3.0, "size": 1.5}


def digits(number):
    """Formats a number with three digits."""
    if number is None:
        return "not measured"
    return f"{number:.3g}" if abs(number) < 100 else f"{number:,.0f}"


def table(title, header, rows):
    return [f"# {title}", *("\t".join(map(str, line)) for line in (header, *rows)), ""]


def emit(figures):
    """Returns the text of the file: a block of a title, column names and rows for each table."""
    lengths = sorted(figures["lengths"].values(), key=lambda one: one["rows"])
    one_joint = [[f"{one['rows']:,} rows", digits(mean(one["seconds"])), digits(max(one["seconds"]))] for one in lengths]
    engines = [engine_row(figures, name, title) for name, title in (("local", "local"), ("dask", "Dask"))]
    text = [
        *table("Measurement", ["condition", "state"], conditions(figures)),
        *table("One joint", ["log", "mean (s)", "largest (s)"], one_joint),
        *table("Engines", ["engine", *(f"{number:,} joints (s)" for number in NUMBERS), "one joint of 2,000 (ms)", "memory (MB)"], engines),
        *table("Second call and page", ["quantity", "value"], other_rows(figures)),
        *table(
            f"{FLEET:,} joints",
            ["log", "cores × time (h)", "on 64 cores (h)", "Dask's scheduler (h)", "results (GB)", "second call on one core, at most (h)"],
            [extrapolated(figures, one) for one in lengths],
        ),
    ]
    return "\n".join(text).rstrip("\n") + "\n"


def conditions(figures):
    is_busy = figures["load"] > 0.5 * figures["cores"]
    busy = " (other work shared the cores: all times but processor times are too long)" if is_busy else ""
    return [
        ["date", str(datetime.date.today())],
        ["machine", f"{figures['machine']}, {figures['cores']} cores"],
        ["load before", f"{figures['load']:.1f}{busy}"],
        ["versions", ", ".join(f"{name} {version}" for name, version in figures["versions"].items())],
        ["joints", f"{figures['joints']}, simulated, of three runs each at 100 Hz"],
        ["workers of an engine", str(figures["workers"])],
        ["start of the local cluster", f"{digits(figures['engines']['dask']['start_s'])} s"],
    ]


def mean(values):
    return sum(values) / len(values)


def per_joint_s(figures, engine):
    """Returns the time of an engine for one more joint, s: from the smallest and the largest fleet."""
    times = figures["engines"][engine]["overhead"]
    few, many = NUMBERS[0], NUMBERS[-1]
    return max(times[str(many)] - times[str(few)], 0.0) / (many - few)


def engine_row(figures, name, title):
    times = figures["engines"][name]["overhead"]
    milliseconds = 1000 * times[str(NUMBERS[-1])] / NUMBERS[-1]
    return [title, *(digits(times[str(number)]) for number in NUMBERS), digits(milliseconds), digits(figures[f"{name}_peak_mb"])]


def other_rows(figures):
    page = figures["page"]
    return [
        [f"first call, {figures['joints']} joints, {figures['workers']} workers (s)", digits(figures["wall_s"])],
        ["second call, all results exist (s)", digits(figures["resume_s"])],
        ["result files of one joint (kB)", digits(figures["result_bytes"] / 1e3)],
        [f"`fleet.html` and `fleet.parquet` of {page['rows']:,} rows (s)", digits(page["seconds"])],
        [f"size of `fleet.html` of {page['rows']:,} rows, of which the charts' script is 4.7 (MB)", digits(page["fleet.html"] / 1e6)],
        [f"size of `fleet.parquet` of {page['rows']:,} rows (MB)", digits(page["fleet.parquet"] / 1e6)],
        [f"Chromium opens the page; the goal is at most {BROWSER_GOAL_S} (s)", digits(page["browser_s"])],
        ["its search shows the rows of a name (s)", digits(page["search_s"])],
    ]


def extrapolated(figures, one):
    hours = FLEET * mean(one["seconds"]) / 3600
    # The second call hashes each log and reads its row; its workers share the work. The start of the processes is included.
    again = FLEET * figures["resume_s"] * figures["workers"] / figures["joints"] / 3600
    scheduler = FLEET * per_joint_s(figures, "dask") / 3600
    results = FLEET * figures["result_bytes"] / 1e9
    return [f"{one['rows']:,} rows", *map(digits, (hours, hours / 64, scheduler, results, again))]


def cells(text):
    """Returns the numbers of a file by the names of their row and column; NaN for one that was not measured."""
    found, header = {}, []
    for line in text.splitlines():
        parts = line.split("\t")
        if len(parts) == 1:
            continue
        if parts[0] in ("condition", "log", "engine", "quantity"):
            header = parts
        elif header[0] != "condition":
            for column, part in zip(header[1:], parts[1:], strict=True):
                number = float("nan") if part == "not measured" else float(part.replace(",", ""))
                found[parts[0], column] = number
    return found


def violations(text):
    """Returns what the file has beyond the goals that are checked, a line each."""
    found = cells(text)
    shortest = min(value for (_, column), value in found.items() if column == "mean (s)")
    checks = [
        ("time of an engine (s)", max(found[name, "one joint of 2,000 (ms)"] for name in ("local", "Dask")) / 1000, LIMITS["overhead"] * shortest),
        ("memory (MB)", max(found[name, "memory (MB)"] for name in ("local", "Dask")), LIMITS["memory"]),
    ]
    (size,) = [value for (row, _), value in found.items() if row.startswith("size of `fleet.html`")]
    checks.append(("size of `fleet.html` (MB)", size, LIMITS["page"]))
    return [f"{name}: {value:g}, goal at most {limit:g}" for name, value, limit in checks if value > limit]


def differences(text, other):
    """Returns what differs between two files by more than the band, a line each."""
    now, before = cells(text), cells(other)
    lines = [f"{' '.join(key)}: only in one of the files" for key in now.keys() ^ before.keys()]
    for key in now.keys() & before.keys():
        is_size = any(unit in " ".join(key) for unit in ("MB", "kB", "GB"))
        band = BANDS["size" if is_size else "time"]
        if before[key] > 0 and not 1 / band <= now[key] / before[key] <= band and now[key] == now[key]:
            lines.append(f"{' '.join(key)}: {now[key]:g}, in the file {before[key]:g}")
    return sorted(lines)
