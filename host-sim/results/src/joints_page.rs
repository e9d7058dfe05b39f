//! `joints.html`: the diagnoses of one log's joints side by side, each with a link to its report.
//!
//! It reads the documents of the joints, so it says what `diagnosis.json` says.

use crate::page::words::counted;
use crate::report::{Block, Cell, Page, Table};
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
    let named = joints.iter().filter(|own| text(own.document, "cause") != "none").count();
    let subtitle = format!("{named} of {} have a cause to look at", counted(joints.len(), "joint"));
    let mut page = Page::new("Joints of one log", subtitle);
    let faults = joints.iter().filter_map(|own| {
        let fault = own.document["leading_fault"].as_str()?;
        Some(format!("joint {}: {fault}", own.joint))
    });
    let faults: Vec<String> = faults.collect();
    if !faults.is_empty() {
        let text =
            format!("Faults of the log that explain most of the error: {}.", faults.join(", "));
        page.push(Block::paragraph(text));
    }
    let caption = "Cause with its calibrated probability, and the held-out error of the base model and of the extended one beside \
                   the noise floor. The joint links to its report.";
    let header =
        "joint|cause|probability|base model|extended model|noise floor|unit|next experiment";
    page.push(Block::Records(Table::new(caption, header, joints.iter().map(row))));
    page
}

fn text<'v>(document: &'v Value, key: &str) -> &'v str {
    document[key].as_str().unwrap_or_default()
}

fn row(own: &JointDiagnosis) -> Vec<Cell> {
    let found = own.document;
    let error = |value: &Value| Cell::from(value.as_f64());
    let probability = found["findings"][0]["probability"].as_f64();
    vec![
        Cell::Link { text: own.joint.to_owned(), target: own.report.to_owned() },
        text(found, "cause").into(),
        probability.map_or(Cell::Empty, |one| Cell::ShortNumber(one, 2)),
        error(&found["baseline"]["test_rmse"]),
        error(&found["extended"]["test_rmse"]),
        error(&found["data"]["noise_floor"]),
        text(&found["data"], "unit").into(),
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
            })
        };
        let (hip, knee) = (document("none", None), document("backlash", Some("sign-suspect")));
        let html = page(&[
            JointDiagnosis { joint: "hip", document: &hip, report: "joint-hip/report.html" },
            JointDiagnosis { joint: "knee", document: &knee, report: "joint-knee/report.html" },
        ])
        .render();
        for text in
            ["1 of 2 joints", "joint knee: sign-suspect", "joint-hip/report.html", "backlash", "93"]
        {
            assert!(html.contains(text), "{text} is missing");
        }
    }
}
