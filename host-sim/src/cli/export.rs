//! `export`: writes a fitted model for a user's own control loop, a driver's flash, or a simulator.

use super::error::{CommandError, Result, in_part};
use super::output::{OutputArguments, pretty};
use super::values::{expected, one_of};
use super::words::text_in_options;
use crate::driver_file;
use clap::builder::TypedValueParser;
use friction_fit::params::{CompensatorSection, ParameterFile};
use friction_results::export::{ExportFormat, export};
use serde_json::json;
use std::error::Error;
use std::path::PathBuf;

/// Arguments of `export`.
#[derive(clap::Args)]
pub struct ExportArguments {
    /// Model file, as written by `identify`, `compare` and `diagnose`
    #[arg(value_name = "PARAMS.TOML")]
    params: PathBuf,
    /// Output format
    #[arg(long, value_parser = formats())]
    to: ExportFormat,
    #[command(flatten)]
    taken: CompensatedArguments,
    /// Settings of the compensator, for `record` and `rust`: torque_constant_nm_per_a, torque_limit_nm, current_limit_a, scale
    ///
    /// They replace those of the file. Separate several by commas.
    #[arg(long, value_name = "NAME=VALUE", value_delimiter = ',', value_parser = setting)]
    compensator: Vec<(String, f32)>,
    #[command(flatten)]
    output: OutputArguments,
}

/// Which parts of a model are compensated besides friction.
#[derive(clap::Args, Default)]
pub struct CompensatedArguments {
    /// Also compensate the gravity of the model, which is wrong as soon as the joint is mounted or tilted otherwise
    #[arg(long, value_name = "PART", value_parser = ["gravity"])]
    with: Option<String>,
}

impl CompensatedArguments {
    /// Adds these parts to what the file asks for.
    pub fn apply(&self, file: &mut ParameterFile) {
        file.compensator.gravity |= self.with.is_some();
    }
}

/// The value of a setting is no number.
#[derive(Debug, thiserror::Error)]
#[error("found {0:?}, expected a number")]
struct NoNumber(String);

/// Parses a setting of the compensator.
fn setting(text: &str) -> Result<(String, f32), Box<dyn Error + Send + Sync>> {
    let (name, value) = text.split_once('=').ok_or_else(|| expected("NAME=VALUE"))?;
    let value = value.trim().parse().map_err(|_| NoNumber(value.to_owned()))?;
    let mut section = CompensatorSection::default();
    section.set(name.trim(), value)?;
    Ok((name.trim().to_owned(), value))
}

/// Returns the parser of a format, which lists all formats in the help.
fn formats() -> impl TypedValueParser<Value = ExportFormat> {
    one_of(ExportFormat::ALL.map(|format| (format.name(), format.description(), format)))
}

/// Runs the command.
pub fn run(arguments: &ExportArguments) -> Result {
    #[cfg(not(feature = "onnx"))]
    if arguments.to == ExportFormat::Onnx {
        return Err(super::missing_feature::refusal("export --to onnx", "onnx").into());
    }
    let mut file = driver_file::read(&arguments.params)?;
    arguments.taken.apply(&mut file);
    for (name, value) in &arguments.compensator {
        file.compensator.set(name, *value)?;
    }
    let name = arguments.params.file_name().unwrap_or_default().to_string_lossy();
    let exported = match (arguments.to, &file.network) {
        #[cfg(not(feature = "network"))]
        (ExportFormat::Network | ExportFormat::Onnx, Some(_)) => Err(super::network::refusal()),
        #[cfg(feature = "network")]
        (ExportFormat::Network, Some(text)) => friction_network::NetworkFile::of(text)
            .and_then(|network| friction_network::export(&network, &name))
            .map_err(CommandError::from),
        #[cfg(feature = "onnx")]
        (ExportFormat::Onnx, _) => friction_onnx::export(&file, &name).map_err(CommandError::from),
        (format, _) => export(&file, format, &name).map_err(CommandError::from),
    };
    let mut exported = exported.map_err(in_part(arguments.params.display()))?;
    exported.notes.iter_mut().for_each(|note| *note = text_in_options(note));
    let name = arguments.to.file_name(&file);
    let further = exported.further_files.iter().map(|(name, content)| (*name, content.as_slice()));
    let files: Vec<(&str, &[u8])> =
        std::iter::once((name, exported.content.as_slice())).chain(further).collect();
    let paths: Vec<PathBuf> =
        files.iter().map(|(name, _)| arguments.output.folder().join(name)).collect();
    let document = json!({
        "schema": 1, "file": paths[0], "files": paths, "model": file.spec.full_name(), "notes": exported.notes,
    });
    let notes: String = exported.notes.iter().map(|note| format!("- {note}\n")).collect();
    arguments.output.finish(&files, &pretty(&document)?, &notes)
}
