//! `export`: a fitted model for a loop of one's own, a driver's flash, a simulator.

use super::output::{OutputArguments, say};
use crate::driver_file;
use crate::export::{Form, export};
use serde_json::json;
use std::path::PathBuf;

/// Arguments of `export`.
#[derive(clap::Args)]
pub struct Arguments {
    /// The model, as `identify`, `compare` and `diagnose` write it
    #[arg(value_name = "PARAMS.TOML")]
    params: PathBuf,
    /// What for
    #[arg(long, value_enum)]
    to: Form,
    #[command(flatten)]
    output: OutputArguments,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> Result<(), String> {
    let file = driver_file::read(&arguments.params).map_err(|error| error.to_string())?;
    let name = arguments.params.file_name().unwrap_or_default().to_string_lossy();
    let refused = |why| format!("{}: {why}", arguments.params.display());
    let exported = export(&file, arguments.to, &name).map_err(refused)?;
    let name = arguments.to.file_name();
    arguments.output.write_bytes(&[(name, &exported.content)])?;
    let path = arguments.output.folder().join(name);
    if arguments.output.json {
        let result = json!({
            "schema": 1, "file": path, "model": file.spec.full_name(), "notes": exported.notes,
        });
        let text = serde_json::to_string_pretty(&result).map_err(|error| error.to_string())?;
        return say(&(text + "\n"));
    }
    let notes: String = exported.notes.iter().map(|note| format!("- {note}\n")).collect();
    say(&format!("{notes}written: {}\n", path.display()))
}
