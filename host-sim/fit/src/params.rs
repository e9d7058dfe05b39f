//! `params.toml`: the parameters of a model in a readable file.
//!
//! ```toml
//! schema = 1
//! joint = "revolute"
//! model = "lugre+pressure-coulomb"
//!
//! [parameters]
//! coulomb_torque = { value = 1.5, unit = "Nm", std_error = 0.01, state = "determined" }
//! static_torque = 2.2                     # a bare number is in the parameter's own SI unit
//!
//! [envelope]                              # limits of the model's inputs; optional
//! velocity_max_rad_s = 10.5
//! [choices]                               # optional
//! damping_fades = true
//! [rigid_body]                            # parts of the drive torque that are not friction, see [`crate::spec`]
//! inertia = { value = 0.02, unit = "kg m^2" }
//! [compensator]                           # optional, see [`CompensatorSection`]
//! scale = 0.9
//! [fit]                                   # optional, as [log_means]: see [`FitRecord`]
//! substeps = 1
//! [network]                               # optional: supplies levels and stiffness
//! file = "network.json"                   # in the same directory
//! crc32 = "9ae0daaf"                      # of its bytes: another network is an error
//! [measurement]                           # optional: between shaft and log, see [`Measurement`]
//! torque_delay_s = 0.004
//! [driver_measurement]                    # optional: the same for the driver's law, where it differs
//! torque_delay_s = 0
//! [[linear.term]]                         # optional: what a PC computes in place of the law, see [`LinearModel`]
//! part = "viscous"
//! size = 0.2
//! factors = [{ kind = "velocity" }]
//! ```
//!
//! `identify` writes the file, and the core uses it unchanged. The caller defines further sections ([`Section`]), for
//! example a joint driver's motor. Unknown keys, wrong units and values out of range are errors, each in one line that
//! names the key.

mod compensator;
mod fit_record;

pub use crate::parameter_file_error::{NetworkRefusal, ParameterFileError, ParameterFileErrorKind};
pub use compensator::CompensatorSection;

pub use fit_record::FitRecord;

use crate::linear::LinearModel;
use crate::measurement::Measurement;
use crate::parameter_file_error::number;
use crate::spec::{Spec, rigid_body_name};
use crate::{DriverForm, Estimate, Outcome};
use ParameterFileErrorKind as Kind;
use compensator_core::parameters::{Choices, Envelope};
use compensator_core::{LawKind, ParameterId, Parameters, TermKind};
use joint_log::Dataset;
use joint_log::JointKind;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use toml_edit::{Document, Item, TableLike};

/// A parameter file, read and validated.
#[derive(Clone, Debug)]
pub struct ParameterFile {
    /// The joint kind, which determines the units of the values.
    pub joint: JointKind,
    /// The model, with the rigid-body parts as terms.
    pub spec: Spec,
    /// Its parameters.
    pub parameters: Parameters<f64>,
    /// The settings of the compensator that the file has.
    pub compensator: CompensatorSection,
    /// How the model was fitted.
    pub fit: FitRecord,
    /// The file of the network that supplies levels and stiffness, if there is one.
    pub network: Option<NetworkText>,
    /// What lies between the shaft and a log of the same rig.
    pub measurement: Measurement,
    /// The same for the driver's law, where it was fitted beside another one than the linear model.
    pub driver_measurement: Option<Measurement>,
    /// The model that a PC computes in place of the driver's, if it errs less.
    pub linear: Option<LinearModel>,
    /// The values of each requested [`Section`], in order; NaN for a missing value.
    pub sections: Vec<Vec<f32>>,
}

/// The file of a network, as its parameter file names it. The package `friction-network` parses the text.
#[derive(Clone, Debug)]
pub struct NetworkText {
    /// Path of the file.
    pub path: PathBuf,
    /// Its content, with the checksum that the parameter file states.
    pub text: String,
}

/// Returns the CRC-32 (ISO-HDLC) of a file's bytes as eight hexadecimal digits.
pub fn checksum(bytes: &[u8]) -> String {
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
    format!("{:08x}", crc.checksum(bytes))
}

/// A further section of a file: named numbers.
#[derive(Clone, Copy, Debug)]
pub struct Section {
    /// Its name, as `motor`.
    pub name: &'static str,
    /// The names of its fields.
    pub fields: &'static [&'static str],
}

impl ParameterFile {
    /// Returns what lies between the shaft and the log for the driver's law.
    pub fn measurement_of_driver(&self) -> &Measurement {
        self.driver_measurement.as_ref().unwrap_or(&self.measurement)
    }
}

