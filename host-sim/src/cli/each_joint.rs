//! Runs a command on the log of one joint, or on each joint of a log with several joints.
//!
//! For one joint, the command's result is written as it is. For several joints, each has its own folder with the same
//! files as a single joint. The terminal shows the results one after the other, the command's JSON file holds all of them
//! in the list `joints`, and `joints.html` lists the diagnoses side by side.

use super::error::{Result, in_part};
use super::input::{DataArguments, LogInputs};
use super::output::{OutputArguments, file_name, pretty};
use super::progress::in_stages;
use friction_diagnose::prepare::Prepared;
use friction_results::Files;
use friction_results::joints_page::{self, JointDiagnosis};
use joint_log::SplitRule;
use serde_json::{Value, json};

/// Result of a command for one joint.
pub struct JointResult {
    /// The result files.
    pub files: Files,
    /// Text for the terminal.
    pub text: String,
}

/// Reads the data, runs a command on each joint with its stages shown, and writes the results. `name` is the command's
/// name; it is part of the default output folder.
///
/// # Errors
/// Returns one line if the data cannot be read or the command fails; no file is written in that case.
pub fn each_joint(
    name: &str,
    data: &DataArguments,
    output: &OutputArguments,
    default_split: &SplitRule,
    command: impl Fn(&Prepared) -> Result<JointResult> + Sync,
) -> Result {
    let output = &output.of_run(name, &data.log.data);
    let run = |input: &Prepared| in_stages(data.log.threads, || command(input));
    match data.read(default_split)? {
        LogInputs::One(input) => {
            let JointResult { files, text } = run(&input)?;
            output.finish(&files.all().collect::<Vec<_>>(), &files.document.1, &text)
        }
        LogInputs::Several(joints) => {
            let results = joints.iter().map(|(joint, input)| {
                let result = run(input).map_err(in_part(format!("joint {joint}")))?;
                Ok((joint.clone(), result))
            });
            write_several(&results.collect::<Result<Vec<_>>>()?, output)
        }
    }
}

fn write_several(joints: &[(String, JointResult)], output: &OutputArguments) -> Result {
    let folders = folder_names(joints.iter().map(|(joint, _)| joint.as_str()));
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    let mut documents: Vec<Value> = Vec::new();
    let mut shown = String::new();
    let mut name = "";
    for ((joint, result), folder) in joints.iter().zip(&folders) {
        let text;
        (name, text) = (result.files.document.0, &result.files.document.1);
        let mut document: Value = serde_json::from_str(text)?;
        document["joint"] = json!(joint);
        documents.push(document);
        let written = result.files.all();
        files.extend(written.map(|(name, content)| (format!("{folder}/{name}"), content.to_vec())));
        shown += &format!("joint {joint}:\n\n{}\n", result.text);
    }
    let all = pretty(&json!({ "schema": 1, "joints": &documents }))?;
    files.push((name.to_owned(), all.clone().into_bytes()));
    let mut listed = vec![name.to_owned()];
    let reports: Vec<String> =
        folders.iter().map(|folder| format!("{folder}/report.html")).collect();
    // A fit has no cause to compare the joints by.
    if reports.iter().all(|report| files.iter().any(|(name, _)| name == report)) {
        let joints = joints.iter().zip(&documents).zip(&reports);
        let joints: Vec<JointDiagnosis> = joints
            .map(|(((joint, _), document), report)| JointDiagnosis { joint, document, report })
            .collect();
        files.push(("joints.html".into(), joints_page::page(&joints).render().into_bytes()));
        listed.push("joints.html".into());
    }
    let all_files: Vec<(&str, &[u8])> =
        files.iter().map(|(name, content)| (&**name, &**content)).collect();
    listed.extend(folders.iter().map(|folder| format!("{folder}/")));
    let listed: Vec<&str> = listed.iter().map(String::as_str).collect();
    output.finish_as(&all_files, &listed, &all, &shown)
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
