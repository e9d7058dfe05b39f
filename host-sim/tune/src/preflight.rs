//! What a session finds out before it moves a joint, and what it refuses.

use crate::motion::MotionLimits;
use canopen_rs::Address;
use compensator_core::can::{Message, NodeId, cob_id};
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::{
    AccessObject, AdaptationObject, InputsObject, TrialObject,
};
use firmware::parameter_set::ParameterSet;
use firmware::supervisor::{Code, CodeSet};
use joint_bus::bus::Bus;
use joint_bus::canopen::{Client, SdoError};
use joint_bus::codes::{FIRST_FAULT, code_names};
use joint_bus::parameters::read_staged;
use std::time::Duration;

/// Time for which the bus is watched for another master.
const LISTEN: Duration = Duration::from_millis(300);
/// Room between the range of the motions and the position window, rad.
const WINDOW_MARGIN_RAD: f64 = 0.02;
/// Share of the joint's largest speed that motions may have: the loop needs some to catch up.
const SPEED_SHARE: f64 = 0.9;
/// Bit of the statusword: the position is known.
const POSITION_KNOWN: u32 = 1 << 8;

/// Time between two targets (60C2h): `period` times ten to the power of `exponent`, s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InterpolationTime {
    /// Number of units, entry 1.
    pub period: u8,
    /// Exponent of the unit, entry 2.
    pub exponent: i8,
}

/// Following error at which the drive stops, if it lasts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FollowingWindow {
    /// Largest error (6065h), 1e-6 rad.
    pub error_micro_rad: u32,
    /// Time for which a larger one is permitted (6066h), ms.
    pub time_ms: u16,
}

/// A joint as it was found.
#[derive(Clone, Debug)]
pub struct Found {
    /// Its active parameters, which are those in its flash.
    pub set: ParameterSet,
    /// Gain of its position loop (60FBh:1), 1e-3 1/s.
    pub position_gain: u32,
    /// Time between two targets.
    pub interpolation: InterpolationTime,
    /// Largest following error.
    pub following: FollowingWindow,
    /// Its position, rad.
    pub position_rad: f64,
    /// Names and values for the report.
    pub facts: Vec<(String, String)>,
    /// Remarks for the user, a sentence each.
    pub warnings: Vec<String>,
}

/// Reason why a joint is not moved; one line.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// An object cannot be read.
    #[error(transparent)]
    Object(#[from] SdoError),
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] joint_bus::bus::BusError),
    /// The parameters cannot be read.
    #[error(transparent)]
    Parameters(#[from] joint_bus::parameters::ParametersError),
    /// What is missing or not permitted, and the remedy.
    #[error("{0}")]
    Joint(String),
}

fn refuse<T>(why: impl Into<String>) -> Result<T, Refusal> {
    Err(Refusal::Joint(why.into()))
}

/// What a joint is to move for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Purpose {
    /// Motions around the present position, and a trial of parameters.
    Tune,
    /// Motions around the present position.
    Move,
    /// A move to this position, rad.
    MoveTo(f64),
}

/// Examines a joint and decides whether motions within these limits are permitted. Nothing is changed.
///
/// # Errors
/// Returns one line: what must not be done, why, and the remedy.
pub fn examine<B: Bus>(
    client: &mut Client<B>,
    node: NodeId,
    limits: &MotionLimits,
    purpose: Purpose,
) -> Result<Found, Refusal> {
    let at = Address::new;
    other_master(client, node)?;
    let mut facts = vec![("joint".to_owned(), identity(client)?)];
    if client.read_number(at(index::OPERATION, 1))? != 0 {
        return refuse("the joint takes its inputs from the bus (2001h:1 = 1): it drives no motor");
    }
    let faults = client.read_number(at(index::STATE, 3))?;
    if faults != 0 {
        return refuse(format!(
            "the joint has faults: {}; `params clear` after their cause is gone",
            code_names(faults, FIRST_FAULT).join(", ")
        ));
    }
    if client.read_number(at(index::COMMISSIONING, 1))? == 0 {
        return refuse("the joint is not commissioned: run `params commission --measure` first");
    }
    check_heat(client)?;
    let status = client.read_number(at(index::STATUSWORD, 0))?;
    if status & POSITION_KNOWN == 0 {
        return refuse("the position is unknown: home the joint first (`params home`, or mode 6)");
    }
    let position_rad = micro(client.read_number(at(index::ACTUAL_POSITION, 0))?);
    let window = position_window(client)?;
    check_window(window, position_rad, limits.range_rad, purpose)?;
    let set = read_staged(client)?;
    if client.read_number(at(index::COMMIT, 1))? != set.crc() {
        return refuse("parameters are staged and not committed: `params get` discards them");
    }
    check_set(client, &set, limits)?;
    let without_network = "the former model has a network; a tuned set has none";
    let warnings = set.network.iter().map(|_| without_network.to_owned()).collect();
    let position_gain = client.read_number(at(index::POSITION_LOOP, 1))?;
    let interpolation = InterpolationTime {
        period: client.read_number(at(index::INTERPOLATION_TIME, 1))? as u8,
        exponent: client.read_number(at(index::INTERPOLATION_TIME, 2))? as i8,
    };
    let following = FollowingWindow {
        error_micro_rad: client.read_number(at(index::FOLLOWING_WINDOW, 0))?,
        time_ms: client.read_number(at(index::FOLLOWING_TIME, 0))? as u16,
    };
    if purpose == Purpose::Tune {
        check_trial(client)?;
        check_adaptation(client)?;
    }
    let [low, high] = window;
    let position = format!("{position_rad:.4} rad, window {low:.3} to {high:.3} rad");
    facts.push(("position".into(), position));
    facts.push(("parameters".into(), format!("crc {:08x}", set.crc())));
    facts.push(("lock".into(), lock(client)?.into()));
    facts.push(("temperature".into(), temperature(client)?));
    facts.extend(stops(client)?);
    Ok(Found { set, position_gain, interpolation, following, position_rad, facts, warnings })
}

