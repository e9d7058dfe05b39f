//! `params`: reads and writes a joint driver's parameters.
//!
//! `get`, `diff` and `set` use the same file format. A typical session is `params get > joint.toml`, an editor,
//! `params diff joint.toml`, and `params set joint.toml`.
//!
//! A change is atomic: values are staged in the driver and committed together, with the CRC of the intended set. `save`
//! keeps the parameters over a reset.

mod adaptation;
mod brake_test;
mod commission;
mod drive;
mod friction_run;
mod measure;
mod set;
mod status;
mod trend;

use super::bus::BusArguments;
use super::error::{Result, in_part, unfit};
use super::export::CompensatedArguments;
use super::network::{self, for_driver};
use super::output::{print_result, print_text};
use crate::driver_file;
use canopen_rs::{Address, NmtCommand};
use clap::Subcommand;
use compensator_core::ParameterError;
use compensator_core::can::NodeId;
use compensator_core::can::slcan::BitRate;
use firmware::node::dictionary::records::TraceObject;
use firmware::node::dictionary::{LOAD_SIGNATURE, SAVE_SIGNATURE, index};
use firmware::parameter_set::ParameterSet;
use firmware::supervisor::Code;
use friction_fit::params::{self, ParameterFile};
use joint_bus::bus::{Bus, BusName, Hub};
use joint_bus::canopen::{Client, SdoError};
use joint_bus::codes::ReportedState;
use joint_bus::parameters::read_set;
use joint_log::JointKind;
use joint_rig::MotorNode;
use joint_tuning::names::{NameError, choices, differences, numbers};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Arguments of `params`.
#[derive(clap::Args)]
pub struct ParamsArguments {
    #[command(subcommand)]
    action: Action,
    #[command(flatten)]
    bus: GlobalBus,
    /// Print the result as JSON
    #[arg(long, global = true)]
    json: bool,
}

/// The bus arguments, accepted before or after the action.
#[derive(clap::Args)]
#[command(next_help_heading = "Bus")]
struct GlobalBus {
    /// Bus: a SocketCAN interface such as can0, slcan:PATH or slcan:HOST:PORT, or loop
    ///
    /// `loop` is a driver in this process that ends with it.
    #[arg(long, value_name = "BUS", global = true)]
    bus: Option<BusName>,
    /// With --bus loop: simulate a motor and a joint; the driver is not commissioned
    #[arg(long, global = true)]
    motor: bool,
    /// Node number of the joint driver
    #[arg(long, value_name = "N", default_value = "1", global = true, value_parser = super::bus::node)]
    node_id: NodeId,
    /// Bit rate for an slcan adapter, bit/s
    #[arg(long, value_name = "BIT/S", default_value = "1000000", global = true, value_parser = super::bus::bit_rate, hide_short_help = true)]
    bit_rate: BitRate,
    /// Key that unlocks the joint: a file with 32 hexadecimal digits
    ///
    /// By default the file that FRICTION_JOINT_KEY names, or the public default key.
    #[arg(long, value_name = "FILE", global = true)]
    key: Option<PathBuf>,
}

