//! Settings that messages refer to, which each front end names in its own way.
//!
//! A message of this crate contains a reference to a setting as data: the command line writes `--columns a=b`, Python
//! writes `columns={"a": "b"}`. [`Display`](fmt::Display) of an error names the setting alone: `columns a=b`.

use std::fmt;

named! {
    /// A setting of a front end.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Setting {
        /// Names and units of the columns, `ours=theirs:unit`, separated by commas.
        Columns = "columns",
        /// Selection of rows, `column=value`.
        Where = "where",
        /// Samples dropped at the start of each run.
        Skip = "skip",
        /// Join of files that hold one channel each.
        Join = "join",
        /// Rate of the rows, Hz.
        Rate = "rate",
        /// The torque of 100 %.
        RatedTorque = "rated torque",
        /// The torque of one ampere.
        TorqueConstant = "torque constant",
        /// The control law from which a torque is computed.
        TorqueFrom = "torque from",
        /// Maximum share of bad rows.
        BadRows = "bad rows",
        /// The model's name.
        Model = "model",
        /// Rigid-body parts of the torque column.
        RigidBody = "rigid body",
        /// Parts of a model that are compensated besides friction.
        With = "with",
        /// Settings of a compensator.
        Compensator = "compensator",
        /// The tool that wrote the log.
        Preset = "preset",
        /// Kinds of findings that are left as logged.
        AsLogged = "as logged",
        /// Lines of text above the header.
        SkipLines = "skip lines",
        /// Form of an exported model.
        ExportFormat = "format",
        /// A cargo feature of the front end, which it enables under the same name.
        Feature = "feature",
    }
}

/// A reference to a setting in a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reference<'a> {
    /// The setting.
    pub setting: Setting,
    /// Its value; empty if the message refers to the setting as such.
    pub value: &'a str,
    /// True if the user can take the value over. Otherwise it is what the user gave.
    pub is_suggestion: bool,
}

// Control characters: text from files cannot contain them, because messages escape them.
const BEGIN_GIVEN: char = '\u{1}';
const BEGIN_SUGGESTED: char = '\u{2}';
const VALUE: char = '\u{3}';
const END: char = '\u{4}';

impl Setting {
    /// Returns a reference to the setting as such, for a message.
    pub fn alone(self) -> String {
        self.given("")
    }

    /// Returns a reference to the setting with the value that the user gave, for a message.
    pub fn given(self, value: impl fmt::Display) -> String {
        format!("{BEGIN_GIVEN}{}{VALUE}{value}{END}", self.name())
    }

    /// Returns a reference to the setting with a value that the user can take over, for a message.
    pub fn suggested(self, value: impl fmt::Display) -> String {
        format!("{BEGIN_SUGGESTED}{}{VALUE}{value}{END}", self.name())
    }
}

/// A message that may refer to settings.
pub trait Message {
    /// Returns the message with its references.
    fn marked(&self) -> String;

    /// Returns the message with each reference as the front end names it.
    fn worded(&self, word: &dyn Fn(Reference) -> String) -> String {
        worded(&self.marked(), word)
    }
}

/// Replaces the references of a text.
pub fn worded(text: &str, word: &dyn Fn(Reference) -> String) -> String {
    let mut message = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(begin) = rest.find([BEGIN_GIVEN, BEGIN_SUGGESTED]) {
        message.push_str(&rest[..begin]);
        let is_suggestion = rest[begin..].starts_with(BEGIN_SUGGESTED);
        rest = &rest[begin + 1..];
        let end = rest.find(END).unwrap_or(rest.len());
        if let Some((name, value)) = rest[..end].split_once(VALUE)
            && let Some(setting) = Setting::parse(name)
        {
            message.push_str(&word(Reference { setting, value, is_suggestion }));
        }
        rest = rest.get(end + 1..).unwrap_or_default();
    }
    message + rest
}

/// Returns a text as a shell takes it as one word. It is quoted only where necessary.
pub fn shell_word(text: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "_-+=:,./%@[]".contains(c);
    if text.chars().all(is_plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

/// Replaces the references of a text by the settings' own names.
pub fn plain(text: &str) -> String {
    worded(text, &|reference| match reference.value {
        "" => reference.setting.name().to_owned(),
        value => format!("{} {value}", reference.setting.name()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worded_replaces_each_reference() {
        let text = format!(
            "{}/b/{}/{}",
            Setting::Skip.given(3),
            Setting::Columns.suggested("a=b"),
            Setting::Columns.alone()
        );
        assert_eq!(plain(&text), "skip 3/b/columns a=b/columns");
        let word = |found: Reference| {
            format!("<{:?} {} {}>", found.setting, found.value, found.is_suggestion)
        };
        let expected = "<Skip 3 false>/b/<Columns a=b true>/<Columns  false>";
        assert_eq!(worded(&text, &word), expected);
    }

    #[test]
    fn worded_with_text_without_references_returns_it() {
        assert_eq!(plain("no setting, \u{e9}"), "no setting, \u{e9}");
        assert_eq!(plain("cut off \u{1}skip"), "cut off ");
    }
}
