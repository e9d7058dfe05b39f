//! `feed_forward.py`: the table as a function for the host program, and the call that sends its torque.
//!
//! The script needs no package beside that of the drive.

use super::FeedForward;
use super::drive::Drive;
use std::fmt::Write;

/// Functions of every drive. `SPEED_UNIT`, `TORQUE_UNIT` and `SUFFIX` are replaced.
const FUNCTIONS: &str = "\
def table_torque_SUFFIX(speed):
    \"\"\"Returns the torque of the table, TORQUE_UNIT, at a speed in SPEED_UNIT: linear between its points, constant beyond.\"\"\"
    after = bisect.bisect_right(SPEEDS, speed)
    if after == 0 or after == len(SPEEDS):
        return TORQUES[min(after, len(SPEEDS) - 1)]
    share = (speed - SPEEDS[after - 1]) / (SPEEDS[after] - SPEEDS[after - 1])
    return TORQUES[after - 1] + share * (TORQUES[after] - TORQUES[after - 1])


def feed_forward_SUFFIX(speed, acceleration=0.0, position=None):
    \"\"\"Returns the torque to send with a set-point, TORQUE_UNIT.

    Pass the speed of the set-point, not the measured one: a measured speed closes a loop that can oscillate.
    Leave `acceleration` at 0 if the drive itself adds the torque of the inertia.
    \"\"\"
    torque = table_torque_SUFFIX(speed) + INERTIA * acceleration
    if position is not None:
        angle = POSITION_SCALE * position
        torque += GRAVITY[0] * math.sin(angle) + GRAVITY[1] * math.cos(angle)
    return SCALE * torque
";

const MOTEUS: &str = "

async def command(controller, position, speed, acceleration=0.0, **options):
    \"\"\"Sends a set-point (turns, turns/s, turns/s^2) with its feed-forward torque to a `moteus.Controller`.\"\"\"
    torque = feed_forward_nm(speed, acceleration, position)
    return await controller.set_position(position=position, velocity=speed, feedforward_torque=torque, **options)
";

const ODRIVE: &str = "

def command(axis, position, speed, acceleration=0.0):
    \"\"\"Sends a set-point (turns, turns/s, turns/s^2) with its feed-forward torque over USB.

    `axis.controller.config.input_mode` must be `PASSTHROUGH`: the other modes ignore `input_torque`.
    \"\"\"
    axis.controller.input_torque = feed_forward_nm(speed, acceleration, position)
    axis.controller.input_vel = speed
    axis.controller.input_pos = position


def set_input_pos_data(position, speed, acceleration=0.0, velocity_scale=1000, torque_scale=1000):
    \"\"\"Returns the data of the CAN message Set_Input_Pos (identifier 00Ch + 20h node).

    Firmware 0.6 has the scales in `config.can.input_vel_scale` and `config.can.input_torque_scale`.
    \"\"\"
    torque = feed_forward_nm(speed, acceleration, position)
    return struct.pack(\"<fhh\", position, round(velocity_scale * speed), round(torque_scale * torque))
";

/// Returns the text of the script.
pub fn script(of: &FeedForward) -> String {
    let units = &of.units;
    let judged = &of.judged;
    let (torque, speed) = (units.torque, units.speed);
    let mut text = format!(
        "\"\"\"Friction feed-forward for {}, by host-sim {} from {}.\n\n",
        of.drive.title(),
        env!("CARGO_PKG_VERSION"),
        of.files.join(", ")
    );
    // Writing to a string does not fail.
    let _ = write!(
        text,
        "Model {}. RMSE on held-out rows: {:.4} {torque} without feed-forward, {:.4} {torque} with this table.\n\
         Speed and torque are {}.\n\
         Positive torque drives positive speed, as in the log{}.\n\
         To switch it off, set SCALE to 0. Begin a trial with a small SCALE.\n\"\"\"\n\n",
        of.model,
        judged.nothing.rmse,
        judged.table.rmse,
        of.drive.shaft(),
        if of.is_reversed { " after its sign was reversed by --columns" } else { "" },
    );
    text += "import bisect\nimport math\n";
    if of.drive == Drive::ODrive {
        text += "import struct\n";
    }
    text += "\n# Share of the torque that is sent, 0 to 1.\nSCALE = 1.0\n\n";
    let _ =
        writeln!(text, "# Speed in {speed}, torque and its standard error in {torque}.\nTABLE = [");
    for point in of.rows() {
        let [speed, torque, std_error] = [point.velocity, point.torque, point.std_error];
        let _ = writeln!(text, "    ({speed:.9}, {torque:.6}, {std_error:.6}),");
    }
    let position_scale = if of.drive == Drive::Joint { "1.0" } else { "2 * math.pi" };
    let _ = write!(
        text,
        "]\nSPEEDS = [row[0] for row in TABLE]\nTORQUES = [row[1] for row in TABLE]\n\n\
         # Torque per acceleration, {torque}/({speed}^2); 0 if the log does not determine it.\n\
         INERTIA = {:.9}\n\
         # Torque of gravity, {torque}: factors of sine and cosine of the position, whose zero must be that of the log.\n\
         GRAVITY = ({:.6}, {:.6})\nPOSITION_SCALE = {position_scale}  # radians\n\n\n",
        of.inertia_in_units().unwrap_or(0.0),
        of.rigid_body.gravity_sine,
        of.rigid_body.gravity_cosine,
    );
    text += &FUNCTIONS
        .replace("SUFFIX", units.suffix)
        .replace("TORQUE_UNIT", torque)
        .replace("SPEED_UNIT", speed);
    text += match of.drive {
        Drive::Moteus => MOTEUS,
        Drive::ODrive => ODRIVE,
        Drive::Joint => "",
    };
    text
}
