//! Arguments that commands share which move a joint: the simulated joint on the bus `loop`, and the bounds of motions.

use super::bus::BusArguments;
use clap::Args;
use compensator_core::can::NodeId;
use joint_bus::bus::{BusName, Hub};
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
    /// Largest distance from the present position: a number with rad or deg, such as ±0.4rad
    #[arg(long, value_name = "RANGE", default_value = "0.4rad", value_parser = range)]
    range: f64,
    /// Largest speed: a number with rad/s or deg/s
    #[arg(long, value_name = "SPEED", default_value = "1.5rad/s", value_parser = speed)]
    speed: f64,
}

impl MotionArguments {
    /// Returns the bounds.
    pub fn limits(&self) -> MotionLimits {
        MotionLimits::new(self.range, self.speed)
    }
}

/// Parses a number with one of two units; a bare number is in the first one.
fn number(text: &str, units: [&str; 2], most: f64) -> Result<f64, String> {
    let expected = || {
        format!(
            "found {text:?}, expected a number above 0 and up to {most} {}, such as 0.4{}",
            units[0], units[0]
        )
    };
    let trimmed = text.trim().trim_start_matches(['±', '+']).trim_start_matches('-').trim();
    let (digits, scale) = if let Some(digits) = trimmed.strip_suffix(units[1]) {
        (digits, std::f64::consts::PI / 180.0)
    } else {
        (trimmed.strip_suffix(units[0]).unwrap_or(trimmed), 1.0)
    };
    let value = digits.trim().parse::<f64>().map_err(|_| expected())? * scale;
    if value > 0.0 && value <= most { Ok(value) } else { Err(expected()) }
}

fn range(text: &str) -> Result<f64, String> {
    number(text, ["rad", "deg"], 100.0)
}

fn speed(text: &str) -> Result<f64, String> {
    number(text, ["rad/s", "deg/s"], 100.0)
}

/// Returns the hub of the bus `loop`, with a simulated joint attached to it. For any other bus, the hub stays empty.
///
/// # Errors
/// Returns one line if the arguments do not fit together or the joint does not start.
pub fn start_hub(bus: &BusArguments, joint: &JointArguments) -> Result<Hub, String> {
    let hub = Hub::new();
    match (&bus.bus, joint.motor) {
        (BusName::Loop, true) if bus.node_id != NodeId::FIRST => {
            return Err("--motor: the simulated joint is node 1".into());
        }
        (BusName::Loop, true) => {
            let drawn = DrawnJoint::draw(joint.seed(), &joint.hide, None)?;
            hub.attach(MotorNode::drawn(&drawn, &service::starting_set(&drawn))?);
        }
        (BusName::Loop, false) => {
            return Err(
                "--bus loop: needs --motor, a simulated joint; for a real one give --bus can0, or slcan:PATH".into(),
            );
        }
        (_, true) => return Err("--motor: requires --bus loop".into()),
        _ => {}
    }
    Ok(hub)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn range_and_speed_have_units() {
        assert_eq!(range("±0.4rad"), Ok(0.4));
        assert_eq!(range("0.4"), Ok(0.4));
        assert_eq!(speed("1.5rad/s"), Ok(1.5));
        assert!((range("90deg").unwrap() - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        for wrong in ["", "x", "0", "1e9", "nan", "0.4m"] {
            let error = range(wrong).unwrap_err();
            assert!(error.contains(&format!("{wrong:?}")) && error.contains("rad"), "{error}");
        }
    }
}
