//! `params`: reads and writes a joint driver's parameters.
//!
//! `get` prints a file, `diff` compares with one, `set` takes one: the same format throughout, so that
//! `params get > joint.toml`, an editor, `params diff joint.toml` and `params set joint.toml` are all there is
//! to it. Nothing is changed half: values are staged in the driver and committed together, by the CRC of what
//! was meant; `save` makes them outlive a reset.

mod commission;
mod friction_run;
mod names;
mod network;
mod status;

use super::bus::BusArguments;
use super::output::say;
use crate::driver_file;
use crate::joint_rig::MotorNode;
use crate::loop_cost;
use canopen_rs::{Address, NmtCommand};
use clap::Subcommand;
use compensator_core::ParameterError;
use compensator_core::can::Node;
use compensator_core::can::slcan::BitRate;
use firmware::node::dictionary::records::Trace;
use firmware::node::dictionary::{LOAD, SAVE, index};
use firmware::parameter_set::ParameterSet;
use friction_identification::data::JointKind;
use friction_identification::params::{self, ParameterFile};
use joint_bus::bus::{Bus, BusName, Hub};
use joint_bus::canopen::{Client, SdoError};
use joint_bus::joint::JointNode;
use joint_bus::parameters::{read_set, read_staged, write_set};
use names::{choices, differences, numbers, put, unknown};
use network::write_network;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Arguments of `params`.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    action: Action,
    #[command(flatten)]
    bus: GlobalBus,
    /// Print the result as JSON
    #[arg(long, global = true)]
    json: bool,
}

/// The bus, given before or after the action.
#[derive(clap::Args)]
struct GlobalBus {
    /// The bus: an interface as can0, slcan:PATH or slcan:HOST:PORT; loop is a driver in this process, gone
    /// with it
    #[arg(long, value_name = "BUS", global = true)]
    bus: Option<BusName>,
    /// With --bus loop: the driver has a motor and a joint, simulated, of which it knows nothing yet
    #[arg(long, global = true)]
    motor: bool,
    /// Number of the joint driver on the bus
    #[arg(long, value_name = "N", default_value_t = 1, global = true, value_parser = clap::value_parser!(u8).range(1..=127))]
    node_id: u8,
    /// Bit rate an slcan adapter is opened with, bit/s
    #[arg(long, value_name = "BIT/S", default_value = "1000000", global = true, value_parser = super::bus::bit_rate)]
    bit_rate: BitRate,
}

