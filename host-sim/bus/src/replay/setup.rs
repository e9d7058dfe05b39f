//! Prepares a driver for a replay: inputs from the bus, period, parameters, armed.

use super::CoreJoint;
use crate::bus::Bus;
use crate::canopen::{Client, SdoError, name};
use crate::joint::JointError;
use crate::parameters::{ParametersError, read_set, write_set};
use canopen_rs::{Address, NmtCommand};
use compensator_core::ParameterError;
use compensator_core::can::NodeId;
use compensator_core::configuration::Configuration;
use compensator_core::network::JointNetwork;
use firmware::drive_settings::DriveSettings;
use firmware::hil::{HilJoint, HilSetup, NumberType};
use firmware::level_learner::OFF;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::{AdaptationObject, OperationObject};
use firmware::node_settings::{InputSource, PERIOD_RANGE_S};

/// Settings of a replay.
#[derive(Clone, Debug)]
pub struct ReplaySetup {
    /// Friction model; `None` keeps that of the driver.
    pub friction: Option<Configuration>,
    /// Network of the friction model, if it has one; ignored without a model.
    pub network: Option<JointNetwork>,
    /// Number type; `None` keeps that of the driver.
    pub number: Option<NumberType>,
    /// Time between SYNCs, s.
    pub period_s: f32,
    /// Mode of the adaptation of the friction levels (2044h:1); `None` keeps that of the driver.
    pub adaptation: Option<u8>,
}

/// Error of the set-up; its message is one line.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum SetupError {
    /// A driver in this process does not start.
    #[error("driver: {0}")]
    Start(#[from] JointError),
    /// The driver refuses or does not answer.
    #[error(transparent)]
    Sdo(#[from] SdoError),
    /// The parameters cannot be read or written.
    #[error(transparent)]
    Parameters(#[from] ParametersError),
    /// The driver has a setting of a newer version.
    #[error("{object}: found {found}, which this version does not know")]
    Unknown { object: String, found: u32 },
    /// The core cannot be built from the parameters.
    #[error("{0}")]
    Build(ParameterError),
    /// The trace is too slow or too fast for a driver.
    #[error("{found_s} s between SYNCs, expected {} to {} s", PERIOD_RANGE_S.0, PERIOD_RANGE_S.1)]
    Period { found_s: f32 },
}

/// Sets up, arms and starts the driver. Returns the core that its answers must match.
///
/// # Errors
/// See [`SetupError`].
pub fn set_up<B: Bus>(
    client: &mut Client<B>,
    node: NodeId,
    setup: &ReplaySetup,
) -> Result<CoreJoint, SetupError> {
    let at = Address::new;
    if !(PERIOD_RANGE_S.0..=PERIOD_RANGE_S.1).contains(&setup.period_s) {
        return Err(SetupError::Period { found_s: setup.period_s });
    }
    client.write(at(index::STATE, 1), &[0])?;
    client.write(at(index::OPERATION, 1), &[InputSource::Bus as u8])?;
    if let Some(number) = setup.number {
        client.write(at(index::OPERATION, 2), &[number as u8])?;
    }
    client.write(at(index::OPERATION, 3), &setup.period_s.to_le_bytes())?;
    if let Some(friction) = &setup.friction {
        let mut set = read_set(client)?;
        (set.friction, set.network) = (friction.clone(), setup.network.clone());
        write_set(client, &set)?;
    }
    if let Some(mode) = setup.adaptation {
        client.write(at(index::ADAPTATION, AdaptationObject::MODE), &[mode])?;
    }
    let set = read_set(client)?;
    let number_at = at(index::OPERATION, OperationObject::NUMBER);
    let code = client.read_number(number_at)?;
    let number = NumberType::from_code(code as u8).ok_or_else(|| unknown(number_at, code))?;
    let campaign_h = client.read_float(at(index::OPERATION, 4))?;
    let hil_setup = HilSetup { number, period_s: setup.period_s, campaign_h };
    let joint = HilJoint::build(node, &set.friction, set.network.as_ref(), hil_setup)
        .map_err(SetupError::Build)?;
    let settings = read_adaptation(client)?;
    let core = match settings.adapt {
        OFF => joint.into(),
        _ => CoreJoint::with_adaptation(joint, set, settings),
    };
    // Starts a new run, so that driver and core have the same initial state.
    client.write(at(index::TRACE, 1), &0u32.to_le_bytes())?;
    client.command(NmtCommand::StartRemoteNode).map_err(SdoError::from)?;
    client.write(at(index::STATE, 1), &[1])?;
    Ok(core)
}

fn unknown(at: Address, found: u32) -> SetupError {
    SetupError::Unknown { object: name(at), found }
}

/// Reads the settings of the adaptation; the other settings have their defaults.
fn read_adaptation<B: Bus>(client: &mut Client<B>) -> Result<DriveSettings, SetupError> {
    let mut settings = DriveSettings::default();
    for (at_index, place) in DriveSettings::PLACES {
        if at_index == index::ADAPTATION {
            let at = Address::new(at_index, place);
            let number = client.read_number(at)?;
            let set = settings.set(at_index, place, number);
            set.and_then(Result::ok).ok_or_else(|| unknown(at, number))?;
        }
    }
    Ok(settings)
}
