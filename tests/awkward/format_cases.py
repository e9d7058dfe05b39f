"""Packed logs, JSON lines, clocks with zones, separators of thousands, and rows in another order."""

import datetime
import gzip
import io
import json
import random
import zipfile

from cases import CASES, NOON, case, error
from joint import ROWS, RUNS, joint, on_one_clock, rows, table
from recordings import recording

PLAIN = table(joint())
WHOLE = {"runs": RUNS, "rows": RUNS * ROWS, "rows_left_out": 0}
SPEED = [-2.9999, 3.0]

# ---- packed


def packed(text):
    return gzip.compress(text.encode() if isinstance(text, str) else text, mtime=0)


def zipped(files, method=zipfile.ZIP_DEFLATED):
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", method) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return data.getvalue()


case("gzip", {"log.csv.gz": packed(PLAIN)}, data=WHOLE, expected_lines=["the log is log.csv in the archive"])
case("gzip in two parts", {"log.csv.gz": packed(PLAIN[:9000]) + packed(PLAIN[9000:])}, data=WHOLE)
case("gzip with a name that hides it", {"log.csv": packed(PLAIN)}, data=WHOLE)
case("zip", {"log.zip": zipped({"logs/monday.csv": PLAIN})}, data=WHOLE, expected_lines=["the log is logs/monday.csv in the archive"])
case(
    "zip without compression, and the files of macOS",
    {"log.zip": zipped({"a.csv": PLAIN, "__MACOSX/._a.csv": "x", ".DS_Store": "x"}, zipfile.ZIP_STORED)},
    data=WHOLE,
)
case(
    "a recording of ROS 2 in gzip",
    {"log.mcap.gz": packed(recording())},
    "--columns velocity_rad_s=/joint_states.velocity[elbow],torque_nm=/joint_states.effort[elbow]",
    data=WHOLE,
)
case(
    "the columns of a recording of ROS 2 are asked for",
    {"log.mcap": recording()},
    "--columns help",
    output=["log.mcap: 11 columns", "velocity_rad_s=/joint_states.velocity[#]", "torque_nm=/joint_states.effort[#]"],
)
error(
    "words for a fifth of the velocities, in gzip",
    {"log.csv.gz": packed(table(joint(velocity=("velocity_rad_s", lambda r: "off" if r["i"] % 5 == 3 else r["v"]))))},
    'log.csv.gz: row 5, column velocity_rad_s: found "off", expected a finite number (240 of 1200 rows are bad, this is the '
    "first; at most 5 % may be; --bad-rows 20% leaves them out)",
)
error(
    "two files in a zip archive",
    {"log.zip": zipped({"monday.csv": PLAIN, "tuesday.csv": PLAIN})},
    "log.zip: found a zip archive of 2 files (monday.csv, tuesday.csv), expected one file in it: unzip -p log.zip monday.csv > "
    "monday.csv",
)
error("an empty zip archive", {"log.zip": zipped({"logs/": ""})}, "log.zip: found a zip archive without a file, expected one log in it")
error(
    "a damaged zip archive",
    {"log.zip": zipped({"a.csv": PLAIN})[:-30]},
    "log.zip: found a zip archive that cannot be read (invalid Zip archive: Could not find EOCD), expected an intact zip "
    "archive without a password",
)
error(
    "a gzip archive that was cut off",
    {"log.csv.gz": packed(PLAIN)[:2000]},
    "log.csv.gz: found a damaged gzip archive (incomplete deflate stream), expected an intact gzip archive",
)
error(
    "a gzip archive in a gzip archive",
    {"log.csv.gz.gz": packed(packed(PLAIN))},
    "log.csv.gz.gz: found a gzip archive in the archive, expected a log that is packed once: gunzip log.csv.gz",
)
error(
    "a tar archive in gzip",
    {"log.tgz": packed(b"log.csv".ljust(257, b"\0") + b"ustar\x0000" + bytes(247))},
    "log.tgz: found a tar archive in the archive, expected a CSV or Parquet file: tar -xf log.tgz",
)

