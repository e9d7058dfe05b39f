//! Cases for the calibration of the diagnosis: the evidence for each cause on simulated worlds, with the truth.
//!
//! The diagnosis of a world runs as for a user, up to the evaluation of its proposal. Each cause that was weighed is a
//! case for the model of findings, and each candidate of the first round one for the model of candidates. A case is real
//! if its cause is hidden in the world, or if the hidden cause is among those that the log cannot distinguish from it. Causes
//! that hold for the log whatever is hidden are no cases.

use super::contest::weighed_of_world;
use super::diagnose_log;
use friction_diagnose::DiagnosisOptions;
use friction_diagnose::calibration::Case;
use friction_diagnose::cause_evidence::{CauseEvidence, FIGURES};
use friction_fit::spec::parse_rigid_body;
use joint_rig::simulated;
use serde_json::{Value, json};
use unkind_worlds::UnkindWorld;

/// Cases of one world.
#[derive(Clone, Debug)]
pub struct WorldCases {
    /// Seed of the world.
    pub seed: u64,
    /// True if an effect is hidden that a refit of the true structure shows.
    pub is_detectable: bool,
    /// Accepted causes, strongest first.
    pub findings: Vec<Case>,
    /// Candidates of the first round.
    pub candidates: Vec<Case>,
}

/// Diagnoses the world of a seed and returns its cases.
///
/// # Errors
/// Returns one line if the log cannot be diagnosed.
pub fn world_cases(seed: u64) -> Result<WorldCases, String> {
    let UnkindWorld { log, truth } = unkind_worlds::draw(seed);
    let failed = |why: String| format!("seed {seed}: {why}");
    let rigid_body =
        parse_rigid_body(&truth.rigid_body.join(",")).map_err(|e| failed(e.to_string()))?;
    let question =
        DiagnosisOptions { rigid_body, only_weighs: true, ..DiagnosisOptions::default() };
    let (found, _) = diagnose_log(simulated::dataset(&log), &question).map_err(failed)?;
    let case = |evidence: &CauseEvidence, is_real: bool| Case {
        figures: evidence.figures(),
        is_real,
        log: seed,
    };
    let counts = |name: &str| !truth.true_of_the_log.contains(&name);
    let findings = weighed_of_world(&found, &truth).into_iter().map(|own| Case {
        figures: own.figures,
        is_real: own.is_real,
        log: seed,
    });
    let passed = found.scores.iter().filter(|own| counts(own.cause.name()));
    let candidates = passed
        .filter(|own| own.fit.unseen.value > 0.0)
        .map(|own| case(&own.evidence, truth.is_hidden(own.cause.name())));
    Ok(WorldCases {
        seed,
        is_detectable: truth.is_detectable(),
        findings: findings.collect(),
        candidates: candidates.collect(),
    })
}

impl WorldCases {
    /// Returns the cases as one line of JSON.
    pub fn emit(&self) -> String {
        let list = |cases: &[Case]| -> Vec<Value> {
            cases
                .iter()
                .map(|case| json!({"real": case.is_real, "figures": case.figures}))
                .collect()
        };
        json!({
            "seed": self.seed,
            "detectable": self.is_detectable,
            "findings": list(&self.findings),
            "candidates": list(&self.candidates),
        })
        .to_string()
    }

    /// Parses a line of JSON; `None` if it is incomplete, as after an interrupted run.
    pub fn parse(line: &str) -> Option<Self> {
        let value: Value = serde_json::from_str(line).ok()?;
        let seed = value.get("seed")?.as_u64()?;
        let case = |case: &Value| {
            let numbers = case.get("figures")?.as_array()?.iter().map(Value::as_f64);
            let numbers: Vec<f64> = numbers.collect::<Option<_>>()?;
            let figures: [f64; FIGURES.len()] = numbers.try_into().ok()?;
            Some(Case { figures, is_real: case.get("real")?.as_bool()?, log: seed })
        };
        let list = |key: &str| -> Option<Vec<Case>> {
            value.get(key)?.as_array()?.iter().map(case).collect()
        };
        Some(Self {
            seed,
            is_detectable: value.get("detectable")?.as_bool()?,
            findings: list("findings")?,
            candidates: list("candidates")?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parse_of_emitted_line_returns_same_cases() {
        let case = Case { figures: [0.25; FIGURES.len()], is_real: true, log: 7 };
        let world = WorldCases {
            seed: 7,
            is_detectable: true,
            findings: vec![case.clone()],
            candidates: vec![case],
        };
        let again = WorldCases::parse(&world.emit()).expect("a line");
        assert_eq!(again.findings[0].figures, world.findings[0].figures);
        assert!(again.is_detectable && again.findings[0].is_real && again.candidates.len() == 1);
        assert!(WorldCases::parse(&world.emit()[..40]).is_none());
    }
}
