//! `joints.html`: the diagnoses of one log's joints side by side, each with a link to its report.
//!
//! It reads the documents of the joints, so it says what `diagnosis.json` says.

use crate::budget::removed_share;
use crate::page::words::counted;
use crate::report::{Answers, Benefit, Block, Cell, Page, Table};
use joint_log::number::significant;
use serde_json::Value;

/// The diagnosis of one joint: its name, its document and the path of its report.
#[derive(Clone, Copy, Debug)]
pub struct JointDiagnosis<'a> {
    /// Its number or name in the log.
    pub joint: &'a str,
    /// The content of its `diagnosis.json`.
    pub document: &'a Value,
    /// Path of its report, relative to the page.
    pub report: &'a str,
}

/// Returns the page of the joints, in the order given. Errors are RMS values on held-out rows.
pub fn page(joints: &[JointDiagnosis]) -> Page {
    let named: Vec<&JointDiagnosis> =
        joints.iter().filter(|joint| text(joint.document, "cause") != "none").collect();
    let subtitle =
        format!("{} of {} have a cause to look at", named.len(), counted(joints.len(), "joint"));
    let mut page = Page::new("Joints of one log", subtitle).answering(answers(joints, &named));
    let faults = joints.iter().filter_map(|joint| {
        let fault = joint.document["leading_fault"].as_str()?;
        Some(format!("joint {}: {fault}", joint.joint))
    });
    let faults: Vec<String> = faults.collect();
    if !faults.is_empty() {
        let text =
            format!("Faults of the log that explain most of the error: {}.", faults.join(", "));
        page.push(Block::Paragraph(text));
    }
    let caption = "Cause with its calibrated probability, the held-out error of the base model and of the extended one, and the \
                   share of the squared error that a model could remove which is removed. An empty share is not known. The joint \
                   links to its report.";
    let header =
        "joint|cause|probability|base model|extended model|unit|removed (%)|next experiment";
    page.push(Block::Records(Table::new(caption, header, joints.iter().map(row))));
    page
}

fn answers(joints: &[JointDiagnosis], named: &[&JointDiagnosis]) -> Answers {
    let range = |of: &dyn Fn(&Value) -> Option<f64>, joints: &mut dyn Iterator<Item = &Value>| {
        let mut values: Vec<f64> = joints.filter_map(of).collect();
        values.sort_by(f64::total_cmp);
        let [least, most] = [*values.first()?, *values.last()?].map(|value| significant(value, 2));
        Some(if least == most { most } else { format!("{least} to {most}") })
    };
    let certainty = range(&probability, &mut named.iter().map(|joint| joint.document));
    let removed = range(&removed_percent, &mut joints.iter().map(|joint| joint.document));
    Answers {
        what: format!("The diagnoses of {} that move in one log.", counted(joints.len(), "joint")),
        certainty: certainty.map_or("No joint has a named cause.".to_owned(), |range| {
            format!("The named causes have a probability of {range}.")
        }),
        benefit: Benefit::Gain(match removed {
            Some(range) => format!(
                "Of the squared error that a model could remove, {range}\u{a0}% is removed in each joint."
            ),
            None => "How much of the error a model could remove is not known.".to_owned(),
        }),
        next: match named.first() {
            Some(first) => format!("Open the report of joint {}.", first.joint),
            None => "No joint has a cause to look at.".to_owned(),
        },
    }
}

fn text<'v>(document: &'v Value, key: &str) -> &'v str {
    document[key].as_str().unwrap_or_default()
}

fn probability(document: &Value) -> Option<f64> {
    document["findings"][0]["probability"].as_f64()
}

/// Returns the share of the removable error that is removed, %, from the error budget.
fn removed_percent(document: &Value) -> Option<f64> {
    let step = |name: &str| {
        let steps = document["budget"].as_array()?;
        steps.iter().find(|step| step["step"] == name)?["test_rmse"].as_f64()
    };
    let after = document["extended"]["test_rmse"].as_f64()?;
    removed_share(step("plain")?, after, step("ceiling")?).map(|share| 100.0 * share)
}

fn row(joint: &JointDiagnosis) -> Vec<Cell> {
    let found = joint.document;
    let short = |value: Option<f64>| value.map_or(Cell::Empty, |one| Cell::ShortNumber(one, 2));
    let error = |value: &Value| Cell::from(value.as_f64());
    vec![
        Cell::Link { text: joint.joint.to_owned(), target: joint.report.to_owned() },
        text(found, "cause").into(),
        short(probability(found)),
        error(&found["baseline"]["test_rmse"]),
        error(&found["extended"]["test_rmse"]),
        text(&found["data"], "unit").into(),
        short(removed_percent(found)),
        text(found, "next_experiment").into(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn page_of_two_joints_links_both_and_leads_with_the_fault() {
        let document = |cause: &str, fault: Option<&str>| {
            json!({
                "cause": cause, "leading_fault": fault, "next_experiment": "Move it.",
                "findings": [{"probability": 0.93}], "baseline": {"test_rmse": 0.5},
                "extended": {"test_rmse": 0.25}, "data": {"noise_floor": 0.2, "unit": "Nm"},
                "budget": [
                    {"step": "plain", "test_rmse": 0.5}, {"step": "ceiling", "test_rmse": 0.2},
                ],
            })
        };
        let (hip, knee) = (document("none", None), document("backlash", Some("sign-suspect")));
        let html = page(&[
            JointDiagnosis { joint: "hip", document: &hip, report: "joint-hip/report.html" },
            JointDiagnosis { joint: "knee", document: &knee, report: "joint-knee/report.html" },
        ])
        .render();
        for text in [
            "1 of 2 joints",
            "joint knee: sign-suspect",
            "joint-hip/report.html",
            "backlash",
            "93",
            "89\u{a0}%",
        ] {
            assert!(html.contains(text), "{text} is missing");
        }
    }
}