# ---- JSON lines


def json_lines(make):
    return "\n".join(json.dumps(make(row)) for row in rows()) + "\n"


FLAT = json_lines(lambda r: {"run": r["run"], "time_s": r["t"], "velocity_rad_s": r["v"], "torque_nm": r["tau"], "kp": 3 + r["run"]})
case("JSON lines", {"log.jsonl": FLAT}, data=WHOLE, ranges={"kp": [3, 5]})
case(
    "JSON lines with nested objects",
    json_lines(lambda r: {"t": on_one_clock(r), "joint": {"state": {"v": [0.0, r["v"]]}, "tau": r["tau"]}}),
    "--columns time_s=t,velocity_rad_s=joint.state.v[1],torque_nm=joint.tau",
    data=WHOLE,
    ranges={"velocity_rad_s": SPEED},
)
case(
    "JSON lines of which some are cut off",
    FLAT.replace('{"run": 1, "time_s": 0.5, ', '{"run": 1, "time', 1),
    expected_lines=['  log.csv: row 451, column (all): found "{"run": 1, "time"velocity_rad_s": 1.9991..", expected a JSON object'],
    data={"rows_left_out": 1},
)
error(
    "a document of JSON",
    json.dumps([{"time_s": row["t"], "velocity_rad_s": row["v"]} for row in rows(3, 1)]),
    "log.csv: found a JSON document, expected JSON lines, one object a row: jq -c '.[]' log.csv > log.jsonl",
)
error(
    "JSON lines with other names",
    json_lines(lambda r: {"t": r["t"], "q": {"d": r["v"]}, "effort": r["tau"]}),
    "log.csv: found only the columns t, q.d, effort, expected time_s and velocity_rad_s (or velocity_m_s) and torque_nm (or "
    "force_n) in the header, or --columns time_s=t,position_rad=q.d,torque_nm=effort",
)

# ---- clocks


def stamped(form):
    return table(joint(run=None, time=("time_s", lambda r: (NOON + datetime.timedelta(seconds=on_one_clock(r))).strftime(form))))


for form, origin in [
    ("%Y-%m-%d %H:%M:%S.%f CEST", "2024-05-01 10:00:00 UTC"),
    ("%Y-%m-%d %H:%M:%S.%f UTC", "2024-05-01 12:00:00 UTC"),
    ("%Y-%m-%d %H:%M:%S.%f Europe/Berlin", "2024-05-01 10:00:00 UTC"),
    ("%Y-%m-%dT%H:%M:%S.%f+02:00[Europe/Berlin]", "2024-05-01 10:00:00 UTC"),
    ("%Y-%m-%d %I:%M:%S.%f %p", "2024-05-01 12:00:00 UTC"),
    ("%I:%M:%S.%f %p", "12:00:00"),
]:
    case(f"dates as {NOON.strftime(form)}", stamped(form), data=WHOLE, expected_lines=[f"times count from {origin}"])
error(
    "a time zone of several countries",
    stamped("%Y-%m-%d %H:%M:%S CST"),
    'log.csv: row 2, column time_s: found "2024-05-01 12:00:00 CST", expected an offset such as +01:00: several time zones have '
    "this abbreviation (1200 of 1200 rows are bad, this is the first; at most 5 % may be)",
)
error(
    "a time zone nobody knows",
    stamped("%Y-%m-%d %H:%M:%S lab time").replace("lab time", "labtime"),
    'log.csv: row 2, column time_s: found "2024-05-01 12:00:00 labtime", expected an offset such as +01:00, UTC, or a zone such '
    "as Europe/Berlin (1200 of 1200 rows are bad, this is the first; at most 5 % may be)",
)

# ---- thousands


