//! The page of `diagnose` on simulated joints with known effects, and the command `demo`.
//!
//! `report_page` tests the properties of every page (no network, no markup from a file).

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::drawn_chart::{DrawnChart, charts, sentences, without_scripts};
use crate::{browser, picture, snapshot, unchecked};
use compensator_core::Quantity;
use friction_diagnose::prepare::Prepared;
use friction_diagnose::{Diagnosis, DiagnosisOptions, diagnose, summary};
use friction_results::diagnosis::DiagnosedLog;
use friction_results::report::Page;
use friction_results::stochastic::StochasticExtension;
use host_sim::simulated;
use joint_log::{Dataset, JointKind, SplitRule};
use serde_json::Value;
use simulated_machines::scenarios::{HiddenCause, Hide, Options, draw, draw_with};

/// A log that has been diagnosed.
struct Case {
    input: Prepared,
    found: Diagnosis,
    stochastic: StochasticExtension,
}

impl Case {
    fn new(data: Dataset) -> Self {
        let log = unchecked(data, &SplitRule::LeaveOneRunOut);
        let found = diagnose(&log.data, &log.split, &DiagnosisOptions::default(), &|_| {}).unwrap();
        let stochastic = StochasticExtension::new(&found, 0, &|_| {});
        let input = Prepared { skip: 7, seed: 4711, ..log };
        Self { input, found, stochastic }
    }

    fn hidden(effects: &[HiddenCause], seed: u64) -> Self {
        Self::new(simulated::dataset(&draw(effects, seed).log))
    }

    fn page(&self, columns: &[String]) -> Page {
        let input = &Prepared { columns: columns.to_vec(), ..self.input.clone() };
        DiagnosedLog { found: &self.found, stochastic: &self.stochastic, input }.page()
    }

    fn html(&self) -> String {
        self.page(&["torque_nm=<i>tau</i>".to_owned()]).render()
    }
}

