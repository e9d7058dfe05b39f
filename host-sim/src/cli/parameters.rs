//! `params`: reads and writes a joint driver's parameters.
//!
//! `get` prints a file, `diff` compares with one, `set` takes one: the same format throughout, so that
//! `params get > joint.toml`, an editor, `params diff joint.toml` and `params set joint.toml` are all there is
//! to it. Nothing is changed half: values are staged in the driver and committed together, by the CRC of what
//! was meant; `save` makes them outlive a reset.

use super::bus::BusArguments;
use super::output::say;
use crate::driver_file;
use canopen_rs::{Address, NmtCommand};
use clap::Subcommand;
use compensator_core::compensator::CompensatorParameters;
use compensator_core::parameters::Envelope;
use compensator_core::{ParameterId, record};
use firmware::control::MotorParameters;
use firmware::node::dictionary::records::Commissioning;
use firmware::node::dictionary::{FRAME_COUNTERS, LOAD, SAVE, index};
use firmware::parameter_set::{DRIVE_LENGTH, ParameterSet};
use firmware::supervisor::{Code, Thresholds};
use firmware::watch::WatchParameters;
use friction_identification::data::JointKind;
use joint_bus::bus::{Bus, BusName, Hub};
use joint_bus::canopen::{Client, SdoError};
use joint_bus::joint::JointNode;
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
    /// The bus: loop (a driver in this process), an interface as vcan0, slcan:PATH or slcan:HOST:PORT
    #[arg(long, value_name = "BUS", default_value = "loop", global = true)]
    bus: BusName,
    /// Number of the joint driver on the bus
    #[arg(long, value_name = "N", default_value_t = 1, global = true, value_parser = clap::value_parser!(u8).range(1..=127))]
    node_id: u8,
}