#[derive(Subcommand)]
enum Action {
    /// Print all parameters as a file, or the values of some names
    Get {
        /// Names such as static_torque, compensator.scale, motor.gear_ratio, drive.position_min; all by default, in a file
        /// without those of the drive
        #[arg(value_name = "NAME")]
        names: Vec<String>,
        /// Write the driver's network to this file and refer to it in the printed file
        #[arg(long, value_name = "NETWORK.JSON", conflicts_with = "names")]
        network: Option<PathBuf>,
    },
    /// Set parameters from NAME=VALUE or from a file
    Set {
        /// NAME=VALUE, a parameter file, or `adapt` and one of on, hold, off, adopt, discard
        ///
        /// `adapt on` lets the joint learn its friction levels, `hold` keeps what it learnt, `off` returns to the set.
        /// `adapt adopt` makes what it learnt its set, `adapt discard` forgets it.
        #[arg(value_name = "NAME=VALUE|PARAMS.TOML|adapt MODE", required = true)]
        what: Vec<String>,
        /// Also save the parameters, so that the driver keeps them over a reset
        #[arg(long)]
        save: bool,
        #[command(flatten)]
        taken: CompensatedArguments,
    },
    /// Show the differences between the driver and a file, or what it has learnt; exit code 1 if there are any
    Diff {
        /// Parameter file
        #[arg(value_name = "PARAMS.TOML", required_unless_present = "learnt")]
        file: Option<PathBuf>,
        /// Show the friction levels that the joint has learnt, beside its set
        #[arg(long, conflicts_with = "file")]
        learnt: bool,
    },
    /// Print the stored trend of the learnt friction level over the time of learning
    Trend {
        /// Also write the trend to this file, which `fleet` reads: FILE.json or FILE.csv
        #[arg(long, value_name = "FILE")]
        write: Option<PathBuf>,
    },
    /// Save parameters and settings, so that the driver keeps them over a reset
    Save,
    /// Restore the default parameters at the next reset
    Restore,
    /// Show identity, state, faults, limits and counters of the driver
    Status,
    /// Arm the joint
    Arm,
    /// Disarm the joint
    Disarm,
    /// Clear the faults of the driver
    Clear,
    /// Set the current position of the joint
    ///
    /// The joint must be at rest and disarmed, for example at an end stop.
    Home {
        /// Current position, rad
        #[arg(value_name = "RAD", default_value_t = 0.0, allow_negative_numbers = true)]
        position_rad: f32,
    },
    /// Show, measure or confirm the wiring parameters of motor, encoder and gear
    ///
    /// The joint cannot be armed before they are confirmed.
    Commission {
        /// Confirm the wiring parameters, after checking them on this joint at low current
        #[arg(long, conflicts_with_all = ["measure", "friction_run"])]
        confirm: bool,
        #[command(flatten)]
        measure: measure::MeasureArguments,
    },
    /// Test the holding brake: the motor presses against it in both directions; exit code 1 if it does not hold
    ///
    /// The joint must be disarmed. drive.brake_test_torque, drive.brake_test_ms and drive.brake_test_way set the test.
    BrakeTest,
    /// Restart the driver
    Reset,
}

/// Runs the command.
pub fn run(arguments: &ParamsArguments) -> Result<ExitCode> {
    let bus = bus_arguments(arguments)?;
    let hub = if arguments.bus.motor {
        bus.check_motor("--motor")?;
        let hub = Hub::new();
        hub.attach(MotorNode::start()?);
        hub
    } else {
        bus.hub_with_driver()?
    };
    let mut driver = Driver { client: bus.client(bus.open(&hub)?)? };
    run_action(&mut driver, arguments, &bus)
}

/// Checks the arguments and returns those of the bus. A friction run records the bus to its trace.
fn bus_arguments(arguments: &ParamsArguments) -> Result<BusArguments> {
    let bus = arguments.bus.bus.clone().ok_or_else(|| {
        let reason = "expected a SocketCAN interface such as can0, slcan:PATH, slcan:HOST:PORT, or loop (a \
         driver in this process that ends with it)";
        unfit("--bus is missing", reason)
    })?;
    let record = match &arguments.action {
        Action::Commission { measure, .. } => {
            measure.check()?;
            measure.friction_trace()?
        }
        _ => None,
    };
    let GlobalBus { node_id, bit_rate, key, .. } = &arguments.bus;
    Ok(BusArguments { bus, node_id: *node_id, bit_rate: *bit_rate, record, key: key.clone() })
}

