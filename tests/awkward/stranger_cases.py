"""Logs of drives, PLCs, historians and spreadsheets: dates, shares and counts, long tables, blanks, coarse clocks."""

from datetime import datetime, timedelta

from cases import RPM, case, error
from joint import ROWS, RUNS, joint, on_one_clock, rows, table

START = datetime(2024, 3, 14, 23, 59, 58)

# ---- dates and times


def stamp(form):
    """Returns the column of a time that `form` writes, of runs on one clock. %L stands for milliseconds."""
    def text(row):
        at = START + timedelta(seconds=row["t"] + 10 * row["run"])
        return at.strftime(form.replace("%L", f"{at.microsecond // 1000:03d}"))
    return text


def dated(form, **other):
    return table(joint(time=("Timestamp", stamp(form)), **other), by=";")


for name, form in [
    ("as PI writes it", "%d-%b-%y %H:%M:%S.%L"),
    ("as MATLAB writes it", "%d-%b-%Y %H:%M:%S.%L"),
    ("in German", "%d.%m.%Y %H:%M:%S.%L"),
    ("in German with a decimal comma", "%d.%m.%Y %H:%M:%S,%L"),
    ("of ISO 8601 with a decimal comma", "%Y-%m-%d %H:%M:%S,%L"),
    ("with milliseconds behind a colon", "%Y-%m-%d %H:%M:%S:%L"),
    ("without signs", "%Y%m%d %H%M%S.%L"),
    ("of IEC 61131-3", "DT#%Y-%m-%d-%H:%M:%S.%L"),
    ("of ctime", "%a %b %d %H:%M:%S.%L %Y"),
]:
    case(
        f"a date {name}",
        dated(form),
        "--columns time_s=Timestamp",
        expected_lines=["times count from 2024-03-14 23:59:58 UTC"],
        data={"rows": RUNS * ROWS, "rows_left_out": 0},
    )
for name, text in [
    ("past midnight with a decimal comma", stamp("%H:%M:%S,%L")),
    ("minutes past the hour", stamp("%M:%S.%L")),
    ("a duration of IEC 61131-3", lambda row: f"T#{row['i'] // 100}s{row['i'] % 100 * 10}ms"),
    ("a duration of pandas", lambda row: f"0 days 00:00:{row['t']:09.6f}"),
]:
    case(
        f"a time {name}",
        table(joint(time=("Uhrzeit", text)), by=";"),
        "--columns time_s=Uhrzeit",
        data={"rows": RUNS * ROWS, "rows_left_out": 0},
    )
case(
    "a column of dates and one of times",
    table({"Datum": stamp("%d.%m.%Y"), **joint(time=("Uhrzeit", stamp("%H:%M:%S,%L")))}, by=";"),
    "--columns time_s=Uhrzeit",
    expected_lines=["times count from 2024-03-14 23:59:58 UTC", "the dates of the times are from Datum"],
)
ALL = f"({RUNS * ROWS} of {RUNS * ROWS} rows are bad, this is the first; at most 5 % may be)"
AMERICAN = table(joint(time=("Timestamp", lambda row: f"03/04/2024 09:15:{row['t']:06.3f}")))
error(
    "a date with two readings",
    AMERICAN,
    'log.csv: row 2, column Timestamp: found "03/04/2024 09:15:00.000", expected an unambiguous date as 2024-04-03: day '
    f"and month may be exchanged, so give their order behind the column's name, :dmy or :mdy {ALL}",
    "--columns time_s=Timestamp",
)
case(
    "a date with its order given",
    AMERICAN,
    "--columns time_s=Timestamp:mdy",
    expected_lines=["times count from 2024-03-04 09:15:00 UTC"],
)
error(
    "a date in no known form",
    dated("%d/Foo/%Y %H:%M:%S"),
    'log.csv: row 2, column Timestamp: found "14/Foo/2024 23:59:58", expected seconds, or a date or time as 2024-03-14 '
    "09:15:02.015, 14.03.2024 09:15:02, 14-Mar-2024 09:15:02, 09:15:02.015, 15:02.0 or T#2s15ms " + ALL,
    "--columns time_s=Timestamp",
)

