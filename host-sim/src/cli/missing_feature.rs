//! What a cargo feature adds, refused in a build without it.

use super::error::Refusal;
use super::words::feature_with_command;

/// Arguments of a command that this build lacks. All are accepted, so that the refusal is the only error.
#[cfg(not(all(feature = "papers", feature = "update")))]
#[derive(clap::Args)]
pub struct AnyArguments {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    _arguments: Vec<std::ffi::OsString>,
}

/// Returns the error for something that needs a feature: one line that names the feature and the same command with it.
pub fn refusal(what: impl Into<String>, feature: &str) -> Refusal {
    Refusal::Feature { what: what.into(), with_command: feature_with_command(feature) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::words::with_command;
    use std::ffi::OsString;

    #[test]
    fn refusal_names_feature_and_command_in_one_line() {
        let arguments = ["paper", "damper", "--data", "my logs"].map(OsString::from);
        let with_command = with_command("papers", arguments.into_iter());
        let line = Refusal::Feature { what: "paper".into(), with_command }.to_string();
        let command = "-- paper damper --data 'my logs'";
        assert!(line.starts_with("paper: ") && line.ends_with(command), "{line}");
        assert!(line.contains("--features papers "), "{line}");
        crate::snapshot::check("units-of-commands", "a feature that is left out", &line);
    }
}