/// Runs the action and prints its result, or in one line what was done.
fn run_action(
    driver: &mut Driver,
    arguments: &ParamsArguments,
    bus: &BusArguments,
) -> Result<ExitCode> {
    let (json, name, trace) = (arguments.json, &bus.joint_name(), bus.record.as_deref());
    let printed = |()| ExitCode::SUCCESS;
    let done = match &arguments.action {
        Action::Get { names, network } => {
            return driver.get(names, network.as_deref(), json).map(printed);
        }
        Action::Diff { file, .. } => {
            return match file {
                Some(file) => driver.diff(file, json),
                None => driver.diff_learnt(json),
            };
        }
        Action::Trend { write } => return driver.trend(write.as_deref(), json).map(printed),
        Action::Status => return driver.status(json).map(printed),
        Action::BrakeTest => return driver.brake_test(name, json),
        Action::Set { what, save, taken } => driver.set(what, *save, taken)?,
        Action::Save => {
            driver.store(index::STORE, SAVE_SIGNATURE)?;
            "parameters and settings saved, kept over a reset".to_owned()
        }
        Action::Restore => {
            driver.store(index::RESTORE, LOAD_SIGNATURE)?;
            "default parameters will be restored at the next reset".to_owned()
        }
        Action::Arm => driver.request(1)?,
        Action::Disarm => driver.request(0)?,
        Action::Clear => "faults cleared, ".to_owned() + &driver.request(2)?,
        Action::Home { position_rad } => {
            driver.client.write(Address::new(index::STATE, 6), &position_rad.to_le_bytes())?;
            format!("position set to {position_rad} rad")
        }
        Action::Commission { measure, .. } if measure.measure || trace.is_some() => {
            if measure.measure {
                driver.measure_motor(measure, name, json)?;
            }
            return trace
                .map_or(Ok(()), |trace| driver.friction_run(measure, name, trace, json))
                .map(printed);
        }
        Action::Commission { confirm, .. } => {
            return driver.commission(*confirm, json).map(printed);
        }
        Action::Reset => {
            driver.client.command(NmtCommand::ResetNode)?;
            "restart command sent".to_owned()
        }
    };
    let text = if json {
        json!({"node": bus.node_id.number(), "bus": bus.bus.to_string(), "done": done}).to_string()
    } else {
        format!("{name}: {done}")
    };
    print_text(&(text + "\n")).map(printed)
}

/// Returns why the law is not passive; `None` if it is passive.
fn passivity_error(set: &ParameterSet) -> Option<ParameterError> {
    let mut model = set.friction.model.clone();
    model.choices.allow_active = false;
    model.validate().err()
}

/// A joint driver on the bus.
struct Driver {
    client: Client<Box<dyn Bus>>,
}

/// A refused change of the state.
#[derive(Debug, thiserror::Error)]
#[error("{refused}{remedies}")]
struct NotRequested {
    refused: SdoError,
    remedies: String,
}

/// Returns what ends the cause of each code that a refusal names.
fn remedies(refusal: &str) -> String {
    let mut text = String::new();
    for &code in Code::ALL {
        let name = code.info().name;
        if refusal.split([' ', ':']).any(|word| word == name) {
            text += &format!("; {name} ends by: {}", code.description().cleared_by);
        }
    }
    if refusal.contains(Code::CommandTimeout.info().name) {
        text += " (a Command or a CiA 402 target of a master, in the network state operational)";
    }
    text
}

impl Driver {
    fn number(&mut self, at_index: u16, place: u8) -> Result<u32> {
        Ok(self.client.read_number(Address::new(at_index, place))?)
    }