#[derive(Subcommand)]
enum Action {
    /// Print the parameters as a file, or the values of some names
    Get {
        /// As static_torque, compensator.scale, motor.gear_ratio; all without any
        #[arg(value_name = "NAME")]
        names: Vec<String>,
        /// Write the driver's network to this file, and name it in the file that is printed
        #[arg(long, value_name = "NETWORK.JSON", conflicts_with = "names")]
        network: Option<PathBuf>,
    },
    /// Set parameters: NAME=VALUE, or a file
    Set {
        /// NAME=VALUE..., or PARAMS.TOML
        #[arg(value_name = "NAME=VALUE|PARAMS.TOML", required = true)]
        what: Vec<String>,
        /// Save them too
        #[arg(long)]
        save: bool,
    },
    /// Show where the driver differs from a file; exit code 1 if it does
    Diff {
        /// The file
        #[arg(value_name = "PARAMS.TOML")]
        file: PathBuf,
    },
    /// Make the driver keep its parameters and settings over a reset
    Save,
    /// Make the driver start with its defaults from the next reset on
    Restore,
    /// Identity, state, faults, limits and counters of the driver
    Status,
    /// Arm the joint
    Arm,
    /// Disarm the joint
    Disarm,
    /// Clear its faults
    Clear,
    /// Say where the joint is now, at rest and disarmed: at a stop, or as a sensor behind the gear tells
    Home {
        /// Its position, rad
        #[arg(value_name = "RAD", default_value_t = 0.0, allow_negative_numbers = true)]
        position_rad: f32,
    },
    /// Show how motor, encoder and gear are said to be wired, and whether that was confirmed: before, the joint does not arm; or
    /// let the driver find it out by itself (--measure)
    Commission {
        /// Confirm it: on this joint, at low current, it was seen to be so
        #[arg(long, conflicts_with_all = ["measure", "friction_run"])]
        confirm: bool,
        #[command(flatten)]
        measure: commission::Measure,
    },
    /// Restart the driver
    Reset,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> Result<ExitCode, String> {
    let node = Node::new(arguments.bus.node_id)
        .ok_or_else(|| "--node-id: expected 1 to 127".to_owned())?;
    let bus = arguments.bus.bus.clone().ok_or_else(|| {
        "which joint? --bus is missing: an interface as can0, slcan:PATH, slcan:HOST:PORT, or loop (a driver \
         in this process, gone with it)"
            .to_owned()
    })?;
    let name = format!("node {} on {bus}", arguments.bus.node_id);
    let record = match &arguments.action {
        Action::Commission { measure, .. } => {
            measure.check()?;
            measure.friction_trace()?
        }
        _ => None,
    };
    let bus = BusArguments { bus, node_id: node, bit_rate: arguments.bus.bit_rate, record };
    let hub = Hub::new();
    match (&bus.bus, arguments.bus.motor) {
        (BusName::Loop, true) if node != Node::FIRST => {
            return Err("--motor: the simulated joint is node 1".into());
        }
        (BusName::Loop, true) => hub.attach(MotorNode::start()?),
        (BusName::Loop, false) => {
            hub.attach(JointNode::start(node, None).map_err(|error| error.to_string())?);
        }
        (_, true) => return Err("--motor: goes with --bus loop".into()),
        _ => {}
    }
    let mut driver = Driver { client: Client::new(bus.open(&hub)?, node) };
    // What was done, in one line; what only reads has printed it.
    let done = match &arguments.action {
        Action::Get { names, network } => {
            let got = driver.get(names, network.as_deref(), arguments.json);
            return got.map(|()| ExitCode::SUCCESS);
        }
        Action::Diff { file } => return driver.diff(file, arguments.json),
        Action::Status => return driver.status(arguments.json).map(|()| ExitCode::SUCCESS),
        Action::Set { what, save } => driver.set(what, *save)?,
        Action::Save => {
            driver.store(index::STORE, SAVE)?;
            "parameters and settings saved, kept over a reset".to_owned()
        }
        Action::Restore => {
            driver.store(index::RESTORE, LOAD)?;
            "starts with its defaults from the next reset on".to_owned()
        }
        Action::Arm => driver.request(1)?,
        Action::Disarm => driver.request(0)?,
        Action::Clear => "faults cleared, ".to_owned() + &driver.request(2)?,
        Action::Home { position_rad } => {
            let at = Address::new(index::STATE, 6);
            driver.client.write(at, &position_rad.to_le_bytes()).map_err(words)?;
            format!("its position is {position_rad} rad now")
        }
        Action::Commission { measure, .. } if measure.is_asked() || bus.record.is_some() => {
            if measure.is_asked() {
                driver.measure_motor(measure, &name, arguments.json)?;
            }
            if let Some(trace) = &bus.record {
                driver.friction_run(measure, &name, trace, arguments.json)?;
            }
            return Ok(ExitCode::SUCCESS);
        }
        Action::Commission { confirm, .. } => {
            let done = driver.commission(*confirm, arguments.json);
            return done.map(|()| ExitCode::SUCCESS);
        }
        Action::Reset => {
            let sent = driver.client.command(NmtCommand::ResetNode);
            sent.map_err(|error| error.to_string())?;
            "told to restart".to_owned()
        }
    };
    let text = if arguments.json {
        json!({"node": arguments.bus.node_id, "bus": bus.bus.to_string(), "done": done}).to_string()
    } else {
        format!("{name}: {done}")
    };
    say(&(text + "\n")).map(|()| ExitCode::SUCCESS)
}

/// So many changes are named one by one.
const CHANGES_NAMED: usize = 6;

/// Why the law of a set is not passive, where it is not and is allowed to be.
fn is_active(set: &ParameterSet) -> Option<ParameterError> {
    let mut model = set.friction.model.clone();
    model.choices.allow_active = false;
    model.validate().err()
}

struct Driver {
    client: Client<Box<dyn Bus>>,
}

fn words(error: SdoError) -> String {
    error.to_string()
}

impl Driver {
    fn number(&mut self, at_index: u16, place: u8) -> Result<u32, String> {
        self.client.read_number(Address::new(at_index, place)).map_err(words)
    }

    /// The active set; what was staged and not committed is dropped.
    fn read_set(&mut self) -> Result<ParameterSet, String> {
        read_set(&mut self.client).map_err(|error| error.to_string())
    }

    /// Drops what is staged.
    fn discard(&mut self) -> Result<(), String> {
        self.client.write(Address::new(index::COMMIT, 4), &[1]).map_err(words)
    }

    /// The staged set: the active one, where nothing else is.
    fn read_staged(&mut self) -> Result<ParameterSet, String> {
        read_staged(&mut self.client).map_err(|error| error.to_string())
    }

    /// Stages a set and commits it, whole; gives its CRC.
    fn commit(&mut self, set: &ParameterSet) -> Result<u32, String> {
        write_set(&mut self.client, set).map_err(|error| error.to_string())
    }