/// Refuses a joint that reduces its current because it is hot. Also asked between the motions of a session.
///
/// # Errors
/// The joint is derated or does not answer.
pub fn check_heat<B: Bus>(client: &mut Client<B>) -> Result<(), Refusal> {
    let active = client.read_number(Address::new(index::STATE, 4))?;
    if active & CodeSet::of(&[Code::Derated]).limit_bits() != 0 {
        return refuse("the joint reduces its current because it is hot (derated): let it cool");
    }
    Ok(())
}

fn micro(word: u32) -> f64 {
    f64::from(word.cast_signed()) / 1e6
}

/// Refuses a bus on which another master moves the joint or sends SYNCs.
fn other_master<B: Bus>(client: &mut Client<B>, node: NodeId) -> Result<(), Refusal> {
    let until_ns = client.bus().now_ns() + LISTEN.as_nanos() as u64;
    while let Some(received) = client.bus().receive(until_ns)? {
        let Some(frame) = received.frame.to_joint() else { continue };
        let target = cob_id::RPDO_1 + u16::from(node.number());
        let who = match Message::parse(&frame) {
            Ok(Message::Sync(_)) => "sends SYNC frames (080h)",
            Ok(Message::Command(addressee, _)) if addressee == node => {
                "sends commands to this joint (300h + node)"
            }
            _ if frame.identifier() == target => "sends targets to this joint (200h + node)",
            _ => continue,
        };
        return refuse(format!("another master {who}: stop it first"));
    }
    Ok(())
}

fn identity<B: Bus>(client: &mut Client<B>) -> Result<String, SdoError> {
    let mut text = |object: u16| client.read_text(Address::new(object, 0));
    let (name, hardware, software) =
        (text(index::DEVICE_NAME)?, text(index::HARDWARE_VERSION)?, text(index::SOFTWARE_VERSION)?);
    let serial = client.read_number(Address::new(index::IDENTITY, 4))?;
    Ok(format!("{name}, {hardware}, {software}, serial {serial:08x}"))
}

/// Returns the ends of the position window, rad.
fn position_window<B: Bus>(client: &mut Client<B>) -> Result<[f64; 2], SdoError> {
    let mut end = |side| client.read_number(Address::new(index::POSITION_LIMITS, side)).map(micro);
    Ok([end(1)?, end(2)?])
}

fn check_window(
    window: [f64; 2],
    position_rad: f64,
    range_rad: f64,
    purpose: Purpose,
) -> Result<(), Refusal> {
    let [least, most] = window;
    if least >= most {
        return refuse(
            "the joint has no position window: set 607Dh:1 and :2 (`params set drive.position_min=.. drive.position_max=.. --save`, 1e-6 rad)",
        );
    }
    if let Purpose::MoveTo(to_rad) = purpose {
        if !(least..=most).contains(&to_rad) {
            return refuse(format!(
                "--to {to_rad}: expected a position in the window of {least} to {most} rad (607Dh)"
            ));
        }
        return Ok(());
    }
    let room = (position_rad - least).min(most - position_rad) - WINDOW_MARGIN_RAD;
    if room < range_rad {
        return refuse(format!(
            "--range {range_rad} rad: the joint stands at {position_rad:.3} rad in its window of {least} to {most} rad, which \
             leaves {:.3} rad to either side; move it to the middle or use a smaller range",
            room.max(0.0)
        ));
    }
    Ok(())
}

