//! `export`: writes a fitted model for a user's own control loop, a driver's flash, or a simulator.

use super::output::{OutputArguments, print_text};
use crate::driver_file;
use friction_results::export::{ExportFormat, export};
use serde_json::json;
use std::path::PathBuf;

/// Arguments of `export`.
#[derive(clap::Args)]
pub struct ExportArguments {
    /// Model file, as written by `identify`, `compare` and `diagnose`
    #[arg(value_name = "PARAMS.TOML")]
    params: PathBuf,
    /// Output format
    #[arg(long, value_enum)]
    to: ExportFormat,
    #[command(flatten)]
    output: OutputArguments,
}

/// Runs the command.
pub fn run(arguments: &ExportArguments) -> Result<(), String> {
    let file = driver_file::read(&arguments.params).map_err(|error| error.to_string())?;
    let name = arguments.params.file_name().unwrap_or_default().to_string_lossy();
    let with_path = |error| format!("{}: {error}", arguments.params.display());
    let exported = export(&file, arguments.to, &name).map_err(with_path)?;
    let name = arguments.to.file_name();
    arguments.output.write_bytes(&[(name, &exported.content)])?;
    let path = arguments.output.folder().join(name);
    if arguments.output.json {
        let result = json!({
            "schema": 1, "file": path, "model": file.spec.full_name(), "notes": exported.notes,
        });
        let text = serde_json::to_string_pretty(&result).map_err(|error| error.to_string())?;
        return print_text(&(text + "\n"));
    }
    let notes: String = exported.notes.iter().map(|note| format!("- {note}\n")).collect();
    print_text(&format!("{notes}written: {}\n", path.display()))
}
