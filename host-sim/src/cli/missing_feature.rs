//! What a cargo feature adds, refused in a build without it.

use std::ffi::OsString;

/// Arguments of a command that this build lacks. All are accepted, so that the refusal is the only error.
#[cfg(not(all(feature = "papers", feature = "update")))]
#[derive(clap::Args)]
pub struct AnyArguments {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    _arguments: Vec<OsString>,
}

/// Returns the error for something that needs a feature: one line that names the feature and the same command with it.
#[cfg(not(feature = "full"))]
pub fn refusal(what: &str, feature: &str) -> String {
    refusal_of(what, feature, std::env::args_os().skip(1))
}

/// Returns the name of a feature and the command of this process with it, as the end of a sentence.
pub fn feature_with_command(feature: &str) -> String {
    with_command(feature, std::env::args_os().skip(1))
}

/// Returns the refusal of a command with these arguments.
#[cfg(any(test, not(feature = "full")))]
fn refusal_of(what: &str, feature: &str, arguments: impl Iterator<Item = OsString>) -> String {
    format!("{what}: not in this build, which lacks the {}", with_command(feature, arguments))
}

fn with_command(feature: &str, arguments: impl Iterator<Item = OsString>) -> String {
    let quoted = |argument: OsString| {
        let text = argument.to_string_lossy().into_owned();
        let is_plain = |c: char| c.is_alphanumeric() || "-_./:=,+@%".contains(c);
        if text.chars().all(is_plain) { text } else { format!("'{text}'") }
    };
    let arguments: Vec<String> = arguments.map(quoted).collect();
    let arguments = arguments.join(" ");
    format!("feature {feature}: cargo run --release --features {feature} -- {arguments}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusal_names_feature_and_command_in_one_line() {
        let arguments = ["paper", "damper", "--data", "my logs"].map(OsString::from);
        let line = refusal_of("paper", "papers", arguments.into_iter());
        let command = "-- paper damper --data 'my logs'";
        assert!(line.starts_with("paper: ") && line.ends_with(command), "{line}");
        assert!(line.contains("--features papers "), "{line}");
        crate::snapshot::check("units-of-commands", "a feature that is left out", &line);
    }
}
