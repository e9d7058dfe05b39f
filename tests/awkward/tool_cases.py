"""Logs of known tools, read with `--from`, and tables with lines above the header or a clock for each channel."""

import json
import math

from cases import CASES, DEGREES, EPOCH_NS, RPM, case, error
from joint import RATE_HZ, ROWS, RUNS, joint, number, on_one_clock, rows, table

TURNS = 1 / (2 * math.pi)
WHOLE = {"runs": RUNS, "rows": RUNS * ROWS, "rows_left_out": 0}
SPEED = [-2.9999, 3.0]

# ---- presets


def plotjuggler(joints=("elbow",), others=0):
    columns = {"__time": on_one_clock}
    for at, name in enumerate(joints):
        columns[f"/joint_states/{name}/position"] = lambda r: r["q"]
        columns[f"/joint_states/{name}/velocity"] = lambda r: r["v"]
        columns[f"/joint_states/{name}/effort"] = lambda r, factor=1 + 4 * at: factor * r["tau"]
    for at in range(others):
        columns[f"/diagnostics/{at:03}/value"] = lambda r, at=at: r["i"] % (at + 2)
    return table(columns)


case(
    "PlotJuggler",
    plotjuggler(),
    "--from plotjuggler",
    data=WHOLE,
    ranges={"position_rad": [-1, 1], "velocity_rad_s": SPEED},
    expected_lines=[
        "--from plotjuggler reads time_s from __time, velocity_rad_s from /joint_states/elbow/velocity, position_rad from "
        "/joint_states/elbow/position, torque_nm from /joint_states/elbow/effort",
    ],
)
error(
    "PlotJuggler without a word of it",
    plotjuggler(),
    "log.csv: found only the columns __time, /joint_states/elbow/position, /joint_states/elbow/velocity, "
    "/joint_states/elbow/effort, expected time_s and velocity_rad_s (or velocity_m_s) and torque_nm (or force_n) in the "
    "header, or --columns time_s=__time,velocity_rad_s=/joint_states/elbow/velocity,torque_nm=/joint_states/elbow/effort,"
    "position_rad=/joint_states/elbow/position; "
    "this looks like a log of plotjuggler: add --from plotjuggler",
)
error(
    "PlotJuggler with two joints",
    plotjuggler(("elbow", "wrist")),
    "log.csv: --from plotjuggler: found 2 columns for velocity_rad_s (/joint_states/elbow/velocity, "
    "/joint_states/wrist/velocity), expected one: --columns "
    "velocity_rad_s=/joint_states/elbow/velocity,torque_nm=/joint_states/elbow/effort",
    "--from plotjuggler",
)
case(
    "PlotJuggler with two joints, one chosen",
    plotjuggler(("wrist", "elbow")).replace("elbow", "x").replace("wrist", "elbow"),
    "--from plotjuggler --columns velocity_rad_s=/joint_states/elbow/velocity",
    data=WHOLE,
)
case(
    "given columns win over the preset",
    table({
        "__time": on_one_clock, "/js/velocity": lambda r: r["v"], "/js/effort": lambda r: 9.0, "/cell/tau": lambda r: 1e3 * r["tau"],
    }),
    "--from plotjuggler --columns torque_nm=/cell/tau:mNm",
    data=WHOLE,
)
MOTEUS = {
    "timestamp": lambda r: EPOCH_NS / 1e9 + on_one_clock(r),
    "position": lambda r: TURNS * r["q"],
    "torque_Nm": lambda r: r["tau"],
    "velocity": lambda r: TURNS * r["v"],
}
case(
    "tview of moteus in CSV",
    table(MOTEUS),
    "--from moteus",
    data=WHOLE,
    ranges={"position_rad": [-1, 1], "velocity_rad_s": SPEED},
)
error(
    "tview of moteus without a word of it",
    table(MOTEUS),
    "log.csv: found only the columns timestamp, position, torque_Nm, velocity, expected time_s and velocity_rad_s (or "
    "velocity_m_s) and torque_nm (or force_n) in the header, or --columns "
    "time_s=timestamp,velocity_rad_s=velocity,torque_nm=torque_Nm,position_rad=position; this looks like a log of moteus: add --from moteus",
)