#[derive(Subcommand)]
enum Action {
    /// Print the parameters as a file, or the values of some names
    Get {
        /// As static_torque, compensator.scale, motor.gear_ratio; all without any
        #[arg(value_name = "NAME")]
        names: Vec<String>,
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
    /// Show how motor, encoder and gear are said to be wired, and whether that was confirmed: before, the joint does not arm
    Commission {
        /// Confirm it: on this joint, at low current, it was seen to be so
        #[arg(long)]
        confirm: bool,
    },
    /// Restart the driver
    Reset,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> Result<ExitCode, String> {
    let node = compensator_core::can::Node::new(arguments.bus.node_id)
        .ok_or_else(|| "--node-id: expected 1 to 127".to_owned())?;
    let bus = BusArguments { bus: arguments.bus.bus.clone(), node_id: node, record: None };
    let hub = Hub::new();
    if bus.bus == BusName::Loop {
        hub.attach(JointNode::start(node, None).map_err(|error| error.to_string())?);
    }
    let mut driver = Driver { client: Client::new(bus.open(&hub)?, node) };
    let done = |outcome: Result<(), String>| outcome.map(|()| ExitCode::SUCCESS);
    match &arguments.action {
        Action::Get { names } => done(driver.get(names, arguments.json)),
        Action::Set { what, save } => done(driver.set(what, *save)),
        Action::Diff { file } => driver.diff(file, arguments.json),
        Action::Save => done(driver.store(index::STORE, SAVE)),
        Action::Restore => done(driver.store(index::RESTORE, LOAD)),
        Action::Status => done(driver.status(arguments.json)),
        Action::Arm => done(driver.request(1)),
        Action::Disarm => done(driver.request(0)),
        Action::Clear => done(driver.request(2)),
        Action::Home { position_rad } => {
            let at = Address::new(index::STATE, 6);
            done(driver.client.write(at, &position_rad.to_le_bytes()).map_err(words))
        }
        Action::Commission { confirm } => done(driver.commission(*confirm, arguments.json)),
        Action::Reset => {
            let sent = driver.client.command(NmtCommand::ResetNode);
            done(sent.map_err(|error| error.to_string()))
        }
    }
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
        let at = Address::new;
        // Refused while armed, and then there is nothing staged either.
        match self.client.write(at(index::COMMIT, 4), &[1]) {
            Ok(()) | Err(SdoError::Refused { code: 0x0800_0022, .. }) => {}
            Err(error) => return Err(words(error)),
        }
        let friction = self.client.read(at(index::COMMIT, 5)).map_err(words)?;
        let friction = record::parse(&friction).map_err(|e| format!("the driver's record: {e}"))?;
        let drive = self.client.read(at(index::COMMIT, 6)).map_err(words)?;
        let drive: &[u8; DRIVE_LENGTH] = drive.as_slice().try_into().map_err(|_| {
            let found = drive.len();
            format!("the driver is of another version: {found} bytes of motor and thresholds, expected {DRIVE_LENGTH}")
        })?;
        Ok(ParameterSet::with_drive(friction, drive))
    }

    fn get(&mut self, names: &[String], json: bool) -> Result<(), String> {
        let set = self.read_set()?;
        if names.is_empty() && !json {
            return say(&driver_file::emit(&set, JointKind::Revolute));
        }
        let all = numbers(&set);
        let chosen: Vec<&(String, f32)> = if names.is_empty() {
            all.iter().collect()
        } else {
            let found = names.iter().map(|name| {
                all.iter().find(|(known, _)| known == name).ok_or_else(|| unknown(name, &all))
            });
            found.collect::<Result<_, _>>()?
        };
        let mut text = String::new();
        if json {
            let object: serde_json::Map<_, _> =
                chosen.iter().map(|(name, value)| (name.clone(), json!(value))).collect();
            text = serde_json::to_string_pretty(&object).map_err(|e| e.to_string())? + "\n";
        } else {
            for (name, value) in chosen {
                text += &format!("{name} = {value:?}\n");
            }
        }
        say(&text)
    }

    fn set(&mut self, what: &[String], save: bool) -> Result<(), String> {
        let mut set = self.read_set()?;
        for item in what {
            match item.split_once('=') {
                Some((name, value)) => put(&mut set, name.trim(), value.trim())?,
                None => {
                    let file =
                        driver_file::read(Path::new(item)).map_err(|error| error.to_string())?;
                    driver_file::apply(&file, &mut set);
                }
            }
        }
        // Said here already what the driver would say: in the file's words, and before it is touched.
        set.validate().map_err(|error| error.to_string())?;
        let at = Address::new;
        let commit = |client: &mut Client<Box<dyn Bus>>| {
            client.write(at(index::COMMIT, 5), &record::emit(&set.friction))?;
            client.write(at(index::COMMIT, 6), &set.emit_drive())?;
            client.write(at(index::COMMIT, 3), &set.crc().to_le_bytes())
        };
        if let Err(error) = commit(&mut self.client) {
            // Nothing of it may be left for somebody else's commit.
            let _ = self.client.write(at(index::COMMIT, 4), &[1]);
            return Err(words(error));
        }
        let active = self.number(index::COMMIT, 1)?;
        if active != set.crc() {
            return Err(format!("the driver runs on {active:08x}, meant was {:08x}", set.crc()));
        }
        if save { self.store(index::STORE, SAVE) } else { Ok(()) }
    }

    fn diff(&mut self, path: &Path, json: bool) -> Result<ExitCode, String> {
        let has = self.read_set()?;
        let file = driver_file::read(path).map_err(|error| error.to_string())?;
        let mut wants = has.clone();
        driver_file::apply(&file, &mut wants);
        let mut lines: Vec<(String, String, String)> = Vec::new();
        let (model, meant) = (&has.friction.model, &wants.friction.model);
        let name = |model: &compensator_core::Parameters<f32>| {
            let terms = model.terms.iter().map(|term| term.name());
            terms.fold(model.law.name().to_owned(), |name, term| name + "+" + term)
        };
        if name(model) != name(meant) {
            lines.push(("model".to_owned(), name(model), name(meant)));
        }
        if model.choices != meant.choices {
            let word = |choices| format!("{choices:?}");
            lines.push(("choices".to_owned(), word(model.choices), word(meant.choices)));
        }
        // Only what one of the two models uses makes a difference.
        let used: Vec<&str> = model.active().chain(meant.active()).map(ParameterId::name).collect();
        for ((name, has), (_, wants)) in numbers(&has).into_iter().zip(numbers(&wants)) {
            let counts = name.contains('.') || used.contains(&name.as_str());
            if counts && has.to_bits() != wants.to_bits() {
                lines.push((name, format!("{has:?}"), format!("{wants:?}")));
            }
        }
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

    fn request(&mut self, request: u8) -> Result<(), String> {
        self.client.write(Address::new(index::STATE, 1), &[request]).map_err(words)
    }

    /// The wiring in use, by name, and whether somebody confirmed it; confirms it where that is asked.
    fn commission(&mut self, confirm: bool, json: bool) -> Result<(), String> {
        let set = self.read_set()?;
        let wiring = self.number(index::COMMISSIONING, Commissioning::WIRING_CRC)?;
        if wiring != set.wiring_crc() {
            let meant = set.wiring_crc();
            return Err(format!(
                "the driver's wiring has the crc {wiring:08x}, its numbers {meant:08x}: is it of another version?"
            ));
        }
        if confirm {
            let at = Address::new(index::COMMISSIONING, Commissioning::CONFIRM);
            self.client.write(at, &wiring.to_le_bytes()).map_err(words)?;
        }
        let commissioned = self.number(index::COMMISSIONING, 1)? != 0;
        let wired: Vec<(String, f32)> = numbers(&set)
            .into_iter()
            .filter(|(name, _)| {
                name.strip_prefix("motor.")
                    .is_some_and(|field| ParameterSet::WIRING.contains(&field))
            })
            .collect();
        if json {
            let wired: serde_json::Map<_, _> =
                wired.into_iter().map(|(name, value)| (name, json!(value))).collect();
            let result = json!({"commissioned": commissioned, "wiring_crc": format!("{wiring:08x}"), "wiring": wired});
            let text = serde_json::to_string_pretty(&result).map_err(|e| e.to_string())?;
            return say(&(text + "\n"));
        }
        let mut out = String::new();
        for (name, value) in wired {
            out += &format!("{name:<32} {value:?}\n");
        }
        out += if commissioned {
            "commissioned: the joint may be armed; `params save` keeps that over a reset\n"
        } else {
            "NOT commissioned: the joint does not arm. Find each number above at low current (docs/bring-up.md), set it,\n\
             then `params commission --confirm`\n"
        };
        say(&out)
    }

    fn status(&mut self, json: bool) -> Result<(), String> {
        let text = |client: &mut Client<Box<dyn Bus>>, at_index| {
            client.read_text(Address::new(at_index, 0)).map_err(words)
        };
        let name = text(&mut self.client, index::DEVICE_NAME)?;
        let hardware = text(&mut self.client, index::HARDWARE_VERSION)?;
        let software = text(&mut self.client, index::SOFTWARE_VERSION)?;
        let state = match self.number(index::STATE, 2)? {
            0 => "safe",
            1 => "armed",
            2 => "fault",
            _ => "unknown",
        };
        let faults = codes(self.number(index::STATE, 3)?, 1);
        let limits = codes(self.number(index::STATE, 4)?, 33);
        let source = if self.number(index::OPERATION, 1)? == 0 { "sensors" } else { "bus" };
        let number = if self.number(index::OPERATION, 2)? == 0 { "f32" } else { "fixed" };
        let crc = self.number(index::COMMIT, 1)?;
        let commissioned = self.number(index::COMMISSIONING, 1)? != 0;
        let in_band = match self.number(index::WATCH, 1)? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        };
        let out_of_band = self.number(index::WATCH, 3)?;
        let panic = text(&mut self.client, index::LAST_PANIC)?;
        let refusal = text(&mut self.client, index::REFUSAL)?;
        let mut counters = Vec::new();
        for (place, counter) in FRAME_COUNTERS.iter().enumerate() {
            let value = self.number(index::FRAME_COUNTERS, place as u8 + 1)?;
            counters.push((*counter, value));
        }
        if json {
            let counters: serde_json::Map<_, _> =
                counters.iter().map(|(name, value)| ((*name).to_owned(), json!(value))).collect();
            let status = json!({
                "name": name, "hardware": hardware, "software": software, "state": state,
                "faults": faults, "limits": limits, "source": source, "number": number,
                "parameters_crc": format!("{crc:08x}"), "commissioned": commissioned, "model_in_band": in_band,
                "windows_out_of_band": out_of_band, "last_panic": panic,
                "last_refusal": refusal, "counters": counters,
            });
            let text = serde_json::to_string_pretty(&status).map_err(|e| e.to_string())?;
            return say(&(text + "\n"));
        }
        let list = |codes: &[&str]| {
            if codes.is_empty() { "none".to_owned() } else { codes.join(", ") }
        };
        let mut out = format!(
            "{name}, {hardware}, {software}\nstate       {state}\nfaults      {}\nlimits      {}\n\
             fed by      {source}, computes in {number}\nparameters  crc {crc:08x}, {}\n\
             model       {}, {out_of_band} windows out of band\n",
            list(&faults),
            list(&limits),
            if commissioned {
                "commissioned"
            } else {
                "NOT commissioned: does not arm on its sensors"
            },
            match in_band {
                None => "nothing to judge yet",
                Some(true) => "in band",
                Some(false) => "OUT OF BAND",
            },
        );
        for (label, value) in [("last panic  ", panic), ("last refusal", refusal)] {
            if !value.is_empty() {
                out += &format!("{label} {value}\n");
            }
        }
        for (name, value) in counters.iter().filter(|(_, value)| *value > 0) {
            out += &format!("{name:<20} {value}\n");
        }
        say(&out)
    }
}

/// Codes of a set of bits, by name; bit 0 is number `first`.
fn codes(bits: u32, first: u8) -> Vec<&'static str> {
    let set = (0..32u8).filter(|bit| bits >> bit & 1 != 0);
    set.filter_map(|bit| Code::from_number(first + bit)).map(|code| code.info().name).collect()
}

