"""The awkward logs, each with the expected result or the exact error.

A case has a name, its files, further arguments of `identify FILE.. --model linear`, and expectations (see `run`).
Texts are given in full; tables are generated from the joint of `joint.py`.
"""

import datetime
import math
from dataclasses import dataclass, field

from joint import COULOMB_NM, RATE_HZ, ROWS, RUNS, joint, on_one_clock, rows, table

RPM = 60 / (2 * math.pi)
DEGREES = 180 / math.pi
EPOCH_NS = 1_714_564_800_000_000_000
NOON = datetime.datetime(2024, 5, 1, 12)


@dataclass
class Case:
    """An awkward log."""

    name: str
    files: dict
    arguments: str = ""
    # The exact line after "error: ". If it is given, no result is expected.
    error: str = ""
    # Texts that the output must contain, each in one line.
    expected_lines: list = field(default_factory=list)
    # Texts that no line of the output may contain.
    unexpected: list = field(default_factory=list)
    # Texts that standard output must contain, each in one line, for arguments that ask for no fit.
    output: list = field(default_factory=list)
    # True if the fit must give the joint's two parameters.
    answers: bool = True
    # For a log of several joints: their names in the order of the file, and the factor of each one's torque.
    joints: dict = field(default_factory=dict)
    # Expected entries of the result's `data`.
    data: dict = field(default_factory=dict)
    # Expected ranges of columns, [minimum, maximum], within a thousandth.
    ranges: dict = field(default_factory=dict)


CASES = []


def case(name, content, arguments="", **expected):
    files = content if isinstance(content, dict) else {"log.csv": content}
    CASES.append(Case(name, files, arguments, **expected))


def error(name, content, line, arguments=""):
    case(name, content, arguments, error=line)


def suspect(name, content, *expected_lines, **expected):
    """A log that is read with a warning. Its parameters are as wrong as its units."""
    case(name, content, expected_lines=list(expected_lines), answers=False, **expected)


SPEED = [-2.9999, 3.0]

# ---- units

case("as the contract says", table(joint()), data={"runs": RUNS, "rows": RUNS * ROWS}, ranges={"velocity_rad_s": SPEED})
case(
    "revolutions a minute and milliseconds",
    table(joint(time=("t", lambda r: 1e3 * r["t"]), velocity=("speed_rpm", lambda r: RPM * r["v"]))),
    "--columns velocity_rad_s=speed_rpm:rpm,time_s=t:ms",
    expected_lines=["  velocity_rad_s  -3.000 to 3.000 rad/s   from speed_rpm in rpm"],
    ranges={"time_s": [0, 3.99]},
)
case(
    "degrees a second, microseconds",
    table(joint(time=("stamp", lambda r: r["i"] * 10_000), velocity=("dq_3", lambda r: DEGREES * r["v"]))),
    "--columns velocity_rad_s=dq_3:deg/s,time_s=stamp:us",
    ranges={"velocity_rad_s": SPEED, "time_s": [0, 3.99]},
)
case(
    "degrees as a sign, minutes",
    table(joint(time=("t", lambda r: r["t"] / 60), velocity=("w", lambda r: DEGREES * r["v"]))),
    "--columns velocity_rad_s=w:°/s,time_s=t:min",
    ranges={"time_s": [0, 3.99]},
)
for unit, factor in [("mNm", 1e3), ("N·mm", 1e3), ("N*mm", 1e3), ("Ncm", 1e2), ("kNm", 1e-3), ("lbf-in", 8.850745767)]:
    case(
        f"torque in {unit}",
        table(joint(torque=("tau", lambda r, factor=factor: factor * r["tau"]))),
        f"--columns torque_nm=tau:{unit}",
    )
case(
    "a slide in millimetres and kilonewtons",
    table(joint(
        velocity=("v", lambda r: 1e3 * r["v"]), torque=("f", lambda r: 1e-3 * r["tau"]),
        position=("x", lambda r: 1e3 * r["q"]),
    )),
    "--columns velocity_m_s=v:mm/s,force_n=f:kN,position_m=x:mm",
    ranges={"velocity_m_s": SPEED, "position_m": [-1, 1]},
    data={"unit": "N"},
)
for unit, value in [("bar", 3.0), ("kPa", 300.0), ("MPa", 0.3), ("mbar", 3000.0), ("psi", 43.51132)]:
    case(
        f"pressure in {unit}",
        table(joint(pressure=("p", lambda r, value=value: value + 1e-3 * value * r["i"] / ROWS))),
        f"--columns pressure_diff_pa=p:{unit}",
        ranges={"pressure_diff_pa": [3e5, 3.003e5]},
    )