/// Returns the unit of a parameter for a joint kind.
pub fn unit(id: ParameterId, joint: JointKind) -> &'static str {
    match joint {
        JointKind::Revolute => id.unit(),
        JointKind::Prismatic => id.unit_prismatic(),
    }
}

/// Returns the unit for a report; empty for a dimensionless parameter.
pub fn unit_in_words(unit: &str) -> &str {
    if unit == "1" { "" } else { unit }
}

/// Formats the parameter file of a fit to `data`. `auxiliary` is the covariate that the model follows, if any.
pub fn emit(outcome: &Outcome, data: &Dataset, auxiliary: Option<&str>) -> String {
    let (form, joint) = (outcome.for_driver(), data.joint);
    let DriverForm { parameters, estimates, train, .. } = form;
    let mut text = head(joint, &outcome.spec.full_name());
    let line = |estimate: &Estimate| {
        let (name, value) = (estimate.id.name(), estimate.value);
        let unit = unit(estimate.id, joint);
        let error = estimate.std_error.map_or(String::new(), |error| {
            format!(", std_error = {error:?}, state = \"{}\"", estimate.state.name())
        });
        format!("{name} = {{ value = {value:?}, unit = \"{unit}\"{error} }}\n")
    };
    let lines = estimates.iter().map(|estimate| (estimate.id, line(estimate)));
    emit_parameters(&parameters.terms, lines, &mut text);
    if let Some(constant) = data.torque_constant {
        emit_section("compensator", &["torque_constant_nm_per_a"], &[constant as f32], &mut text);
    }
    emit_limits(&parameters.envelope, parameters.choices, &mut text);
    FitRecord::new(outcome.resolution, train.rmse, data, auxiliary).emit(joint, &mut text);
    text
}

/// Formats the parameter file of a driver's model. Parsing it returns the same model bit for bit.
pub fn emit_model(model: &Parameters<f32>, joint: JointKind) -> String {
    let mut text = head(joint, &Spec::of(model).full_name());
    let line = |id: ParameterId| {
        let (name, value, unit) = (id.name(), model.get(id), unit(id, joint));
        (id, format!("{name} = {{ value = {value:?}, unit = \"{unit}\" }}\n"))
    };
    emit_parameters(&model.terms, model.active().map(line), &mut text);
    emit_limits(&model.envelope, model.choices, &mut text);
    text
}

fn head(joint: JointKind, model: &str) -> String {
    let kind = match joint {
        JointKind::Revolute => "revolute",
        JointKind::Prismatic => "prismatic",
    };
    format!("schema = 1\njoint = \"{kind}\"\nmodel = \"{model}\"\n\n[parameters]\n")
}

/// Returns true if a parameter belongs to a part of the drive torque that is not friction.
fn is_rigid_body(id: ParameterId, terms: &[TermKind]) -> bool {
    let mut parts = terms.iter().filter(|term| rigid_body_name(**term).is_some());
    parts.any(|term| term.parameters().contains(&id))
}

/// Appends the lines of the parameters: those of the friction, and in a section of its own the others.
fn emit_parameters(
    terms: &[TermKind],
    lines: impl Iterator<Item = (ParameterId, String)>,
    text: &mut String,
) {
    let (others, friction): (Vec<_>, Vec<_>) = lines.partition(|(id, _)| is_rigid_body(*id, terms));
    text.extend(friction.into_iter().map(|(_, line)| line));
    if !others.is_empty() {
        text.push_str("\n[rigid_body]\n");
        text.extend(others.into_iter().map(|(_, line)| line));
    }
}

/// Appends a section of numbers to a file.
pub fn emit_section(name: &str, names: &[&str], values: &[f32], text: &mut String) {
    let _ = writeln!(text, "\n[{name}]");
    for (name, value) in names.iter().zip(values) {
        let _ = writeln!(text, "{name} = {value:?}");
    }
}

fn emit_limits(envelope: &Envelope, choices: Choices, text: &mut String) {
    emit_section("envelope", &Envelope::NAMES, &envelope.to_array(), text);
    let Choices { damping_fades, printed_extended, allow_active } = choices;
    let _ = write!(
        text,
        "\n[choices]\ndamping_fades = {damping_fades}\nprinted_extended = {printed_extended}\n\
         allow_active = {allow_active}\n"
    );
}

/// Reads and validates a parameter file, which may have these sections in addition to those of a model.
///
/// # Errors
/// One line: the file, the key, what was found and what was expected; or the validation error of the core.
pub fn read(path: &Path, sections: &[Section]) -> Result<ParameterFile, ParameterFileError> {
    let refuse = |kind| ParameterFileError { file: Some(path.to_owned()), kind };
    let text = std::fs::read_to_string(path).map_err(|error| refuse(Kind::Io(error)))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    understand(&text, sections, Some(folder)).map_err(refuse)
}