/// The vertical values of a chart's series; the values of bars.
fn values(charts: &[DrawnChart], title: &str, series: &str) -> Vec<f64> {
    let chart = charts.iter().find(|chart| chart.title == title).expect(title);
    chart.named(series).expect(series).along(1)
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

/// A text as it stands in a page.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The joint the README hides its cause in: `simulate underwater-joint --hide pressure-coulomb --seed 9`.
#[test]
fn first_screen_of_readme_shows_effect_gain_and_possible_experiment() {
    let case = Case::hidden(&[HiddenCause::PressureCoulomb], 9);
    picture::compare(&picture::svg(&case.page(&[])));
    let visible = without_scripts(&case.html());
    let charts = charts(&visible);
    assert_eq!(charts[0].title, "Torque over time", "it is the first chart");
    let [logged, before, after] =
        ["logged", "before", "after"].map(|name| values(&charts, "Torque over time", name));
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let [missed, left] = [&before, &after].map(|model| (mean(&logged) - mean(model)).abs());
    assert!(missed > 0.2, "the effect is 0.37 Nm RMS: {missed}");
    assert!(left < missed / 2.0, "the extension is nearer to the logged torque: {left}, {missed}");
    // The points are means over the noise, which is half of the effect.
    if cfg!(feature = "stochastic") {
        snapshot::check("diagnosis-page", "the joint of the README", &sentences(&visible));
    }
    assert!(visible.contains("0.1865"), "the error with the extension");
    assert!(
        visible.contains("params.toml has lugre+pressure-coulomb"),
        "the cause is in the model"
    );
    let next = summary::next_experiment(&case.found);
    assert!(next.contains("another day"), "{next}");
}

#[test]
fn next_experiment_varies_logged_quantity_that_is_constant() {
    let mut data = simulated::dataset(&draw(&[HiddenCause::PressureCoulomb], 5).log);
    for run in &mut data.runs {
        let rows = run.len();
        run.set(Quantity::RadialForce, vec![20.0; rows]);
    }
    let case = Case::new(data);
    let next = summary::next_experiment(&case.found);
    assert!(next.contains("side load") && !next.contains("pressure"), "{next}");
    snapshot::check("diagnosis-page", "the next experiment with a constant column", &next);
}

#[test]
fn page_with_finding_shows_summary_and_evidence() {
    let options = Options { runs: Some(12), noise_nm: Some(0.05), ..Options::default() };
    let hide = Hide { effect: Some(HiddenCause::PressureCoulomb), size: Some(1.5e-6) };
    let case = Case::new(simulated::dataset(&draw_with(&[hide], 3, &options).log));
    assert_eq!(case.found.cause(), "pressure-coulomb");
    let html = case.html();
    assert!(html.len() < 800_000, "{} bytes", html.len());
    let visible = without_scripts(&html);
    for sentence in summary::summary(&case.found) {
        assert!(visible.contains(&escaped(&sentence)), "{sentence}");
    }
    for text in ["pressure-coulomb</h1>", "with seed 4711", "first 7 rows", "noise floor ("] {
        assert!(visible.contains(text), "{text}");
    }
    assert!(!visible.contains("<i>"), "names of columns are text");
    assert!(!visible.contains("NaN") && !visible.contains("∞"));

    let charts = charts(&visible);
    let [before, after] =
        ["before", "after"].map(|name| rms(&values(&charts, "Friction and pressure", name)));
    assert!(before > 3.0 * after, "the cause shows before ({before}) and not after ({after})");
    let titled = |title: &str| charts.iter().filter(|chart| chart.title == title).count();
    for title in ["Over velocity", "Over pressure difference", "Over the campaign"] {
        assert_eq!(titled(title), 2, "{title}: along the motion, and as it is");
    }
    let findings: Vec<_> = charts.iter().filter_map(|chart| chart.named("finding")).collect();
    let places = findings[0].along(1);
    assert_eq!((findings.len(), places.len()), (1, 1), "one cause is a finding, at {places:?}");
    for title in ["Detail", "By direction"] {
        assert_eq!(titled(title), 1, "{title}");
    }
    if cfg!(feature = "stochastic") {
        snapshot::check("diagnosis-page", "one finding", &sentences(&visible));
    }
}

#[test]
fn page_without_candidate_names_no_cause() {
    let case = Case::hidden(&[], 5);
    assert!(case.found.findings.is_empty() && case.found.candidates.is_empty());
    let visible = without_scripts(&case.html());
    if cfg!(feature = "stochastic") {
        snapshot::check("diagnosis-page", "no candidate", &sentences(&visible));
    }
    let charts = charts(&visible);
    let is_drawn = |name: &str| charts.iter().any(|chart| chart.named(name).is_some());
    assert!(is_drawn("base model"));
    for absent in ["after", "finding"] {
        assert!(!is_drawn(absent), "there is no extended model");
    }
}

/// Of small effects some are candidates and are not named.
#[test]
fn page_without_finding_lists_rejected_candidates() {
    let of = |effect| (1..8).map(move |seed| Case::hidden(&[effect], seed));
    let mut cases = of(HiddenCause::Backlash).chain(of(HiddenCause::PositionRipple));
    let has_rejected =
        |case: &Case| case.found.findings.is_empty() && !case.found.candidates.is_empty();
    let case = cases.find(has_rejected).expect("a log with a candidate that is not named");
    let visible = without_scripts(&case.html());
    let rejected = &case.found.candidates[0];
    assert!(visible.contains(rejected.cause.name()), "{}", rejected.cause.name());
    if cfg!(feature = "stochastic") {
        snapshot::check("diagnosis-page", "rejected candidates", &sentences(&visible));
    }
    let charts = charts(&visible);
    let is_drawn = charts.iter().any(|chart| chart.named("not named").is_some());
    assert!(is_drawn, "what was tried is shown");
}

#[test]
fn page_shows_chart_of_each_cause() {
    let mut shown = 0;
    for (effect, title) in [
        (HiddenCause::DirectionAsymmetry, "By direction, before"),
        (HiddenCause::Backlash, "after a reversal"),
        (HiddenCause::PositionRipple, "folded"),
    ] {
        let case = Case::hidden(&[effect], 5);
        let visible = without_scripts(&case.html());
        // Whether the cause is found is not this test's business; a page whose model holds it must show it.
        let first = case.found.findings.first();
        if first.is_some_and(|finding| finding.cause.name() == effect.name() && finding.is_in_model)
        {
            let is_drawn = charts(&visible).iter().any(|chart| chart.title.contains(title));
            // A play that is crossed within a few rows has too few of them for a chart.
            assert!(is_drawn || effect == HiddenCause::Backlash, "{title}");
            shown += usize::from(is_drawn);
        }
    }
    assert!(shown > 0, "{shown} of 3 were found at all");
}

#[test]
fn page_of_prismatic_joint_has_its_units() {
    let options = Options { runs: Some(6), ..Options::default() };
    let drawn = draw_with(&[HiddenCause::TorqueOffset.into()], 5, &options);
    let mut data = simulated::dataset(&drawn.log);
    data.joint = JointKind::Prismatic;
    let case = Case::new(data);
    let visible = without_scripts(&case.html());
    for text in ["Prismatic", "velocity (m/s)", "RMSE (N)", "N s/m"] {
        assert!(visible.contains(text), "{text}");
    }
    assert!(!visible.contains("rad/s)") && !visible.contains("(Nm)\""));
}

#[cfg(feature = "stochastic")]
#[test]
fn stochastic_section_leaves_out_missing_values() {
    use friction_results::diagnosis_page::stochastic_section;
    use serde_json::json;

    let empty = json!({"cv": {}, "sum_cv": 0.0});
    assert!(stochastic_section(&empty, &empty, Some("a reading")).is_empty());
    assert!(stochastic_section(&Value::Null, &json!([1]), None).is_empty());
    let full = json!({
        "cv": {"coulomb_torque": 0.1, "<b>": 3.0}, "sum_cv": 3.1, "classes": ["35 rpm", "70 rpm"],
        "cv_by_class": {"coulomb_torque": [0.1, 0.1], "<b>": [null, 3.0]}, "sum_cv_by_class": [1.0, 2.0],
        "levels": {"alpha": 0.3, "rho": 0.05},
    });
    let mut page = Page::new("", "");
    page.blocks = stochastic_section(&full, &empty, Some("They part."));
    let visible = without_scripts(&page.render());
    for text in ["They part.", "70 rpm", "&lt;b&gt;", "5.0 %"] {
        assert!(visible.contains(text), "{text}");
    }
    snapshot::check("diagnosis-page", "stochastic extension", &sentences(&visible));
}

/// Runs the program in a folder; what it said.
fn run(folder: &Path, arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn read_json(file: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(file).unwrap()).unwrap()
}

#[test]
fn demo_with_same_seed_gives_same_result() {
    let folder = tempfile::tempdir().unwrap();
    let said = run(folder.path(), &["demo", "--seed", "131", "--out", "one"]);
    let file = |name: &str| folder.path().join(name);
    for name in
        ["data.csv", "trace.log", "truth.json", "diagnosis.json", "params.toml", "report.html"]
    {
        assert!(file("one").join(name).metadata().unwrap().len() > 100, "{name}");
    }
    let truth = read_json(&file("one/truth.json"));
    let hidden = truth["cause"].as_str().unwrap();
    let diagnosis = read_json(&file("one/diagnosis.json"));
    let right = diagnosis["cause"] == hidden;
    for candidate in diagnosis["candidates"].as_array().unwrap() {
        assert!(candidate["cause"].is_string());
        assert!(candidate.get("rejected_because").is_none_or(Value::is_string));
    }
    for sentence in diagnosis["story"].as_array().unwrap() {
        assert!(said.contains(sentence.as_str().unwrap()));
    }
    let (before, revealed) = said.split_once("Hidden effect: ").unwrap();
    assert!(!before.contains("truth.json") && revealed.contains(hidden));
    assert!(revealed.contains(if right { "was right" } else { "was wrong" }));
    assert!(said.contains("--seed 131"));

    let json = run(folder.path(), &["demo", "--seed", "131", "--out", "two", "--json"]);
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["right"], right);
    assert_eq!(json["hidden"][0], hidden);
    let but_time = |mut diagnosis: Value| {
        diagnosis["seconds"] = Value::Null;
        diagnosis["data"]["files"] = Value::Null;
        // Threads that race for the end of a search make a few simulations more or less.
        for certificate in ["before", "after"] {
            diagnosis["stochastic_extension"][certificate]["simulations"] = Value::Null;
        }
        diagnosis
    };
    let again = read_json(&file("two/diagnosis.json"));
    assert!(but_time(diagnosis) == but_time(again.clone()), "the same seed, another diagnosis");
    assert!(json["diagnosis"] == again, "--json prints what the file holds");

    let Some(chromium) = browser::chromium() else { return };
    let output = browser::open(&chromium, &file("one/report.html"), "--dump-dom");
    let log = String::from_utf8_lossy(&output.stderr);
    let complaints: Vec<&str> = log.lines().filter(|line| line.contains("CONSOLE")).collect();
    assert!(complaints.is_empty(), "{complaints:#?}");
    let dom = String::from_utf8_lossy(&output.stdout);
    assert!(dom.matches("class=\"plot\"").count() > 10, "{log}");
}
