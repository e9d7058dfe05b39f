//! The names of settings in messages, as options of the command line.

use super::missing_feature::feature_with_command;
use joint_log::setting::{Message, Reference, Setting, shell_word, worded};

/// Returns a message as one line for the user.
pub fn in_options(error: impl Message) -> String {
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