    fn get(&mut self, names: &[String], network: Option<&Path>, json: bool) -> Result {
        let set = read_set(&mut self.client)?;
        let joint = self.joint_kind()?;
        let beside = match (&set.network, network) {
            (Some(has), Some(path)) => Some(network::write(has, joint, path)?),
            (None, Some(path)) => {
                return Err(unfit(
                    format!("--network {}", path.display()),
                    "the driver has no network",
                ));
            }
            (Some(_), None) if names.is_empty() => {
                eprintln!(
                    "warning: the driver's network is not included; use --network NETWORK.JSON to write it to a file"
                );
                None
            }
            _ => None,
        };
        if names.is_empty() && !json {
            let mut text = driver_file::emit(&set, joint);
            if let Some((name, content)) = &beside {
                params::emit_network(name, content, &mut text);
            }
            return print_text(&text);
        }
        let numbers = numbers(&set)
            .into_iter()
            .map(|(name, value)| (name, json!(value), format!("{value:?}")));
        let choices = choices(&set).into_iter().map(|(name, on)| (name, json!(on), on.to_string()));
        let mut all: Vec<(String, serde_json::Value, String)> = choices.chain(numbers).collect();
        for (name, at) in drive::names() {
            let value = self.drive_setting(at)?;
            all.push((name, json!(value), value.to_string()));
        }
        let chosen: Vec<_> = if names.is_empty() {
            all.iter().collect()
        } else {
            let found = names.iter().map(|name| {
                let known = || all.iter().map(|entry| entry.0.clone());
                let entry = all.iter().find(|entry| entry.0 == *name);
                entry.ok_or_else(|| NameError::unknown(name, known()))
            });
            found.collect::<Result<_, _>>()?
        };
        let object: serde_json::Map<_, _> =
            chosen.iter().map(|(name, value, _)| (name.clone(), value.clone())).collect();
        let text: String =
            chosen.iter().map(|(name, _, value)| format!("{name} = {value}\n")).collect();
        print_result(json, &object, &text)
    }

    /// Reads the kind of joint: revolute, unless a log of a prismatic joint was written to the driver.
    fn joint_kind(&mut self) -> Result<JointKind> {
        let kind = self.number(index::TRACE, TraceObject::JOINT_KIND)?;
        Ok(if kind == 0 { JointKind::Revolute } else { JointKind::Prismatic })
    }

    /// Reads a parameter file and checks that it is for the same kind of joint as the driver.
    fn read_file(&mut self, path: &Path) -> Result<ParameterFile> {
        let file = driver_file::read(path)?;
        let driver = self.joint_kind()?;
        if file.joint == driver {
            return Ok(file);
        }
        let kind_name = |kind| if kind == JointKind::Revolute { "revolute" } else { "prismatic" };
        let found = format!(
            "found a {} joint ({}), but the driver's joint is {} ({})",
            kind_name(file.joint),
            file.joint.torque_unit(),
            kind_name(driver),
            driver.torque_unit()
        );
        Err(unfit(path.display(), found))
    }

    fn diff(&mut self, path: &Path, json: bool) -> Result<ExitCode> {
        let has = read_set(&mut self.client)?;
        let mut wants = has.clone();
        let file = self.read_file(path)?;
        let network = for_driver(&file).map_err(in_part(path.display()))?;
        driver_file::apply(&file, network, &mut wants);
        let lines = differences(&has, &wants);
        let rows: Vec<_> = lines
            .iter()
            .map(|of| json!({"name": of.name, "driver": of.before, "file": of.after}))
            .collect();
        let text: String = match lines.is_empty() {
            true => format!("no difference from {}\n", path.display()),
            false => lines
                .iter()
                .map(|of| format!("{}: driver {}, file {}\n", of.name, of.before, of.after))
                .collect(),
        };
        print_result(json, &rows, &text)?;
        Ok(ExitCode::from(u8::from(!lines.is_empty())))
    }

    fn store(&mut self, at_index: u16, word: u32) -> Result {
        Ok(self.client.write(Address::new(at_index, 1), &word.to_le_bytes())?)
    }

    /// Requests a state change and returns the resulting state.
    fn request(&mut self, request: u8) -> Result<String> {
        let requested = self.client.write(Address::new(index::STATE, 1), &[request]);
        requested.map_err(|refused| {
            let remedies = remedies(&refused.to_string());
            NotRequested { refused, remedies }
        })?;
        self.state()
    }

    fn state(&mut self) -> Result<String> {
        Ok(ReportedState::from_number(self.number(index::STATE, 2)?).name().to_lowercase())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusal_with_codes_states_what_ends_each_of_them() {
        let refusal = "refused: not armed: command-timeout can-bus-off";
        let text = refusal.to_owned() + &remedies(refusal);
        for name in ["command-timeout", "can-bus-off"] {
            assert_eq!(text.matches(name).count(), 2, "the code and its remedy: {text}");
        }
        crate::snapshot::check("units-of-commands", "remedies of two codes", &text);
        assert_eq!(remedies("no code: moving"), "");
    }
}