/// Every number of a set, by name.
fn numbers(set: &ParameterSet) -> Vec<(String, f32)> {
    let model = &set.friction.model;
    let own = ParameterId::ALL.iter().map(|id| (id.name().to_owned(), model.get(*id)));
    let mut all: Vec<(String, f32)> = own.collect();
    let mut section = |name: &str, names: &[&str], values: &[f32]| {
        all.extend(
            names.iter().zip(values).map(|(field, value)| (format!("{name}.{field}"), *value)),
        );
    };
    section("envelope", &Envelope::NAMES, &model.envelope.to_array());
    let compensator = set.friction.compensator.to_array();
    section("compensator", &CompensatorParameters::NAMES, &compensator);
    section("motor", &MotorParameters::NAMES, &set.motor.to_array());
    section("thresholds", &Thresholds::NAMES, &set.thresholds.to_array());
    section("watch", &WatchParameters::NAMES, &set.watch.to_array());
    all
}

fn unknown(name: &str, all: &[(String, f32)]) -> String {
    // The nearest names: those that share the most with what was asked for.
    let last = name.rsplit('.').next().unwrap_or(name);
    let near: Vec<&str> = all
        .iter()
        .map(|(known, _)| known.as_str())
        .filter(|known| known.contains(last) || last.contains(*known))
        .take(5)
        .collect();
    if near.is_empty() {
        format!("{name}: no such parameter; `params get` lists them")
    } else {
        format!("{name}: no such parameter; is it {}?", near.join(" or "))
    }
}