# ---- shares, currents and counts

for column, what, expected in [
    ("DRV.TORQUE(%)", "percent", "--columns 'torque_nm=DRV.TORQUE(%):%' with --rated-torque 1.2Nm, the torque of 100 %"),
    ("torque_pct", "percent", "--columns torque_nm=torque_pct:% with --rated-torque 1.2Nm, the torque of 100 %"),
    (
        "T [1/1000 of motor rated torque]",
        "per mille",
        "--columns 'torque_nm=T [1/1000 of motor rated torque]:0.1%' with --rated-torque 1.2Nm, the torque of 100 %",
    ),
    (
        "I [A]",
        "amperes",
        "the torque constant, from the motor's data sheet: --columns 'torque_nm=I [A]:A' with --torque-constant 0.105Nm/A, or "
        "--columns 'torque_nm=I [A]:0.105Nm'",
    ),
]:
    error(
        f"a torque {column}",
        table(joint(torque=(column, lambda row: row["tau"]))),
        f"log.csv: --columns torque_nm={column}: found a name in {what}, without a unit, expected {expected}",
        f"--columns 'torque_nm={column}'",
    )
case(
    "a torque in percent with the rated torque",
    table(joint(torque=("DRV.TORQUE(%)", lambda row: 100 * row["tau"] / 1.2))),
    "--columns 'torque_nm=DRV.TORQUE(%):%' --rated-torque 1.2Nm",
)
for column, factor in [("Vitesse (tr/min)", RPM), ("n [U/min]", RPM)]:
    case(
        f"a velocity {column}",
        table(joint(velocity=(column, lambda row, factor=factor: factor * row["v"]))),
        f"--columns 'velocity_rad_s={column}:rpm'",
    )
    error(
        f"a velocity {column} without its unit",
        table(joint(velocity=(column, lambda row: row["v"]))),
        f"log.csv: --columns velocity_rad_s={column}: found a name that ends in rpm, without a unit, expected "
        f"'velocity_rad_s={column}:rpm', or the unit of the column",
        f"--columns 'velocity_rad_s={column}'",
    )

# ---- long tables, blanks, text

error(
    "one column for two quantities",
    table(joint()),
    "log.csv: --columns torque_nm=velocity_rad_s: found the column of velocity_rad_s, expected a column for each quantity",
    "--columns velocity_rad_s=velocity_rad_s,torque_nm=velocity_rad_s",
)


def influx():
    """Rows of InfluxDB, one field after the other, each with its header."""
    lines = ["#group,false,false,false,true", "#datatype,string,long,dateTime:RFC3339,double", "#default,_result,,,"]
    for at, (field, key) in enumerate([("speed", "v"), ("torque", "tau")]):
        lines.append(",result,table,_time,_value,_field")
        for row in rows():
            t = on_one_clock(row)
            lines.append(f",,{at},2024-03-14T09:00:{t:09.6f}Z,{row[key]!r},{field}")
        lines.append("")
    return "\n".join(lines) + "\n"