def tview_lines(factors={"1": 1}):
    """Objects of two channels for each controller, as tview writes them, with a multiple of the torque for each."""
    lines = []
    for row in rows():
        stamp = EPOCH_NS / 1e9 + on_one_clock(row)
        for controller, factor in factors.items():
            state = {"position": TURNS * row["q"], "velocity": TURNS * row["v"], "torque_Nm": factor * row["tau"], "q_A": math.nan}
            for channel, data in [("servo_stats", state), ("servo_control", {"pwm": {"a": 0.5}})]:
                lines.append(json.dumps({"controller": controller, "timestamp": stamp, "channel": channel, "data": data}))
    return "\n".join(lines) + "\n"


case(
    "tview of moteus in JSON lines",
    {"log.jsonl": tview_lines()},
    "--from moteus",
    data=WHOLE,
    ranges={"position_rad": [-1, 1], "velocity_rad_s": SPEED},
    expected_lines=["1200 objects have none of these columns and are no rows"],
)
case("tview of two controllers of moteus", tview_lines({"1": 1, "2": 5}), "--from moteus", joints={"1": 1, "2": 5}, data=WHOLE)
ODRIVE = {
    "time": on_one_clock,
    "axis0.encoder.pos_estimate": lambda r: TURNS * r["q"],
    "axis0.encoder.vel_estimate": lambda r: TURNS * r["v"],
    "axis0.motor.current_control.Iq_measured": lambda r: r["tau"] / 0.04,
}
case(
    "ODrive with the torque constant",
    table(ODRIVE),
    "--from odrive --torque-constant 0.04Nm/A",
    data=WHOLE,
    ranges={"position_rad": [-1, 1], "velocity_rad_s": SPEED},
)
error(
    "ODrive without the torque constant",
    table(ODRIVE),
    "log.csv: --from odrive: found torque_nm in axis0.motor.current_control.Iq_measured, in amperes, expected the torque constant, "
    "from the motor's data sheet: --columns torque_nm=axis0.motor.current_control.Iq_measured:A with --torque-constant 0.105Nm/A, "
    "or --columns torque_nm=axis0.motor.current_control.Iq_measured:0.105Nm",
    "--from odrive",
)
DYNAMIXEL = {
    "Time [ms]": lambda r: 1e3 * on_one_clock(r),
    "Present Position": lambda r: r["q"] * 4096 * TURNS,
    "Present Velocity": lambda r: RPM * r["v"] / 0.229,
    "Present Load": lambda r: r["tau"] / 4.1 * 1000,
}
case(
    "Dynamixel with its stall torque",
    table(DYNAMIXEL),
    "--from dynamixel --rated-torque 4.1Nm",
    data=WHOLE,
    ranges={"position_rad": [-1, 1], "velocity_rad_s": SPEED},
)
error(
    "Dynamixel without its stall torque",
    table(DYNAMIXEL),
    "log.csv: --from dynamixel: found torque_nm in Present Load, in 0.1 % of a torque that is not in the log, expected "
    "--rated-torque, such as --rated-torque 1.2Nm",
    "--from dynamixel",
)
CIA_402 = {
    "time": on_one_clock, "0x6064:00": lambda r: r["i"], "0x606C:00": lambda r: RPM * r["v"], "0x6077:00": lambda r: 1e3 * r["tau"] / 1.2,
}
case(
    "objects of CiA 402",
    table(CIA_402),
    "--from ethercat --rated-torque 1.2Nm --columns velocity_rad_s=0x606C:00:rpm",
    data=WHOLE,
    ranges={"velocity_rad_s": SPEED},
    expected_lines=["0x6064:00 is not read: its unit is not in the log; --columns position_rad=0x6064:00:UNIT"],
)
error(
    "objects of CiA 402 in unknown units",
    table(CIA_402),
    "log.csv: --from ethercat: found velocity_rad_s in 0x606C:00, whose unit is not in the log, expected --columns "
    "velocity_rad_s=0x606C:00:UNIT, with UNIT such as rpm or 4096counts/s (object 60A9h)",
    "--from ethercat --rated-torque 1.2Nm",
)
error("a preset nobody knows", table(joint()),
      "invalid value 'excel' for '--from <TOOL>' [possible values: plotjuggler, moteus, odrive, dynamixel, ethercat, "
      "twincat-scope]", "--from excel")

