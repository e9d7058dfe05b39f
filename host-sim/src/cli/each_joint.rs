//! A command on a log of one joint, or on each joint of a log of several.
//!
//! Of one joint the result is the command's own. Of several each joint has its result in a folder of its own, as if
//! it had been alone, the terminal shows one after the other, and the command's JSON file holds them all in a
//! list `joints`.

use super::input::{DataArguments, Input, Inputs};
use super::output::{OutputArguments, file_name, say, tell};
use friction_identification::data::SplitRule;
use serde_json::{Value, json};

/// What a command found out about a joint.
pub struct Told {
    /// Its JSON file: name and text.
    pub document: (&'static str, String),
    /// Its other files.
    pub files: Vec<(&'static str, String)>,
    /// What the terminal shows.
    pub text: String,
}

/// Runs a command, known by its name, on each joint of the data.
///
/// # Errors
/// One line; nothing is written then.
pub fn each_joint(
    name: &str,
    data: &DataArguments,
    output: &OutputArguments,
    unless_asked: &SplitRule,
    command: impl Fn(&Input) -> Result<Told, String>,
) -> Result<(), String> {
    let output = &output.of_run(name, &data.data);
    match data.read(unless_asked)? {
        Inputs::One(input) => one(&command(&input)?, output),
        Inputs::Several(joints) => {
            let told = joints.iter().map(|(joint, input)| {
                let told = command(input).map_err(|line| format!("joint {joint}: {line}"))?;
                Ok((joint.clone(), told))
            });
            several(&told.collect::<Result<Vec<_>, String>>()?, output)
        }
    }
}

fn one(told: &Told, output: &OutputArguments) -> Result<(), String> {
    let Told { document: (name, json), files, text } = told;
    let mut all: Vec<(&str, &str)> = files.iter().map(|(name, text)| (*name, &**text)).collect();
    all.push((name, json));
    output.write(&all)?;
    if output.json {
        return say(json);
    }
    let out = output.folder().display();
    let written: Vec<String> = all.iter().map(|(name, _)| format!("{out}/{name}")).collect();
    tell(&format!("{text}written: {}\n", written.join(", ")))
}

fn several(joints: &[(String, Told)], output: &OutputArguments) -> Result<(), String> {
    let folders = folders(joints.iter().map(|(joint, _)| joint.as_str()));
    let mut files: Vec<(String, String)> = Vec::new();
    let mut documents: Vec<Value> = Vec::new();
    let mut shown = String::new();
    let mut name = "";
    for ((joint, told), folder) in joints.iter().zip(&folders) {
        name = told.document.0;
        let mut document: Value =
            serde_json::from_str(&told.document.1).map_err(|error| error.to_string())?;
        document["joint"] = json!(joint);
        documents.push(document);
        let own = told.files.iter().map(|(name, text)| (*name, text.clone()));
        let own = own.chain([(name, told.document.1.clone())]);
        files.extend(own.map(|(name, text)| (format!("{folder}/{name}"), text)));
        shown += &format!("joint {joint}:\n\n{}\n", told.text);
    }
    let all = json!({ "schema": 1, "joints": documents });
    let all = serde_json::to_string_pretty(&all).map_err(|error| error.to_string())? + "\n";
    files.push((name.to_owned(), all.clone()));
    let all_files: Vec<(&str, &str)> =
        files.iter().map(|(name, text)| (&**name, &**text)).collect();
    output.write(&all_files)?;
    if output.json {
        return say(&all);
    }
    let out = output.folder().display();
    let written: Vec<String> = folders.iter().map(|folder| format!("{out}/{folder}/")).collect();
    tell(&format!("{shown}written: {out}/{name}, {}\n", written.join(", ")))
}

/// A folder for each joint: what of its name a file system takes everywhere, and no two the same.
fn folders<'a>(joints: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut folders: Vec<String> = Vec::new();
    for joint in joints {
        let stem = file_name(joint);
        let mut folder = format!("joint-{stem}");
        let mut number = 2;
        // As a file system that takes no notice of case.
        while folders.iter().any(|known| known.eq_ignore_ascii_case(&folder)) {
            folder = format!("joint-{stem}-{number}");
            number += 1;
        }
        folders.push(folder);
    }
    folders
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_of_one_joint() {
        let names = ["1", "left/knee", "left knee", "Left-Knee", "..", "knee"];
        let made = folders(names.into_iter());
        assert_eq!(made[..2], ["joint-1", "joint-left-knee"]);
        assert_eq!(made[2..4], ["joint-left-knee-2", "joint-Left-Knee-3"]);
        assert!(made.iter().all(|folder| !folder.contains(['/', '.'])), "{made:?}");
    }
}