case(
    "a long table of InfluxDB",
    influx(),
    "--columns velocity_rad_s=speed,torque_nm=torque",
    data={"runs": RUNS, "rows": RUNS * ROWS, "rows_left_out": 0},
    expected_lines=["the long table (one value a line: _field, _value) is read with a column for each name"],
)
error(
    "a long table without a known name",
    influx(),
    "log.csv: found only the columns _time, speed, torque, expected velocity_rad_s (or velocity_m_s) and torque_nm (or force_n) in "
    "the header, or --columns velocity_rad_s=speed,torque_nm=torque; the long table (one value a line: _field, _value) is read "
    "with a column for each name",
)
BLANKS = {"t": lambda row: on_one_clock(row), "dq": lambda row: row["v"], "tau": lambda row: row["tau"]}
BY_BLANKS = "time_s=t,velocity_rad_s=dq,torque_nm=tau"
case("a table of numpy with blanks", "# " + table(BLANKS, by=" "), f"--columns {BY_BLANKS}")
case("aligned columns", "  " + table(BLANKS, by="    ", end=" \r\n"), f"--columns {BY_BLANKS}")
case(
    "text in Windows-1252",
    table(joint(torque=("Couple (N·m)", lambda row: row["tau"])), by=";").encode("cp1252"),
    "--columns 'torque_nm=Couple (N·m)'",
    expected_lines=["the text is not UTF-8 and is read as Windows-1252"],
)

# ---- clocks

case(
    "a clock of a tenth of a second",
    table(joint(time=("time_s", lambda row: int(10 * row["t"] + 1e-6) / 10))),
    expected_lines=["1080 rows repeat the time stamp before them: the rows of a stamp are spread evenly up to the next"],
    unexpected=["time-jump"],
)

# ---- registers, spellings, words

for name, unit, factor, expected in [
    ("a register in counts", "", 1000, "int16, followed by the value of a count, as int16 0.01Nm"),
    ("a register with its unit", ":0.001Nm", 1000, "'torque_nm=reg:int16 0.001Nm'"),
]:
    register = table(joint(torque=("reg", lambda row, factor=factor: round(factor * row["tau"]) & 0xFFFF)))
    expected = expected if unit else f"torque_nm=reg:{expected}"
    error(
        f"{name} without its sign",
        register,
        "log.csv: column reg: found jumps by nearly 2^16 counts: negative values without their sign, expected --columns "
        + expected,
        f"--columns torque_nm=reg{unit}",
    )
case("a register with its sign", register, "--columns 'torque_nm=reg:int16 0.001Nm'")
case(
    "a column Run",
    table({"Run": lambda row: row["run"], **joint(run=None)}),
    expected_lines=["the column Run is read as run"],
    data={"runs": RUNS, "rows": RUNS * ROWS},
)
case(
    "words of a historian for a missing value",
    table(joint(oil=("oil", lambda row: "No Data" if row["i"] % 40 else 40 + 0.001 * row["i"]))),
    "--columns temperature_c=oil:degC",
    data={"rows": RUNS * ROWS, "rows_left_out": 0},
)
LABVIEW = "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\n\t\nTime\t10:22:11\t10:22:11\t\n***End_of_Header***\t\n"
case(
    "a file of LabVIEW",
    LABVIEW + table(joint(), by="\t"),
    expected_lines=["6 lines above the header are skipped, the first with text is \"LabVIEW Measurement\""],
)
error(
    "a log of messages",
    "2024-03-14 08:59:58,001 INFO [main] start\n2024-03-14 08:59:59,001 INFO [joint] vel=1 tau=2\n",
    "log.csv: row 1, column 2024-03-14 08:59:58: found a date or time, expected a table with the columns' names in its "
    "first row, not messages or rows alone",
)
error(
    "documents of ros2 topic echo",
    "header:\n  stamp:\n    sec: 1\nvelocity:\n- 0.1\n---\n",
    "log.csv: found a YAML document, expected an MCAP or CSV file: ros2 bag record -s mcap /TOPIC, or ros2 topic echo --csv "
    "/TOPIC > log.csv with a header",
)
error(
    "a time in us beside a torque T",
    table(joint(time=("ts_us", lambda row: 1e6 * row["t"]), velocity=("w", lambda row: row["v"]), torque=("T", lambda row: row["tau"]))),
    "log.csv: found only the columns run, ts_us, w, T, expected time_s and velocity_rad_s (or velocity_m_s) and torque_nm "
    "(or force_n) in the header, or --columns time_s=ts_us:us,velocity_rad_s=w,torque_nm=T",
)