# ---- TwinCAT Scope, and clocks of their own


def twincat(by="\t", point=",", full=True, start=None):
    """An export with the velocity and the torque on clocks of their own, the torque at half the rate."""
    def line(*values):
        return by.join(str(value) for value in values)

    def each(key, one, two):
        return line(key, one, key, two)

    def value(x):
        return number(x).replace(".", point)

    def stamp(row):
        milliseconds = round(1000 * on_one_clock(row))
        return milliseconds if start is None else start + 10_000 * milliseconds

    lines = [line("Name", "Rig"), line("File", "C:\\rig.tcscopex"), line("Starttime of export", 133238090039920000, "Monday"), ""]
    lines.append(each("Name", "ActVelo", "ActTorque"))
    if full:
        lines.append(each("SymbolName", "Axes.Axis 1.ActVelo", "Axes.Axis 1.ActTorque"))
        lines += [each("Data-Type", "REAL64", "REAL64"), each("SampleTime[ms]", 10, 20), each("Unit", "°/s", "Nm"), each("Offset", 0, 0)]
    lines.append("")
    slow = [row for row in rows() if row["i"] % 2 == 0]
    for at, row in enumerate(rows()):
        cells = [stamp(row), value(DEGREES * row["v"])]
        cells += [stamp(slow[at]), value(slow[at]["tau"])] if at < len(slow) else ["", ""]
        lines.append(line(*cells))
    return "\n".join(lines) + "\nEOF\n"