    fn get(&mut self, names: &[String], network: Option<&Path>, json: bool) -> Result<(), String> {
        let set = self.read_set()?;
        let joint = self.joint_kind()?;
        let beside = match (&set.network, network) {
            (Some(has), Some(path)) => Some(write_network(has, joint, path)?),
            (None, Some(path)) => {
                return Err(format!("--network {}: the driver has none", path.display()));
            }
            (Some(_), None) if names.is_empty() => {
                eprintln!(
                    "warning: the driver has a network, which is left out: --network NETWORK.JSON writes it beside"
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
            return say(&text);
        }
        let numbers = numbers(&set)
            .into_iter()
            .map(|(name, value)| (name, json!(value), format!("{value:?}")));
        let choices = choices(&set).into_iter().map(|(name, on)| (name, json!(on), on.to_string()));
        let all: Vec<(String, serde_json::Value, String)> = choices.chain(numbers).collect();
        let chosen: Vec<_> = if names.is_empty() {
            all.iter().collect()
        } else {
            let found = names.iter().map(|name| {
                let known = || all.iter().map(|entry| entry.0.clone()).collect::<Vec<_>>();
                all.iter().find(|entry| entry.0 == *name).ok_or_else(|| unknown(name, &known()))
            });
            found.collect::<Result<_, _>>()?
        };
        let mut text = String::new();
        if json {
            let object: serde_json::Map<_, _> =
                chosen.iter().map(|(name, value, _)| (name.clone(), value.clone())).collect();
            text = serde_json::to_string_pretty(&object).map_err(|e| e.to_string())? + "\n";
        } else {
            for (name, _, value) in chosen {
                text += &format!("{name} = {value}\n");
            }
        }
        say(&text)
    }

    /// Whether the joint turns or slides: it turns, unless it was fed a log of one that slides.
    fn joint_kind(&mut self) -> Result<JointKind, String> {
        let kind = self.number(index::TRACE, Trace::JOINT_KIND)?;
        Ok(if kind == 0 { JointKind::Revolute } else { JointKind::Prismatic })
    }

    /// The file of a joint of this kind.
    fn read_file(&mut self, path: &Path) -> Result<ParameterFile, String> {
        let file = driver_file::read(path).map_err(|error| error.to_string())?;
        let driver = self.joint_kind()?;
        if file.joint == driver {
            return Ok(file);
        }
        let moves = |kind| if kind == JointKind::Revolute { "turns" } else { "slides" };
        Err(format!(
            "{}: is of a joint that {} ({}), the driver's {} ({})",
            path.display(),
            moves(file.joint),
            file.joint.torque_unit(),
            moves(driver),
            driver.torque_unit()
        ))
    }

    /// Sets what was given; says what changed.
    fn set(&mut self, what: &[String], save: bool) -> Result<String, String> {
        let before = self.read_set()?;
        let mut set = before.clone();
        for item in what {
            match item.split_once('=') {
                Some((name, value)) => put(&mut set, name.trim(), value.trim())?,
                None => {
                    let file = self.read_file(Path::new(item))?;
                    let refused = |why| format!("{item}: {why}");
                    driver_file::apply(&file, &mut set).map_err(refused)?;
                }
            }
        }
        // Said here already what the driver would say: in the file's words, and before it is touched.
        set.validate().map_err(|error| error.to_string())?;
        if let Some(error) = is_active(&set) {
            eprintln!(
                "warning: allow_active: the law can give out energy and so keep the joint moving: {error}"
            );
        }
        if let Some(late) = loop_cost::warning(set.friction.model.terms.as_slice()) {
            eprintln!("warning: {late}");
        }
        let active = self.commit(&set)?;
        if save {
            self.store(index::STORE, SAVE)?;
        }
        let changed: Vec<String> = differences(&before, &set)
            .into_iter()
            .map(|(name, from, to)| format!("{name} {from} -> {to}"))
            .collect();
        let changed = match changed.len() {
            0 => "nothing changed".to_owned(),
            1..=CHANGES_NAMED => changed.join(", "),
            count => format!("{count} values changed"),
        };
        let kept = if save { "saved" } else { "until a reset, unless saved" };
        Ok(format!("{changed} (crc {active:08x}, {kept})"))
    }

    fn diff(&mut self, path: &Path, json: bool) -> Result<ExitCode, String> {
        let has = self.read_set()?;
        let mut wants = has.clone();
        let refused = |why| format!("{}: {why}", path.display());
        driver_file::apply(&self.read_file(path)?, &mut wants).map_err(refused)?;
        let lines = differences(&has, &wants);
        let text = if json {
            let rows: Vec<_> = lines
                .iter()
                .map(|(name, has, wants)| json!({"name": name, "driver": has, "file": wants}))
                .collect();
            serde_json::to_string_pretty(&rows).map_err(|e| e.to_string())? + "\n"
        } else if lines.is_empty() {
            format!("no difference from {}\n", path.display())
        } else {
            lines.iter().fold(String::new(), |text, (name, has, wants)| {
                text + &format!("{name}: driver {has}, file {wants}\n")
            })
        };
        say(&text)?;
        Ok(if lines.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(1) })
    }

    fn store(&mut self, at_index: u16, word: u32) -> Result<(), String> {
        self.client.write(Address::new(at_index, 1), &word.to_le_bytes()).map_err(words)
    }

    /// Asks the driver for a state; says the one it is in then.
    fn request(&mut self, request: u8) -> Result<String, String> {
        self.client.write(Address::new(index::STATE, 1), &[request]).map_err(words)?;
        self.state().map(str::to_owned)
    }

    fn state(&mut self) -> Result<&'static str, String> {
        Ok(match self.number(index::STATE, 2)? {
            0 => "safe",
            1 => "armed",
            2 => "fault",
            _ => "unknown",
        })
    }
}