for unit, value in [("K", 293.15), ("degF", 68.0), ("C", 20.0)]:
    case(
        f"temperature in {unit}",
        table(joint(temperature=("oil", lambda r, value=value: value))),
        f"--columns temperature_c=oil:{unit}",
        ranges={"temperature_c": [20, 20]},
    )
case(
    "counts of a servo and of its encoder",
    table(joint(
        velocity=("Present Velocity", lambda r: RPM * r["v"] / 0.0229),
        position=("Present Position", lambda r: r["q"] * 65536 / (2 * math.pi)),
    )),
    "--columns 'velocity_rad_s=Present Velocity:0.0229rpm,position_rad=Present Position:65536counts'",
    ranges={"velocity_rad_s": SPEED, "position_rad": [-1, 1]},
)
case(
    "a drive's torque in permille of its rated torque",
    table(joint(torque=("0x6077:00", lambda r: 1e3 * r["tau"] / 1.2))),
    "--columns torque_nm=0x6077:00:0.1% --rated-torque 1.2Nm",
)
case(
    "a torque in percent of the other sign",
    table(joint(torque=("tau", lambda r: -100 * r["tau"] / 0.7))),
    "--columns torque_nm=tau:-% --rated-torque 700mNm",
)
error(
    "a torque in percent of an unknown torque",
    table(joint(torque=("tau", lambda r: 100 * r["tau"]))),
    "--columns torque_nm=tau:%: found the unit %, expected --rated-torque, which 100 % stands for",
    "--columns torque_nm=tau:%",
)
case(
    "a torque by a fraction",
    table(joint(torque=("tau", lambda r: 1000 * r["tau"] / 4.2))),
    "--columns torque_nm=tau:4.2/1000Nm",
)
case(
    "days of a spreadsheet",
    table(joint(time=("t", lambda r: r["t"] / 86400))),
    "--columns time_s=t:days",
    ranges={"time_s": [0, 3.99]},
)
case(
    "a thermometer with a scale and an offset",
    table(joint(temperature=("oil_raw", lambda r: 600 + r["run"]))),
    "--columns temperature_c=oil_raw:0.1degC-40",
    ranges={"temperature_c": [20, 20.2]},
)
error(
    "counts without a turn",
    table(joint(position=("enc", lambda r: r["q"] * 1000))),
    "--columns position_rad=enc:counts: found the unit counts, expected the counts of a turn before the unit, as 4096counts",
    "--columns position_rad=enc:counts",
)
case(
    "a row of units below the header",
    table(joint(velocity=("velocity_rad_s", lambda r: RPM * r["v"])))
    .replace("\n", "\n,s,rpm,Nm\n", 1),
    expected_lines=["the row below the header is read as units"],
    ranges={"velocity_rad_s": SPEED},
)
case(
    "a torque of the other sign, turned",
    table(joint(torque=("tau", lambda r: -r["tau"]))),
    "--columns torque_nm=tau:-Nm",
)
error(
    "a header in rpm and no unit said",
    table(joint(velocity=("speed_rpm", lambda r: RPM * r["v"]))),
    "log.csv: --columns velocity_rad_s=speed_rpm: found a name that ends in rpm, without a unit, expected "
    "velocity_rad_s=speed_rpm:rpm, or the unit of the column",
    "--columns velocity_rad_s=speed_rpm",
)
error(
    "a header in milliseconds in brackets",
    table(joint(time=("t (ms)", lambda r: 1e3 * r["t"]))),
    "log.csv: --columns time_s=t (ms): found a name that ends in ms, without a unit, expected 'time_s=t (ms):ms', or the unit "
    "of the column",
    "--columns 'time_s=t (ms)'",
)
error(
    "foreign names: what to type is said",
    "t_ms,speed_rpm,tau_3\n0,1,2\n",
    "log.csv: found only the columns t_ms, speed_rpm, tau_3, expected time_s and velocity_rad_s (or velocity_m_s) and "
    "torque_nm (or force_n) in the header, or --columns time_s=t_ms:ms,velocity_rad_s=speed_rpm:rpm,torque_nm=tau_3",
)
error(
    "a unit nobody knows",
    table(joint(velocity=("w", lambda r: r["v"]))),
    "--columns velocity_rad_s=w:knots: found the unit knots, expected one of rad/s, mrad/s, deg/s, rpm, rps",
    "--columns velocity_rad_s=w:knots",
)
error(
    "a unit of something else",
    table(joint(torque=("u", lambda r: r["tau"]))),
    "--columns torque_nm=u:N: found the unit N, expected a torque; for a force on a lever of 0.2 m --columns torque_nm=u:0.2Nm",
    "--columns torque_nm=u:N",
)
error(
    "a column that is not there",
    table(joint()),
    "log.csv: --columns torque_nm=tau:mNm: found no column tau, expected one of run, time_s, velocity_rad_s, torque_nm",
    "--columns torque_nm=tau:mNm",
)

