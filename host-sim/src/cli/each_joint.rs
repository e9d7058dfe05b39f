//! Runs a command on the log of one joint, or on each joint of a log with several joints.
//!
//! For one joint, the command's result is written as it is. For several joints, each has its own folder with the same
//! files as a single joint. The terminal shows the results one after the other, and the command's JSON file holds all
//! of them in the list `joints`.

use super::input::{DataArguments, LogInputs};
use super::output::{OutputArguments, file_name, print_formatted, print_text};
use friction_diagnose::prepare::Prepared;
use friction_results::Files;
use joint_log::SplitRule;
use serde_json::{Value, json};

/// Result of a command for one joint.
pub struct JointResult {
    /// The result files.
    pub files: Files,
    /// Text for the terminal.
    pub text: String,
}

/// Runs a command on each joint of the data and writes the results. `name` is the command's name; it is part of the
/// default output folder.
///
/// # Errors
/// Returns one line if the data cannot be read or the command fails; no file is written in that case.
pub fn each_joint(
    name: &str,
    data: &DataArguments,
    output: &OutputArguments,
    default_split: &SplitRule,
    command: impl Fn(&Prepared) -> Result<JointResult, String>,
) -> Result<(), String> {
    let output = &output.of_run(name, &data.data);
    match data.read(default_split)? {
        LogInputs::One(input) => write_one(&command(&input)?, output),
        LogInputs::Several(joints) => {
            let results = joints.iter().map(|(joint, input)| {
                let result = command(input).map_err(|line| format!("joint {joint}: {line}"))?;
                Ok((joint.clone(), result))
            });
            write_several(&results.collect::<Result<Vec<_>, String>>()?, output)
        }
    }
}

fn write_one(result: &JointResult, output: &OutputArguments) -> Result<(), String> {
    let JointResult { files, text } = result;
    let all: Vec<(&str, &[u8])> = files.all().collect();
    output.write_bytes(&all)?;
    if output.json {
        return print_text(&files.document.1);
    }
    let out = output.folder().display();
    let written: Vec<String> = all.iter().map(|(name, _)| format!("{out}/{name}")).collect();
    print_formatted(&format!("{text}written: {}\n", written.join(", ")))
}

fn write_several(joints: &[(String, JointResult)], output: &OutputArguments) -> Result<(), String> {
    let folders = folder_names(joints.iter().map(|(joint, _)| joint.as_str()));
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    let mut documents: Vec<Value> = Vec::new();
    let mut shown = String::new();
    let mut name = "";
    for ((joint, result), folder) in joints.iter().zip(&folders) {
        let text;
        (name, text) = (result.files.document.0, &result.files.document.1);
        let mut document: Value = serde_json::from_str(text).map_err(|error| error.to_string())?;
        document["joint"] = json!(joint);
        documents.push(document);
        let own = result.files.all();
        files.extend(own.map(|(name, content)| (format!("{folder}/{name}"), content.to_vec())));
        shown += &format!("joint {joint}:\n\n{}\n", result.text);
    }
    let all = json!({ "schema": 1, "joints": documents });
    let all = serde_json::to_string_pretty(&all).map_err(|error| error.to_string())? + "\n";
    files.push((name.to_owned(), all.clone().into_bytes()));
    let all_files: Vec<(&str, &[u8])> =
        files.iter().map(|(name, content)| (&**name, &**content)).collect();
    output.write_bytes(&all_files)?;
    if output.json {
        return print_text(&all);
    }
    let out = output.folder().display();
    let written: Vec<String> = folders.iter().map(|folder| format!("{out}/{folder}/")).collect();
    print_formatted(&format!("{shown}written: {out}/{name}, {}\n", written.join(", ")))
}

/// Returns a unique folder name for each joint, valid on every file system.
fn folder_names<'a>(joints: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut folders: Vec<String> = Vec::new();
    for joint in joints {
        let stem = file_name(joint);
        let mut folder = format!("joint-{stem}");
        let mut number = 2;
        // Some file systems ignore case.
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
    fn folder_names_with_similar_joint_names_are_unique() {
        let names = ["1", "left/knee", "left knee", "Left-Knee", "..", "knee"];
        let made = folder_names(names.into_iter());
        assert_eq!(made[..2], ["joint-1", "joint-left-knee"]);
        assert_eq!(made[2..4], ["joint-left-knee-2", "joint-Left-Knee-3"]);
        assert!(made.iter().all(|folder| !folder.contains(['/', '.'])), "{made:?}");
    }
}