/// Checks limits of torque and speed.
fn check_set<B: Bus>(
    client: &mut Client<B>,
    set: &ParameterSet,
    limits: &MotionLimits,
) -> Result<(), Refusal> {
    let rated_nm = 1e-3 * f64::from(client.read_number(Address::new(index::RATED_TORQUE, 0))?);
    let most_permille = client.read_number(Address::new(index::MAX_TORQUE, 0))?;
    let compensation_nm = f64::from(set.friction.compensator.torque_limit_nm);
    if most_permille == 0 || compensation_nm <= 0.0 {
        return refuse(format!(
            "the limits of torque permit no motion: 6072h = {most_permille}, compensator.torque_limit_nm = {compensation_nm}"
        ));
    }
    if compensation_nm > rated_nm {
        return refuse(format!(
            "the limit of torque is missing: compensator.torque_limit_nm = {compensation_nm} is above the rated torque of \
             {rated_nm} Nm; set a limit (`params set compensator.torque_limit_nm=..`)"
        ));
    }
    let most_rad_s = SPEED_SHARE * f64::from(set.motor.velocity_max_rad_s);
    let speed = limits.speed_rad_s;
    if speed > most_rad_s {
        return refuse(format!(
            "--speed {speed} rad/s: expected at most {most_rad_s:.2} rad/s (nine tenths of motor.velocity_max_rad_s)"
        ));
    }
    Ok(())
}

/// Refuses a firmware without trials. That the active parameters are the stored ones is known when the trial opens: that is
/// after the question, because a trial changes the joint.
fn check_trial<B: Bus>(client: &mut Client<B>) -> Result<(), Refusal> {
    match client.read_number(Address::new(index::TRIAL, TrialObject::STATE)) {
        Ok(_) => Ok(()),
        Err(SdoError::Refused { code: 0x0602_0000, .. }) => {
            refuse("this firmware has no trial of parameters (2042h): update the joint first")
        }
        Err(error) => Err(error.into()),
    }
}

/// Refuses a joint that uses learnt gains: a trial would forget them, and compare with a set that the joint did not use.
fn check_adaptation<B: Bus>(client: &mut Client<B>) -> Result<(), Refusal> {
    let mode = Address::new(index::ADAPTATION, AdaptationObject::MODE);
    if client.read_number(mode)? != 0 {
        return refuse(
            "the joint uses learnt gains (2044h:1), which a trial forgets: `params set adapt adopt` makes them its set, then \
             `params set adapt off` and `params save`",
        );
    }
    Ok(())
}

/// Returns the lock in words.
fn lock<B: Bus>(client: &mut Client<B>) -> Result<&'static str, Refusal> {
    let policy = Address::new(index::ACCESS, AccessObject::LOCKED_BY_DEFAULT);
    Ok(match client.read_number(policy)? {
        0 => "open: every node may change it (2041h:6 = 0)",
        _ => "starts locked; opened with the key",
    })
}

/// Returns the last temperature that the joint received, in words.
fn temperature<B: Bus>(client: &mut Client<B>) -> Result<String, Refusal> {
    let received = client.read_float(Address::new(index::INPUTS, InputsObject::TEMPERATURE))?;
    Ok(if received.is_finite() { format!("{received:.1} degC") } else { "not measured".into() })
}

/// Returns brake and stop reactions in words.
fn stops<B: Bus>(client: &mut Client<B>) -> Result<Vec<(String, String)>, Refusal> {
    let brake = match client.read_number(Address::new(index::HOLDING_BRAKE, 1))? {
        0 => "none (2030h:1 = 0): the joint is free while the bridge is open",
        _ => "closes when the bridge opens",
    };
    let reaction = |word: u32| match word as u16 as i16 {
        -1 => "shorted motor",
        0 => "open bridge",
        _ => "ramp",
    };
    let fault = client.read_number(Address::new(index::FAULT_OPTION, 0))?;
    let lost = match client.read_number(Address::new(index::ABORT_CONNECTION, 0))? {
        1 => reaction(fault),
        2 => "open bridge",
        _ => reaction(client.read_number(Address::new(index::QUICK_STOP_OPTION, 0))?),
    };
    Ok(vec![
        ("brake".into(), brake.into()),
        ("stops".into(), format!("fault: {}, lost connection: {lost}", reaction(fault))),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn window_without_room_is_refused_with_what_is_possible() {
        assert!(check_window([-1.0, 1.0], 0.0, 0.4, Purpose::Tune).is_ok());
        let missing = check_window([0.0, 0.0], 0.0, 0.4, Purpose::Move).unwrap_err().to_string();
        assert!(missing.contains("607Dh"), "{missing}");
        let narrow = check_window([-1.0, 1.0], 0.8, 0.4, Purpose::Move).unwrap_err().to_string();
        assert!(narrow.contains(" 0.180 rad"), "{narrow}");
        crate::snapshot::check("session", "windows without room", &(missing + "\n" + &narrow));
        assert!(check_window([-1.0, 1.0], 0.8, 0.4, Purpose::MoveTo(-0.9)).is_ok());
        assert!(check_window([-1.0, 1.0], 0.8, 0.4, Purpose::MoveTo(1.1)).is_err());
    }
}