# ---- units taken for others

suspect(
    "milliseconds as seconds",
    table(joint(time=("time_s", lambda r: 1e3 * r["t"]))),
    "unit-suspect: By its stamps the log has 0.1000 rows a second: the time may be in ms (--columns time_s=time_s:ms). "
    "Nothing is changed.",
    arguments="--as-logged unit-suspect",
)
suspect(
    "nanoseconds as seconds",
    table(joint(time=("time_s", lambda r: r["i"] * 10_000_000))),
    "unit-suspect: By its stamps the log has 1.000e-7 rows a second: the time may be in ns (--columns time_s=time_s:ns). "
    "Nothing is changed.",
    arguments="--as-logged unit-suspect",
)
suspect(
    "rpm as rad/s beside a position",
    table(joint(velocity=("velocity_rad_s", lambda r: RPM * r["v"]), position=("position_rad", lambda r: r["q"]))),
    "times the derivative of the position: the velocity may be in rpm (--columns velocity_rad_s=velocity_rad_s:rpm).",
    arguments="--as-logged unit-suspect",
)
suspect(
    "rpm as rad/s of a fast motor",
    table(joint(velocity=("velocity_rad_s", lambda r: 3e3 * r["v"]))),
    "by its column's unit, which no joint does: it may be in rpm (--columns velocity_rad_s=velocity_rad_s:rpm).",
    arguments="--as-logged unit-suspect",
)
error(
    "milliseconds as seconds, without a word",
    table(joint(time=("time_s", lambda r: 1e3 * r["t"]))),
    "log.csv: found 0.1000 rows a second by the column time_s, expected --columns time_s=time_s:ms, or --as-logged unit-suspect "
    "to keep the units",
)
error(
    "rpm as rad/s, without a word",
    table(joint(velocity=("velocity_rad_s", lambda r: RPM * r["v"]), position=("position_rad", lambda r: r["q"]))),
    "log.csv: found a velocity that is 9.549 times the derivative of the position: the velocity may be in rpm, expected --columns "
    "velocity_rad_s=velocity_rad_s:rpm, or --as-logged unit-suspect to keep the units",
)
suspect(
    "a torque that pushes along the motion",
    table(joint(torque=("torque_nm", lambda r: -r["tau"]))),
    "sign-suspect: The sign of torque_nm is reversed: it drives the motion (100 % of the power comes out of the joint), "
    "but friction opposes it. The diagnosis uses the torque with the other sign; --columns torque_nm=torque_nm:-Nm reads it so.",
)
case(
    "bar as pascal",
    table(joint(pressure=("pressure_diff_pa", lambda r: 3.0 + r["run"]))),
    expected_lines=["pressure_diff_pa never exceeds 5.000 Pa: it may be in bar or MPa (--columns pressure_diff_pa=pressure_diff_pa:bar)."],
)
case(
    "kelvin as degrees",
    table(joint(temperature=("temperature_c", lambda r: 293.0 + r["run"]))),
    expected_lines=["temperature_c reaches 295.0 °C: it may be in kelvin (--columns temperature_c=temperature_c:K)."],
)
case(
    "a covariate in its own unit",
    table(joint(pressure=("pressure_diff_bar", lambda r: 3.0))),
    expected_lines=[
        "pressure_diff_bar is read as a covariate; --columns pressure_diff_pa=pressure_diff_bar:bar reads it "
        "as pressure_diff_pa"
    ],
)

# ---- clocks

