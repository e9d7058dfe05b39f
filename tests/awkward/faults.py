"""Logs with a fault that is reported, corrected or refused before any fit: wraps, units, swapped and constant columns."""

import math
from random import Random

from cases import DEGREES, RPM, SPEED, case, error, suspect
from joint import ROWS, RUNS, joint, table

TURN = 2 * math.pi


def wrapped(scale, period, start, offset=3.0):
    """Returns a position in a unit of `scale` per rad that wraps at `period` and lies in start..start + period."""
    return lambda r: (scale * (r["q"] + offset) - start) % period + start


# ---- angles that wrap

for name, column, arguments in [
    ("between minus pi and pi", wrapped(1.0, TURN, -math.pi), ""),
    ("between 0 and a turn", wrapped(1.0, TURN, 0.0, TURN), ""),
    ("at 360 degrees", wrapped(DEGREES, 360.0, -180.0), "--columns position_rad=position_rad:deg"),
    ("at 4096 counts", wrapped(4096 / TURN, 4096.0, 0.0, 0.1), "--columns position_rad=position_rad:4096counts"),
]:
    case(
        f"a position that wraps {name}",
        table(joint(position=("position_rad", column))),
        arguments,
        expected_lines=["wrapped-angle: The position wraps ", "times at 6.283 rad: it is unwrapped."],
        unexpected=["time-jump", "unit-suspect", "velocity-"],
    )
    case(
        f"a position alone that wraps {name}",
        table(joint(velocity=None, position=("position_rad", column))),
        arguments,
        expected_lines=["times at 6.283 rad: it is unwrapped, and the velocity is derived from the result."],
        unexpected=["time-jump"],
        ranges={"velocity_rad_s": SPEED},
    )
