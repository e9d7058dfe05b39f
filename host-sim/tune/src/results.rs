//! The files of a session.

use crate::session::Session;
use friction_results::{Files, diagnosis};

/// Returns the files of a session: `tune.json`, `diagnosis.json`, `before.toml` and `params.toml`, given as text.
///
/// # Errors
/// One line, if a value cannot be represented in JSON.
pub fn files(session: &Session, before: &str, tried: Option<&str>) -> Result<Files, String> {
    let document = serde_json::to_string_pretty(&session.report.document());
    let mut others = vec![("before.toml", before.as_bytes().to_vec())];
    if let Some(tried) = tried {
        others.push(("params.toml", tried.as_bytes().to_vec()));
    }
    if let Some(learnt) = &session.learnt {
        let text = diagnosis::json_text(&learnt.found, &learnt.input)?;
        others.push(("diagnosis.json", text.into_bytes()));
    }
    let document = document.map_err(|error| error.to_string())? + "\n";
    Ok(Files { document: ("tune.json", document), others })
}
