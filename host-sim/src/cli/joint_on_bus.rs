//! Arguments that commands share which move a joint: the simulated joint on the bus `loop`, and the bounds of motions.

use super::bus::BusArguments;
use super::error::{Result, unfit};
use clap::Args;
use compensator_core::quantity::{JointKind, Quantity};
use joint_bus::bus::Hub;
use joint_rig::{MotorNode, service};
use joint_tuning::MotionLimits;
use simulated_machines::joint_plant::DrawnJoint;
use simulated_machines::scenarios::Hide;

/// The simulated joint.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Simulated joint")]
pub struct JointArguments {
    /// With --bus loop: simulate a motor and a joint, in service and without compensation
    #[arg(long)]
    motor: bool,
    /// Hide this effect in the simulated joint; may be repeated
    #[arg(long, value_name = "CAUSE[:SIZE]", requires = "motor", value_parser = Hide::parse)]
    hide: Vec<Hide>,
    /// Seed of the simulated joint and of what is drawn at random [default: 1]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
}

impl JointArguments {
    /// Returns the seed.
    pub fn seed(&self) -> u64 {
        self.seed.unwrap_or(1)
    }
}

/// Bounds of motions.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Motion")]
pub struct MotionArguments {
    /// Largest distance from the present position: a number with rad or deg, such as ±0.4rad; with m or mm for a file
    #[arg(long, value_name = "RANGE", default_value = "0.4rad", value_parser = range)]
    range: Bound,
    /// Largest speed: a number with rad/s or deg/s; with m/s or mm/s for the file of a linear axis
    #[arg(long, value_name = "SPEED", default_value = "1.5rad/s", value_parser = speed)]
    speed: Bound,
}

/// A bound in rad and s, or in m and s, with the kind of joint of its unit.
type Bound = (f64, JointKind);

impl MotionArguments {
    /// Returns the bounds, and the column of the position. Only a file may be that of a linear axis.
    ///
    /// # Errors
    /// Returns one line if the units are of two kinds of joint, or of a linear axis on the bus.
    pub fn limits(&self, is_file: bool) -> Result<(MotionLimits, &'static str)> {
        let ((range, kind), (speed, other)) = (self.range, self.speed);
        if kind != other || kind == JointKind::Prismatic && !is_file {
            return Err(unfit(
                "--range, --speed",
                "expected rad or deg in both; with --standard --dry-run also m or mm in both",
            ));
        }
        Ok((MotionLimits::new(range, speed), Quantity::Position.name(kind)))
    }
}

/// Units of a bound without the end of a speed, each with its size and its kind of joint. `mm` is before `m`, which ends it.
const UNITS: [(&str, f64, JointKind); 4] = [
    ("rad", 1.0, JointKind::Revolute),
    ("deg", std::f64::consts::PI / 180.0, JointKind::Revolute),
    ("mm", 1e-3, JointKind::Prismatic),
    ("m", 1.0, JointKind::Prismatic),
];

/// Largest bound, in rad or rad/s, or in m or m/s.
const MAX_BOUND: f64 = 100.0;

/// Error of a bound.
#[derive(Debug, PartialEq, thiserror::Error)]
#[error(
    "found {found:?}, expected a number above 0 and up to {MAX_BOUND} rad{end}, such as 0.4rad{end}"
)]
struct UnfitBound {
    found: String,
    /// End of the unit.
    end: String,
}

/// Parses a number with a unit, which `end` follows; a bare number is in the first one.
fn bound(text: &str, end: &str) -> Result<Bound, UnfitBound> {
    let failed = || UnfitBound { found: text.to_owned(), end: end.to_owned() };
    let trimmed = text.trim().trim_start_matches(['±', '+']).trim_start_matches('-').trim();
    let with_unit =
        |(symbol, size, kind)| Some((trimmed.strip_suffix(end)?.strip_suffix(symbol)?, size, kind));
    let (digits, size, kind) =
        UNITS.into_iter().find_map(with_unit).unwrap_or((trimmed, 1.0, JointKind::Revolute));
    let value = digits.trim().parse::<f64>().map_err(|_| failed())? * size;
    if value > 0.0 && value <= MAX_BOUND { Ok((value, kind)) } else { Err(failed()) }
}

fn range(text: &str) -> Result<Bound, UnfitBound> {
    bound(text, "")
}

fn speed(text: &str) -> Result<Bound, UnfitBound> {
    bound(text, "/s")
}

/// Returns the hub of the bus `loop`, with a simulated joint attached to it. For any other bus, the hub stays empty.
///
/// # Errors
/// Returns one line if the arguments do not fit together or the joint does not start.
pub fn start_hub(bus: &BusArguments, joint: &JointArguments) -> Result<Hub> {
    let hub = Hub::new();
    if joint.motor {
        bus.check_motor("--motor")?;
        let drawn = DrawnJoint::draw(joint.seed(), &joint.hide, None)?;
        hub.attach(MotorNode::drawn(&drawn, &service::starting_set(&drawn))?);
    } else if bus.is_loop() {
        return Err(unfit(
            "--bus loop",
            "needs --motor, a simulated joint; for a real one give --bus can0, or slcan:PATH",
        ));
    }
    Ok(hub)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn range_and_speed_have_units() {
        use JointKind::{Prismatic, Revolute};
        assert_eq!(range("±0.4rad"), Ok((0.4, Revolute)));
        assert_eq!(range("0.4"), Ok((0.4, Revolute)));
        assert_eq!(range("±50mm"), Ok((0.05, Prismatic)));
        assert_eq!(speed("1.5rad/s"), Ok((1.5, Revolute)));
        assert_eq!(speed("0.2m/s"), Ok((0.2, Prismatic)));
        assert!((range("90deg").unwrap().0 - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        for wrong in ["", "x", "0", "1e9", "nan", "0.4rad/s", "0.4km"] {
            let error = range(wrong).unwrap_err().to_string();
            assert!(error.contains(&format!("{wrong:?}")) && error.contains("rad"), "{error}");
        }
    }
}