/// Parses and validates the text of a parameter file. A file that names a network needs a directory: see [`read`].
///
/// # Errors
/// As [`read`], without the file's name.
pub fn parse(text: &str, sections: &[Section]) -> Result<ParameterFile, ParameterFileError> {
    Ok(understand(text, sections, None)?)
}

/// Reads the network that a file names, from the directory of the file.
fn network(
    root: &toml_edit::Table,
    spec: &Spec,
    folder: Option<&Path>,
) -> Result<Option<NetworkText>, Kind> {
    let Some(item) = root.get("network") else { return Ok(None) };
    let table = item.as_table_like().ok_or_else(|| Kind::value("network", "a table"))?;
    if let Some((key, _)) = table.iter().find(|(key, _)| !["file", "crc32"].contains(key)) {
        return Err(Kind::unknown(format!("network.{key}"), "file, crc32"));
    }
    let text = |key: &str| {
        let found = table.get(key).and_then(Item::as_str);
        found.ok_or_else(|| Kind::NoText { key: format!("network.{key}") })
    };
    let (file, expected) = (text("file")?, text("crc32")?);
    let folder = folder.ok_or(Kind::Network(NetworkRefusal::NoFolder))?;
    if Path::new(file).is_absolute() {
        return Err(Kind::found("network.file", format!("{file:?}"), "a path beside this file"));
    }
    let path = folder.join(file);
    let refuse = |refusal| Err(Kind::Network(refusal));
    let bytes = match std::fs::read(&path) {
        Ok(bytes) => bytes,
        Err(error) => return refuse(NetworkRefusal::Io { path, error }),
    };
    let found = checksum(&bytes);
    if !found.eq_ignore_ascii_case(expected) {
        let expected = expected.to_owned();
        return refuse(NetworkRefusal::Checksum { path, found, expected });
    }
    if spec.law != LawKind::LugreAsymmetric || !spec.terms.is_empty() {
        return refuse(NetworkRefusal::OtherModel { model: spec.to_string() });
    }
    let text = String::from_utf8_lossy(&bytes).into_owned();
    Ok(Some(NetworkText { path, text }))
}

/// Appends a section that names the network file, given its text.
pub fn emit_network(file: &str, content: &str, text: &mut String) {
    let crc32 = checksum(content.as_bytes());
    let _ = write!(text, "\n[network]\nfile = {file:?}\ncrc32 = \"{crc32}\"\n");
}

/// Sections and keys of a file without those of its caller.
const KNOWN: [&str; 14] = [
    "schema",
    "joint",
    "model",
    "parameters",
    "rigid_body",
    "envelope",
    "choices",
    "compensator",
    "fit",
    "log_means",
    "network",
    Measurement::OF_FILE,
    Measurement::OF_DRIVER,
    "linear",
];

fn understand(
    text: &str,
    sections: &[Section],
    folder: Option<&Path>,
) -> Result<ParameterFile, Kind> {
    let document = Document::parse(text).map_err(Kind::Syntax)?;
    let root = document.as_table();
    let known: Vec<&str> = KNOWN.into_iter().chain(sections.iter().map(|more| more.name)).collect();
    if let Some((key, _)) = root.iter().find(|(key, _)| !known.contains(key)) {
        return Err(Kind::UnknownSection { key: key.to_owned(), expected: known });
    }
    let joint = joint(root)?;
    let spec = Spec::parse(&string(root, "model")?)?;
    let mut parameters = spec.parameters()?;
    set_parameters(root, joint, &spec, &mut parameters)?;
    let mut envelope = parameters.envelope.to_array();
    fields(root, "envelope", &Envelope::NAMES, &mut envelope)?;
    parameters.envelope = Envelope::from_array(envelope);
    set_choices(root, &mut parameters.choices)?;
    let compensator = CompensatorSection::parse(root)?;
    parameters.validate()?;
    let further = |section: &Section| {
        let mut values = vec![f32::NAN; section.fields.len()];
        fields(root, section.name, section.fields, &mut values).map(|()| values)
    };
    Ok(ParameterFile {
        joint,
        parameters,
        compensator,
        sections: sections.iter().map(further).collect::<Result<_, _>>()?,
        fit: FitRecord::parse(root, joint)?,
        network: network(root, &spec, folder)?,
        measurement: Measurement::parse(root, Measurement::OF_FILE)?.unwrap_or_default(),
        driver_measurement: Measurement::parse(root, Measurement::OF_DRIVER)?,
        linear: LinearModel::parse(text)?,
        spec,
    })
}

