//! The names of settings in messages, as options of the command line.

use joint_log::setting::{Message, Reference, Setting, shell_word, worded};
use std::ffi::OsString;

/// Returns a message as one line for the user.
pub fn in_options(error: &impl Message) -> String {
    error.worded(&option)
}

/// Returns a text with the settings in it as options.
pub fn text_in_options(text: &str) -> String {
    worded(text, &option)
}

fn option(reference: Reference) -> String {
    let option = match reference.setting {
        Setting::Columns => "--columns",
        Setting::Where => "--where",
        Setting::Skip => "--skip",
        Setting::RatedTorque => "--rated-torque",
        Setting::TorqueConstant => "--torque-constant",
        Setting::AsLogged => "--as-logged",
        Setting::TorqueFrom => "--torque-from",
        Setting::BadRows => "--bad-rows",
        Setting::Model => "--model",
        Setting::RigidBody => "--rigid-body",
        Setting::With => "--with",
        Setting::Compensator => "--compensator",
        Setting::Preset => "--from",
        Setting::Join => "--join",
        Setting::Rate => "--rate",
        Setting::SkipLines => "--skip-lines",
        Setting::ExportFormat => "--to",
        Setting::Feature => return feature_with_command(reference.value),
    };
    match reference.value {
        "" => option.to_owned(),
        value if reference.is_suggestion => format!("{option} {}", shell_word(value)),
        value => format!("{option} {value}"),
    }
}

/// Returns the name of a feature and the command of this process with it, as the end of a sentence.
pub fn feature_with_command(feature: &str) -> String {
    with_command(feature, std::env::args_os().skip(1))
}

pub fn with_command(feature: &str, arguments: impl Iterator<Item = OsString>) -> String {
    let quoted = |argument: OsString| {
        let text = argument.to_string_lossy().into_owned();
        let is_plain = |c: char| c.is_alphanumeric() || "-_./:=,+@%".contains(c);
        if text.chars().all(is_plain) { text } else { format!("'{text}'") }
    };
    let arguments: Vec<String> = arguments.map(quoted).collect();
    let arguments = arguments.join(" ");
    format!("feature {feature}: cargo run --release --features {feature} -- {arguments}")
}