CLOCKS = "2 time columns (time) are merged onto one clock: each is that of the channels after it"
HALF = {"runs": RUNS, "rows": RUNS * ROWS // 2, "rows_left_out": 0}
case(
    "TwinCAT Scope with tabs and decimal commas",
    twincat(),
    "--from twincat-scope",
    data=HALF,
    ranges={"velocity_rad_s": SPEED, "time_s": [0, 21.98]},
    expected_lines=[CLOCKS, "commas inside numbers are decimal points",
                    "velocity_rad_s from ActVelo:°/s, torque_nm from ActTorque:Nm"],
)
case(
    "TwinCAT Scope with a short preamble",
    twincat(",", ".", full=False),
    "--from twincat-scope --columns velocity_rad_s=ActVelo:deg/s,torque_nm=ActTorque:Nm",
    data=HALF,
    expected_lines=[CLOCKS],
)
case(
    "TwinCAT Scope with full time stamps",
    twincat(start=133238090039920000),
    "--from twincat-scope",
    data=HALF,
    expected_lines=["times count from 2023-03-20 18:03:23 UTC"],
    ranges={"time_s": [0, 21.98]},
)
error(
    "TwinCAT Scope without units",
    twincat(",", ".", full=False),
    "log.csv: --from twincat-scope: found velocity_rad_s in ActVelo, whose unit is not in the log, expected --columns "
    "velocity_rad_s=ActVelo:UNIT, with UNIT such as deg/s or mm/s",
    "--from twincat-scope",
)
error(
    "TwinCAT Scope without a word of it",
    twincat(),
    "log.csv: found only the columns time, ActVelo, ActTorque, expected time_s and velocity_rad_s (or velocity_m_s) and "
    "torque_nm (or force_n) in the header, or --columns time_s=time,velocity_rad_s=ActVelo,torque_nm=ActTorque; this looks like a "
    "log of twincat-scope: add --from twincat-scope",
)


def two_clocks(first="t1", second="t2"):
    lines = [f"{first},speed,{second},effort"]
    for row in rows():
        t = on_one_clock(row)
        lines.append(f"{t!r},{row['v']!r},{t + 0.003!r},{row['tau']!r}")
    return "\n".join(lines) + "\n"


case(
    "an oscilloscope's clock for each channel",
    two_clocks(),
    "--columns time_s=t1,velocity_rad_s=speed,torque_nm=effort",
    expected_lines=[
        "2 time columns (t1, t2) are merged onto one clock: each is that of the channels after it",
        "velocity and torque have separate time stamps",
    ],
    data={"runs": RUNS, "rows_left_out": 0},
)
error(
    "a clock for each channel that goes back",
    two_clocks("time", "time").replace("\n0.0,", "\n50,", 1),
    "log.csv: row 3, column time: found 0.01, expected a time not before 50 (2400 of 2400 rows are bad, this is the first; at most "
    "5 % may be)",
    "--columns time_s=time,velocity_rad_s=speed,torque_nm=effort",
)

# ---- lines above the header

ABOVE = "Operator;Kim\nRig;3\nkp;12,5\n\n"
case(
    "keys and values above the header",
    ABOVE + table(joint(), by=";").replace(".", ","),
    expected_lines=['4 lines above the header are skipped, the first with text is "Operator;Kim"'],
    data=WHOLE,
)
case(
    "keys and values of a spreadsheet, filled with commas",
    "Operator,Kim,,\nDate,2024-05-01,,\nkp,3,,\n" + table(joint()),
    expected_lines=["3 lines above the header are skipped"],
    data=WHOLE,
)
error(
    "rows are counted with the lines above",
    ABOVE.replace(",", ".") + table(joint(velocity=("velocity_rad_s", lambda r: "off" if r["i"] % 5 == 3 else r["v"]))),
    'log.csv: row 9, column velocity_rad_s: found "off", expected a finite number (240 of 1200 rows are bad, this is the '
    "first; at most 5 % may be; --bad-rows 20% leaves them out)",
)
case("lines that are skipped by number", "time_s,velocity_rad_s,torque_nm\n9,9,9\n" + table(joint()), "--skip-lines 2", data=WHOLE)
error(
    "more lines skipped than there are",
    table(joint(), of=rows(10, 1)),
    "log.csv: --skip-lines 11: found 11 lines in the first 64 KiB, expected a table as text below the lines",
    "--skip-lines 11",
)

# ---- many columns

error(
    "PlotJuggler with 195 columns",
    plotjuggler(("elbow", "wrist"), 188).replace("__time", "stamp"),
    "log.csv: found 195 columns, likely stamp, /joint_states/elbow/velocity, /joint_states/wrist/velocity, "
    "/joint_states/elbow/effort, /joint_states/wrist/effort, expected time_s and velocity_rad_s (or velocity_m_s) and torque_nm "
    "(or force_n) in the header, or, for 2 joints (elbow, wrist), --columns 'time_s=stamp,velocity_rad_s=/joint_states/#/velocity,"
    "torque_nm=/joint_states/#/effort,position_rad=/joint_states/#/position'; --columns help lists all",
)
case(
    "the columns of a log are asked for",
    table(joint(velocity=("speed (rpm)", lambda r: RPM * r["v"]), note=("note", lambda r: "warm"))),
    "--columns help",
    output=[
        "log.csv: 5 columns",
        "'velocity_rad_s=speed (rpm):rpm'",
        "text: warm",
    ],
)
case(
    "the columns of moteus are asked for",
    table(MOTEUS),
    "--columns help",
    output=["velocity_rad_s=velocity:turns/s", "position_rad=position:turns", "torque_nm=torque_Nm:Nm"],
)
case(
    "the columns of TwinCAT Scope are asked for",
    twincat(),
    "--columns help",
    output=["time_s=time:ms", "velocity_rad_s=ActVelo:°/s", "torque_nm=ActTorque:Nm", "--from twincat-scope names its columns."],
)
case(
    "the columns of a tool's log are asked for",
    plotjuggler(others=188),
    "--columns help",
    output=[
        "log.csv: 192 columns",
        "/diagnostics/187/value",
        "velocity_rad_s=/joint_states/elbow/velocity",
        "This looks like a log of plotjuggler: --from plotjuggler names its columns.",
    ],
)

__all__ = ["CASES", "RATE_HZ"]