def thousands(group, point, by, quote=""):
    def value(x):
        text = f"{x:,.4f}".replace(",", "\0").replace(".", point).replace("\0", group)
        return f"{quote}{text}{quote}"
    return table(joint(torque=("tau", lambda r: value(1e5 * r["tau"])), velocity=("v", lambda r: value(1e5 * r["v"]))), by=by)


SCALED = "--columns torque_nm=tau:1e-5Nm,velocity_rad_s=v:1e-5rad/s"
case("thousands with commas in quotes", thousands(",", ".", ",", '"'), SCALED, data=WHOLE, ranges={"velocity_rad_s": SPEED},
     expected_lines=["commas inside numbers separate thousands"])
for name, group in [("spaces", " "), ("no-break spaces", "\u00a0"), ("apostrophes", "'")]:
    case(f"thousands with {name}", thousands(group, ",", ";").replace("0.", "0,"), SCALED, data=WHOLE,
         expected_lines=["spaces or apostrophes inside numbers separate thousands"], answers=True)
german = table(joint(
    time=("time_s", lambda r: f"{r['t']:.2f}".replace(".", ",")),
    torque=("tau", lambda r: f"{round(1e5 * r['tau']):,}".replace(",", ".") if r["i"] < 300
            else f"{1e5 * r['tau']:,.1f}".replace(",", "\0").replace(".", ",").replace("\0", ".")),
), by=";").replace("velocity_rad_s", "v")
german = "\n".join([german.split("\n")[0]] + [
    ";".join(cell.replace(".", ",") if at == 2 else cell for at, cell in enumerate(line.split(";"))) for line in german.split("\n")[1:]
])
case(
    "thousands with points that only later numbers show",
    german,
    "--columns torque_nm=tau:1e-5Nm,velocity_rad_s=v",
    data=WHOLE,
    expected_lines=["points inside numbers separate thousands", "commas inside numbers are decimal points"],
)
case(
    "addresses that look like thousands",
    table(joint(host=("host", lambda r: "192.168.100.200" if r["i"] == 200 else ""), kp=("kp", lambda r: "1.234"))),
    data=WHOLE,
    ranges={"kp": [1.234, 1.234], "time_s": [0, 3.99]},
)
error(
    "commas that may separate thousands or not",
    table(joint(torque=("tau", lambda r: f'"1,{100 + r["i"]}"'))),
    'log.csv: row 2, column tau: found "1,100", expected a number with a point, as 1234.5: this comma may separate thousands or '
    "be the decimal point (1200 of 1200 rows are bad, this is the first; at most 5 % may be)",
    "--columns torque_nm=tau",
)

# ---- rows in another order


def reordered(order, columns=None):
    lines = table(columns or joint()).splitlines()
    return "\n".join([lines[0]] + [lines[1 + at] for at in order]) + "\n"


shuffled = list(range(RUNS * ROWS))
random.Random(7).shuffle(shuffled)
case(
    "rows shuffled",
    reordered(shuffled),
    data=WHOLE,
    expected_lines=["of 1200 rows come after a later one: the rows are sorted by time"],
    ranges={"time_s": [0, 3.99]},
)
case(
    "rows in blocks",
    reordered([*range(250, 400), *range(250), *range(400, 1200)]),
    data=WHOLE,
    expected_lines=["250 of 1200 rows come after a later one: the rows are sorted by time"],
)
case(
    "rows shuffled without a run column",
    reordered(shuffled, joint(run=None, time=("time_s", lambda r: r["t"] + 4 * r["run"]))),
    data={"runs": 1, "rows": RUNS * ROWS, "rows_left_out": 0},
    expected_lines=["of 1200 rows come after a later one: the rows are sorted by time"],
)
case(
    "a few rows swapped by a network",
    reordered([at + {20: 1, 21: -1}.get(at % 60, 0) for at in range(RUNS * ROWS)]),
    data={"rows_left_out": 20, "runs": RUNS},
    expected_lines=["20 rows are left out as bad:"],
)

__all__ = ["CASES"]