/// Sets one number of a set, or its model, from text.
fn put(set: &mut ParameterSet, name: &str, value: &str) -> Result<(), String> {
    if name == "model" {
        let spec =
            friction_identification::spec::Spec::parse(value).map_err(|error| error.to_string())?;
        let mut model = spec.parameters().map_err(|error| error.to_string())?.convert::<f32>();
        for id in ParameterId::ALL {
            model.set(*id, set.friction.model.get(*id));
        }
        model.envelope = set.friction.model.envelope;
        model.choices = set.friction.model.choices;
        set.friction.model = model;
        return Ok(());
    }
    let all = numbers(set);
    if !all.iter().any(|(known, _)| known == name) {
        return Err(unknown(name, &all));
    }
    let number: f32 =
        value.parse().map_err(|_| format!("{name}: found {value:?}, expected a number"))?;
    fn change<const N: usize>(fields: [f32; N], names: &[&str], field: &str, to: f32) -> [f32; N] {
        let mut fields = fields;
        for (place, name) in fields.iter_mut().zip(names) {
            if *name == field {
                *place = to;
            }
        }
        fields
    }
    match name.split_once('.') {
        None => {
            if let Some(id) = ParameterId::parse(name) {
                set.friction.model.set(id, number);
            }
        }
        Some(("envelope", field)) => {
            let fields = set.friction.model.envelope.to_array();
            let fields = change(fields, &Envelope::NAMES, field, number);
            set.friction.model.envelope = Envelope::from_array(fields);
        }
        Some(("compensator", field)) => {
            let fields = set.friction.compensator.to_array();
            let fields = change(fields, &CompensatorParameters::NAMES, field, number);
            set.friction.compensator = CompensatorParameters::from_array(fields);
        }
        Some(("motor", field)) => {
            let fields = change(set.motor.to_array(), &MotorParameters::NAMES, field, number);
            set.motor = MotorParameters::from_array(fields);
        }
        Some(("thresholds", field)) => {
            let fields = change(set.thresholds.to_array(), &Thresholds::NAMES, field, number);
            set.thresholds = Thresholds::from_array(fields);
        }
        Some((_, field)) => {
            let fields = change(set.watch.to_array(), &WatchParameters::NAMES, field, number);
            set.watch = WatchParameters::from_array(fields);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_that_is_printed_can_be_set() {
        let mut set = ParameterSet::default();
        for (name, value) in numbers(&set) {
            put(&mut set, &name, &format!("{}", value + 0.5)).unwrap();
        }
        let changed = numbers(&set);
        for ((name, before), (_, after)) in numbers(&ParameterSet::default()).iter().zip(&changed) {
            // Times in us and counts are whole numbers.
            assert!((after - before).abs() > 0.0 || name.starts_with("thresholds."), "{name}");
        }
        assert!(put(&mut set, "static_tork", "1").is_err());
        let error = put(&mut set, "scale", "1").unwrap_err();
        assert!(error.contains("compensator.scale"), "{error}");
        assert!(put(&mut set, "compensator.scale", "much").is_err());
    }
}