case(
    "a position that wraps at the end of a gear",
    table(joint(position=("position_rad", wrapped(1.0, 0.35, 0.0)))),
    expected_lines=["times at 0.3500 rad: it is unwrapped."],
    unexpected=["time-jump", "unit-suspect"],
)
suspect(
    "degrees that wrap, as radians",
    table(joint(velocity=None, position=("position_rad", wrapped(DEGREES, 360.0, 0.0, 0.0)))),
    "times at 360.0 rad: it is unwrapped, and the velocity is derived from the result. By this period it may be in degrees "
    "(--columns position_rad=position_rad:deg).",
)
suspect(
    "a position that wraps, as logged",
    table(joint(position=("position_rad", wrapped(1.0, TURN, -math.pi)))),
    "times at 6.283 rad: left in, as asked.",
    arguments="--as-logged wrapped-angle",
)
case(
    "a position that is set back once",
    table(joint(position=("position_rad", lambda r: r["q"] + (5.0 if r["i"] > 200 else 0.0)))),
    unexpected=["wrapped-angle"],
)
case(
    "a table that is indexed by a turn",
    table(joint(table=("table_angle_rad", lambda r: TURN * (r["i"] // 50 % 2)))),
    unexpected=["wrapped-angle"],
)
suspect(
    "a position of steps by a turn",
    table(joint(position=("position_rad", lambda r: TURN * (r["i"] // 50 % 2)))),
    "3 runs, 1200 rows",
    unexpected=["wrapped-angle"],
)

# ---- a torque that holds nothing

error(
    "a constant torque",
    table(joint(torque=("torque_nm", lambda r: 1.253))),
    "log.csv: found 1.253 Nm in all 1200 rows of torque_nm, expected a torque that changes with the motion: check that its "
    "channel was logged, or --columns torque_nm=NAME if another column holds it",
)
error(
    "a constant torque beside another",
    table(joint(torque=("tau_set", lambda r: 0.0), other=("motor torque", lambda r: r["tau"]))),
    "log.csv: found 0 Nm in all 1200 rows of tau_set, expected a torque that changes with the motion: check that its channel "
    "was logged, or --columns 'torque_nm=motor torque' if another column holds it",
    "--columns torque_nm=tau_set",
)
error(
    "a torque of one value in each run",
    table(joint(torque=("torque_nm", lambda r: 1.0 + r["run"]))),
    "log.csv: found one value in each run of torque_nm, while the velocity of the runs changes, expected a torque that "
    "changes with the motion: check that its channel was logged, or --columns torque_nm=NAME if another column holds it",
)

# ---- columns in each other's place

POSITION = ("position_rad", lambda r: r["q"])
SWAPPED = table(joint(
    velocity=("velocity_rad_s", lambda r: r["tau"]), torque=("torque_nm", lambda r: r["v"]), position=POSITION,
))
error(
    "velocity and torque in each other's column",
    SWAPPED,
    "log.csv: found the derivative of the position in the column torque_nm of the torque, and not in the column "
    "velocity_rad_s of the velocity, expected --columns velocity_rad_s=torque_nm,torque_nm=velocity_rad_s",
)
case(
    "velocity and torque in each other's column, swapped as said",
    SWAPPED,
    "--columns velocity_rad_s=torque_nm,torque_nm=velocity_rad_s",
    ranges={"velocity_rad_s": SPEED},
)
error(
    "velocity and torque mapped to each other's column",
    table(joint(velocity=("dq 1", lambda r: RPM * r["v"]), torque=("tau 1", lambda r: r["tau"]), position=POSITION)),
    "log.csv: found the derivative of the position in the column dq 1 of the torque, and not in the column tau 1 of the "
    "velocity, expected --columns 'velocity_rad_s=dq 1:rpm,torque_nm=tau 1'",
    "--columns 'velocity_rad_s=tau 1,torque_nm=dq 1'",
)
case(
    "a viscous torque beside a position",
    table(joint(torque=("torque_nm", lambda r: 3 * r["v"]), position=POSITION)),
    answers=False,
    unexpected=["suspect"],
)

# ---- units that the position shows

suspect(
    "degrees as radians beside a velocity",
    table(joint(position=("q", lambda r: DEGREES * r["q"]))),
    "unit-suspect: The velocity is 0.01745 times the derivative of the position: the position may be in deg (--columns "
    "position_rad=q:deg). Nothing is changed.",
    arguments="--columns position_rad=q --as-logged unit-suspect",
)
suspect(
    "degrees a second as radians beside a position",
    table(joint(velocity=("velocity_rad_s", lambda r: DEGREES * r["v"]), position=POSITION)),
    "the velocity may be in deg/s (--columns velocity_rad_s=velocity_rad_s:deg/s).",
    arguments="--as-logged unit-suspect",
)
suspect(
    "rpm as degrees a second beside a position",
    table(joint(velocity=("w", lambda r: RPM * r["v"]), position=POSITION)),
    "the velocity may be in rpm (--columns velocity_rad_s=w:rpm).",
    arguments="--columns velocity_rad_s=w:deg/s --as-logged unit-suspect",
)
suspect(
    "rpm and degrees as radians",
    table(joint(
        velocity=("velocity_rad_s", lambda r: RPM * r["v"]), position=("position_rad", lambda r: DEGREES * r["q"]),
    )),
    "the velocity may be in rpm and the position in deg (--columns "
    "velocity_rad_s=velocity_rad_s:rpm,position_rad=position_rad:deg).",
    arguments="--as-logged unit-suspect",
)

# ---- names that are nearly known

for header, value, pair in [
    ("temperature_gear_c", 40.0, "temperature_c=temperature_gear_c"),
    ("temp_motor", 40.0, "temperature_c=temp_motor"),
    ("Oil Temp (K)", 310.0, "'temperature_c=Oil Temp (K):K'"),
    ("side_load_n", 100.0, "radial_force_n=side_load_n"),
    ("pressure_bar", 3.0, "pressure_diff_pa=pressure_bar:bar"),
    ("ext_torque", 3.0, "load_torque_nm=ext_torque"),
]:
    contract_name = pair.strip("'").split("=")[0]
    case(
        f"a column nearly named {contract_name}: {header}",
        table(joint(other=(header, lambda r, value=value: value + r["run"]))),
        expected_lines=[f"{header} is read as a covariate; --columns {pair} reads it as {contract_name}"],
    )
for header in ["temperature_ambient_c", "position_target_rad", "tension_n"]:
    case(
        f"a column of something else: {header}",
        table(joint(other=(header, lambda r: 3.0 + r["run"]))),
        unexpected=["is read as a covariate"],
    )

# ---- rates no logger has

error(
    "days as seconds",
    table(joint(time=("t", lambda r: r["t"] / 2 / 86400))),
    "log.csv: found 1.728e7 rows a second by the column t, expected at most 1e6; by its rate the time may have another unit: "
    "--columns time_s=t:h (4800 rows a second) or --columns time_s=t:days (200.0 rows a second)",
    "--columns time_s=t",
)
error(
    "milliseconds as nanoseconds",
    table(joint(time=("t", lambda r: 1e3 * r["t"]))),
    "log.csv: found 1.000e8 rows a second by the column t, expected at most 1e6; by its rate the time may have another unit: "
    "--columns time_s=t:ms (100.0 rows a second)",
    "--columns time_s=t:ns",
)

# ---- spikes of the torque


def spiked(percent, sizes):
    """The torque with white spikes of random sign; `sizes` is a range in Nm."""
    random = Random(7)
    shift = {}

    def value(r):
        key = (r["run"], r["i"])
        if key not in shift:
            size = random.choice([-1, 1]) * random.uniform(*sizes)
            shift[key] = size if random.random() < percent / 100 else 0.0
        return r["tau"] + shift[key]

    return value


for percent, count in [(2, 33), (5, 67), (20, 270)]:
    for sizes in [(3.0, 5.0), (10.0, 20.0)]:
        case(
            f"spikes of {sizes[0]} Nm in {percent} % of the rows",
            table(joint(torque=("torque_nm", spiked(percent, sizes)))),
            expected_lines=[f"outlier: {count} values of torque_nm (", "the loss is huber because of the spikes"],
            data={"rows": RUNS * ROWS},
        )
case(
    "spikes, with squares",
    table(joint(torque=("torque_nm", spiked(20, (10.0, 20.0))))),
    "--loss squares",
    expected_lines=["their rows have weight 0 in every fit and error; their motion is used."],
    unexpected=["huber"],
)
suspect(
    "spikes, as logged",
    table(joint(torque=("torque_nm", spiked(20, (10.0, 20.0))))),
    "are spikes, at least",
    "left in, as asked.",
    arguments="--as-logged outlier",
)
case(
    "spikes, as logged with a robust loss",
    table(joint(torque=("torque_nm", spiked(20, (10.0, 20.0))))),
    "--as-logged outlier --loss huber",
    expected_lines=["left in, as asked."],
)
case(
    "spikes within the range of the torque",
    table(joint(torque=("torque_nm", spiked(10, (0.5, 0.8))))),
    "--loss huber",
    unexpected=["outlier"],
)
case("a robust loss on a clean log", table(joint()), "--loss huber", unexpected=["outlier"])
case("a clean log has no spikes", table(joint()), unexpected=["outlier", "huber"])