/// Returns the kind of the joint, if the file has the schema of this program.
fn joint(root: &toml_edit::Table) -> Result<JointKind, Kind> {
    let schema = root.get("schema").ok_or_else(|| Kind::value("schema", "1"))?;
    if schema.as_integer() != Some(1) {
        return Err(Kind::found("schema", schema.to_string().trim(), "1"));
    }
    match string(root, "joint")?.as_str() {
        "revolute" => Ok(JointKind::Revolute),
        "prismatic" => Ok(JointKind::Prismatic),
        other => Err(Kind::found("joint", format!("{other:?}"), "revolute or prismatic")),
    }
}

/// Sets the parameters of the model to those of the file.
fn set_parameters(
    root: &toml_edit::Table,
    joint: JointKind,
    spec: &Spec,
    parameters: &mut Parameters<f64>,
) -> Result<(), Kind> {
    let active: Vec<ParameterId> = parameters.active().collect();
    // The first form of the file had all of them in one section.
    let others: Vec<ParameterId> =
        active.iter().copied().filter(|id| is_rigid_body(*id, &parameters.terms)).collect();
    for (name, known) in [("parameters", &active), ("rigid_body", &others)] {
        for (key, item) in section(root, name)? {
            let id = ParameterId::parse(key).filter(|id| known.contains(id)).ok_or_else(|| {
                let known: Vec<_> = known.iter().map(|id| id.name()).collect();
                Kind::NoParameter {
                    key: format!("{name}.{key}"),
                    model: spec.to_string(),
                    expected: known.join(", "),
                }
            })?;
            parameters.set(id, value(&format!("{name}.{key}"), item, unit(id, joint))?);
        }
    }
    Ok(())
}

fn set_choices(root: &toml_edit::Table, choices: &mut Choices) -> Result<(), Kind> {
    for (key, item) in section(root, "choices")? {
        let choice = match key {
            "damping_fades" => &mut choices.damping_fades,
            "printed_extended" => &mut choices.printed_extended,
            "allow_active" => &mut choices.allow_active,
            _ => {
                let known = "damping_fades, printed_extended, allow_active";
                return Err(Kind::unknown(format!("choices.{key}"), known));
            }
        };
        *choice =
            item.as_bool().ok_or_else(|| Kind::value(format!("choices.{key}"), "true or false"))?;
    }
    Ok(())
}

fn string(root: &toml_edit::Table, key: &str) -> Result<String, Kind> {
    let text = root.get(key).and_then(Item::as_str);
    text.map(str::to_owned).ok_or_else(|| Kind::NoText { key: key.to_owned() })
}

type Entries<'a> = Vec<(&'a str, &'a Item)>;

fn section<'a>(root: &'a toml_edit::Table, name: &str) -> Result<Entries<'a>, Kind> {
    let Some(item) = root.get(name) else { return Ok(Vec::new()) };
    let table: &dyn TableLike = item.as_table_like().ok_or_else(|| Kind::value(name, "a table"))?;
    Ok(table.iter().collect())
}

/// Keys of a parameter. Standard error and state are information for people.
const VALUE_KEYS: [&str; 4] = ["value", "unit", "std_error", "state"];

/// Returns a bare number, or the value of a table whose unit, if given, is correct.
fn value(key: &str, item: &Item, unit: &str) -> Result<f64, Kind> {
    let expected = || Kind::value(key, format!("a finite number in {unit}"));
    let Some(table) = item.as_table_like() else { return number(item).ok_or_else(expected) };
    if let Some((other, _)) = table.iter().find(|(other, _)| !VALUE_KEYS.contains(other)) {
        return Err(Kind::unknown(format!("{key}.{other}"), VALUE_KEYS.join(", ")));
    }
    if let Some(found) = table.get("unit")
        && found.as_str() != Some(unit)
    {
        let found = found.to_string();
        return Err(Kind::found(key, format!("unit {}", found.trim()), format!("{unit:?}")));
    }
    table.get("value").and_then(number).ok_or_else(expected)
}

fn fields(
    root: &toml_edit::Table,
    name: &str,
    names: &[&str],
    values: &mut [f32],
) -> Result<(), Kind> {
    for (key, item) in section(root, name)? {
        let at = names
            .iter()
            .position(|known| *known == key)
            .ok_or_else(|| Kind::unknown(format!("{name}.{key}"), names.join(", ")))?;
        values[at] = number(item)
            .ok_or_else(|| Kind::value(format!("{name}.{key}"), "a finite number"))?
            as f32;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