case(
    "nanoseconds since 1970",
    table(joint(time=("timestamp", lambda r: EPOCH_NS + r["i"] * 10_000_000))),
    "--columns time_s=timestamp:ns",
    expected_lines=["times count from 2024-05-01 12:00:00 UTC"],
    ranges={"time_s": [0, 3.99]},
)
case(
    "milliseconds since 1970",
    table(joint(time=("timestamp", lambda r: EPOCH_NS // 1_000_000 + r["i"] * 10))),
    "--columns time_s=timestamp:ms",
    ranges={"time_s": [0, 3.99]},
)


def iso(form, runs_apart=0.0):
    return lambda r: (NOON + datetime.timedelta(seconds=r["t"] + runs_apart * r["run"])).strftime(form)


for form in ["%Y-%m-%dT%H:%M:%S.%fZ", "%Y-%m-%d %H:%M:%S.%f", "%Y-%m-%dT%H:%M:%S.%f+02:00", "%Y/%m/%d %H:%M:%S.%f"]:
    case(
        f"dates as {NOON.strftime(form)}",
        table(joint(time=("time_s", iso(form)))),
        ranges={"time_s": [0, 3.99]},
    )
case("times of day", table(joint(time=("clock", iso("%H:%M:%S.%f")))), "--columns time_s=clock", ranges={"time_s": [0, 3.99]})
case(
    "rostopic echo -p",
    table({
        "%time": lambda r: EPOCH_NS + round(1e9 * on_one_clock(r)),
        "field.header.seq": lambda r: r["i"],
        "field.name0": lambda r: "elbow",
        "field.velocity0": lambda r: r["v"],
        "field.effort0": lambda r: r["tau"],
    }),
    "--columns velocity_rad_s=field.velocity0,torque_nm=field.effort0",
    data={"runs": RUNS},
)
case(
    "two files of one campaign by the date",
    {
        "one.csv": table(joint(time=("time_s", iso("%Y-%m-%dT%H:%M:%S.%fZ")))),
        "two.csv": table(joint(time=("time_s", iso("%Y-%m-%dT13:%M:%S.%fZ")))),
    },
    ranges={"time_s": [0, 3603.99]},
    data={"runs": 2 * RUNS},
)
case(
    "stamps that repeat",
    table(joint(time=("time_s", lambda r: (r["i"] // 2) * 2 / RATE_HZ))),
    expected_lines=["600 rows repeat the time stamp before them and are kept", "time-jump: 600 rows repeat the stamp of the row before"],
    answers=False,
)

# ---- several joints


def two_joints(name="joint", labels=("elbow", "wrist"), factors=(1, 5)):
    doubled = [dict(row, label=label, factor=factor) for row in rows() for label, factor in zip(labels, factors)]
    return table(joint(
        torque=("torque_nm", lambda r: r["factor"] * r["tau"]), joint=(name, lambda r: r["label"]),
    ), of=doubled)


case("two joints, row by row", two_joints(), joints={"elbow": 1, "wrist": 5}, data={"rows": RUNS * ROWS})
case("two joints by number", two_joints("motor_id", (1, 2)), joints={"1": 1, "2": 5})
case("two joints by a column called name", two_joints("name"), joints={"elbow": 1, "wrist": 5})


def side_by_side(*numbers):
    """Joints in the columns of one row, the second with five times the torque."""
    factors = dict(zip(numbers, (1, 5)))
    columns = {
        f"{what}{number}": (name + f"_{number}", value)
        for number, factor in factors.items()
        for what, name, value in [
            ("v", "velocity_rad_s", lambda r: r["v"]),
            ("tau", "torque_nm", lambda r, factor=factor: factor * r["tau"]),
        ]
    }
    return table(joint(velocity=None, torque=None, **columns))


case("two joints side by side", side_by_side(1, 2), joints={"1": 1, "2": 5}, expected_lines=["1 columns belong to other joints (2)"])
WIDE = side_by_side("left", "right").replace("velocity_rad_s_left", "arm/left_knee.vel").replace("torque_nm_left", "arm/left_knee.effort")
WIDE = WIDE.replace("velocity_rad_s_right", "arm/right_knee.vel").replace("torque_nm_right", "arm/right_knee.effort")
MAP = "velocity_rad_s=arm/#_knee.vel,torque_nm=arm/#_knee.effort"
case("two joints by one map", WIDE, f"--columns '{MAP}'", joints={"left": 1, "right": 5}, expected_lines=["velocity of joint right"])
case("one of two joints by one map", WIDE, f"--columns '{MAP}' --joint left", expected_lines=["1 columns belong to other joints (right)"])
error(
    "two joints of unknown names",
    WIDE,
    "log.csv: found only the columns run, time_s, arm/left_knee.vel, arm/left_knee.effort, arm/right_knee.vel, "
    "arm/right_knee.effort, expected velocity_rad_s (or velocity_m_s) and torque_nm (or force_n) in the header, or, for 2 "
    f"joints (left, right), --columns '{MAP}'",
)
case("one of two joints side by side", side_by_side(1, 2), "--where joint=1", data={"rows": RUNS * ROWS})
case("a single joint with a number", side_by_side(4))
error(
    "a joint that is not side by side",
    side_by_side(1, 2),
    "log.csv: --where joint=3: found no joint 3, expected one of 1, 2",
    "--where joint=3",
)
case(
    "one of two joints",
    two_joints(),
    "--where joint=elbow",
    expected_lines=["1200 rows are not of joint=elbow"],
    data={"rows": RUNS * ROWS, "runs": RUNS},
)
case("one of two joints by number", two_joints("axis", (1.0, 2.0)), "--where axis=1")
case(
    "a run's name in a column called name",
    table(joint(name=("name", lambda r: f"trial {r['run']}"))),
    data={"runs": RUNS},
)
error(
    "a joint that is not there",
    two_joints(),
    "log.csv: --where joint=knee: found none of 2400 rows, expected one of elbow, wrist",
    "--where joint=knee",
)
error(
    "a column to choose by that is not there",
    two_joints(),
    "log.csv: --where link=elbow: found no column link, expected one of run, time_s, velocity_rad_s, torque_nm, joint",
    "--where link=elbow",
)
error("a choice without a value", two_joints(), '--where: found "joint", expected COLUMN=VALUE', "--where joint")

# ---- channels of their own

case(
    "a thermometer in every hundredth row",
    table(joint(temperature=("temperature_c", lambda r: 20 + r["i"] / 100 if r["i"] % 100 == 0 else ""))),
    expected_lines=["temperature_c is in 12 of 1200 rows and is interpolated in time between its values"],
    ranges={"temperature_c": [20, 23]},
    data={"rows": RUNS * ROWS, "rows_left_out": 0},
)
case(
    "a setting that is written when it changes",
    table(joint(kp=("kp", lambda r: 100 * (1 + r["run"]) if r["i"] == 0 else "nan"))),
    expected_lines=["kp is in 3 of 1200 rows and is held from each of its values to the next"],
    ranges={"kp": [100, 300]},
)


def merged(temperature_every):
    lines = ["__time,/joint/velocity,/joint/effort,/oil/temperature"]
    for row in rows():
        t = on_one_clock(row)
        lines.append(f"{t!r},{row['v']!r},,")
        lines.append(f"{t + 0.002!r},,{row['tau']!r},")
        if row["i"] % temperature_every == 0:
            lines.append(f"{t + 0.003!r},,,{20 + row['i'] / 100}")
    return "\n".join(lines) + "\n"


case(
    "channels merged by their stamps",
    merged(50),
    "--columns time_s=__time,velocity_rad_s=/joint/velocity,torque_nm=/joint/effort,temperature_c=/oil/temperature",
    expected_lines=[
        "velocity and torque have separate time stamps: 1227 rows without a torque are ignored, and the velocity is "
        "interpolated in time at the rows with a torque",
        "temperature_c is in 24 of 2424 rows and is interpolated in time between its values",
    ],
    data={"runs": RUNS, "rows_left_out": 0},
)


def beside():
    lines = ["run,time_s,velocity_rad_s,torque_nm,temperature_c"]
    for row in rows():
        lines.append(f"{row['run']},{row['t']!r},{row['v']!r},{row['tau']!r},")
        if row["i"] % 5 == 0:
            lines.append(f"{row['run']},{row['t'] + 0.004!r},,,{20 + row['i'] / 100}")
    return "\n".join(lines) + "\n"


case(
    "a thermometer in rows of its own",
    beside(),
    expected_lines=["240 rows hold neither velocity nor torque, only columns with separate time stamps"],
    data={"rows": RUNS * ROWS, "rows_left_out": 0},
)
case(
    "a mapped column without a value",
    table(joint(temperature=("oil", lambda r: ""))),
    "--columns temperature_c=oil",
    expected_lines=["--columns temperature_c=oil: temperature_c is left out, as oil holds no value"],
)
error(
    "a mapped column of words",
    table(joint(temperature=("oil", lambda r: "warm"))),
    'log.csv: row 2, column oil: found "warm", expected a finite number',
    "--columns temperature_c=oil",
)
error(
    "a torque that is missing in every seventh row and at random",
    table(joint(torque=("torque_nm", lambda r: "" if r["i"] * 7919 % 101 < 15 else r["tau"]))),
    "log.csv: row 2, column torque_nm: found an empty cell, expected a finite number (180 of 1200 rows are bad, this is "
    "the first; at most 5 % may be; --bad-rows 15% leaves them out)",
)
case(
    "a torque that is missing in one row of a hundred",
    table(joint(torque=("torque_nm", lambda r: "NaN" if r["i"] % 100 == 7 else r["tau"]))),
    expected_lines=["12 rows are left out as bad:", '  log.csv: row 9, column torque_nm: found "NaN", expected a finite number'],
    data={"rows": RUNS * ROWS - 12, "rows_left_out": 12},
)
