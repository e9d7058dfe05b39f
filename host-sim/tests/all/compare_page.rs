//! The page of `compare` and `identify` on simulated joints with known parameters.
//!
//! `report_page` tests the properties of every page (no network, no markup from a file).

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::drawn_chart::{between, charts, sentences, without_scripts};
use crate::{snapshot, unchecked};
use friction_diagnose::prepare::Prepared;
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Outcome, identify};
use friction_results::{FitReport, compare_fits};
use host_sim::simulated;
use joint_log::{Dataset, Run, SplitRule};
use serde_json::Value;
use simulated_machines::{Recording, record};

const SHORT: Recording = Recording {
    runs: 4,
    seconds: 10.0,
    rate_hz: 200.0,
    noise_nm: 0.05,
    loaded: false,
    steady: false,
};

/// A log that is to be fitted.
struct Case {
    input: Prepared,
}

impl Case {
    fn new(data: Dataset, decimate: usize) -> Self {
        Self { input: Prepared { decimate, ..unchecked(data, &SplitRule::default()) } }
    }

    fn simulated(how: Recording) -> Self {
        Self::new(simulated::dataset(record(1, how).log()), 1)
    }

    fn fit(&self, model: &str) -> Outcome {
        let spec = Spec::parse(model).unwrap();
        let options = FitOptions { starts: 1, ..FitOptions::default() };
        let (train, test) = (self.input.train_rows(), self.input.test_rows());
        identify(&spec, &spec.parameters().unwrap(), train, test, &options)
    }

    /// The page without scripts.
    fn page(&self, models: &[&str]) -> String {
        let fits: Vec<Outcome> = models.iter().map(|model| self.fit(model)).collect();
        let study = FitReport { input: &self.input, test: self.input.test_rows(), fits: &fits };
        without_scripts(&compare_fits(&study).page.render())
    }
}

#[test]
fn page_names_best_model_with_its_reasons() {
    let page =
        Case::simulated(SHORT).page(&["linear", "stribeck", "dahl", "lugre", "lugre-asymmetric"]);
    // The joint is symmetrical, so the larger model is not significantly better: lugre is sufficient for this data.
    snapshot::check("compare-page", "five models", &sentences(&page));
    assert!(page.contains("8\u{202f}000 rows in 4 runs"), "rows and runs");
    assert!(page.contains(" best\""), "the best of each column is marked");
    let charts = charts(&page);
    let held_out = charts[0].series[0].along(1);
    assert!(held_out.is_sorted() && held_out.len() == 5, "best first: {held_out:?}");
    let titled = |title: &str| charts.iter().filter(|chart| chart.title == title).count();
    assert_eq!(titled("linear"), 2, "its torque and its residual");
    assert_eq!(titled("One motion cycle over time"), 1);
}

#[test]
fn page_with_steady_sliding_reports_parameters_not_determined() {
    let mut data = simulated::dataset(record(1, Recording { steady: true, ..SHORT }).log());
    // Remove the start of each run, where the bristles deflect.
    data.runs.iter_mut().for_each(|run| *run = run.slice(1000..run.len()));
    data.rows = data.runs.iter().map(Run::len).sum();
    let page = Case::new(data, 1).page(&["lugre"]);
    snapshot::check("compare-page", "steady sliding", &sentences(&page));
    assert!(!page.contains(" best\""), "there is nothing to compare");
}

#[test]
fn page_with_missing_effect_does_not_call_residual_noise() {
    let page = Case::simulated(Recording { loaded: true, ..SHORT }).page(&["linear", "lugre"]);
    assert!(page.contains("(radial_force_n and pressure_diff_pa)"), "the columns to test");
    snapshot::check("compare-page", "missing effect", &sentences(&page));
}

/// Runs host-sim in a folder and returns its standard output.
fn run_in(folder: &Path, arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_host-sim"))
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn next_step_of_compare_gains_on_held_out_rows() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| run_in(folder.path(), arguments);
    run(&["simulate", "underwater-joint", "--hide", "pressure-coulomb", "--seed", "5"]);
    let compared = run(&["compare", "out/data.csv", "--models", "linear,lugre", "--out", "all"]);
    let next = compared.lines().find(|line| line.contains("Next steps:")).unwrap();
    assert!(next.contains("diagnose"), "{next}");
    assert!(next.contains("(pressure_diff_pa and temperature_c)"), "{next}");
    // A term for one of these columns may increase the held-out error, so compare names none.
    assert!(!next.contains('+'), "{next}");
    run(&["diagnose", "out/data.csv", "--out", "why"]);
    let document = fs::read_to_string(folder.path().join("why/diagnosis.json")).unwrap();
    let document: Value = serde_json::from_str(&document).unwrap();
    assert_eq!(document["cause"], "pressure-coulomb");
    let error = |model: &str| document[model]["test_rmse"].as_f64().unwrap();
    assert!(error("extended") < error("baseline"), "{document:#}");
    assert!(document["extended"]["gain_ci95"][0].as_f64().unwrap() > 0.0);
}

#[test]
fn page_with_hours_between_runs_shortens_pauses() {
    let mut data = simulated::dataset(record(1, SHORT).log());
    for (index, run) in data.runs.iter_mut().enumerate() {
        run.time_s.iter_mut().for_each(|time| *time += 5.0 * 3600.0 * index as f64);
    }
    data.files = vec!["</script><b>log</b>.csv".into()];
    let case = Case::new(data, 10);
    let held_out: usize = case.input.split.test.iter().map(|part| part.rows.len()).sum();
    let page = case.page(&["dahl"]);
    for text in ["one row in 10", "&lt;/b&gt;", "5e1f"] {
        assert!(page.contains(text), "{text}");
    }
    assert!(!page.contains("<b>"));
    let charts = charts(&page);
    let residual = charts.iter().rfind(|chart| chart.title == "dahl").unwrap();
    let time = residual.series[0].along(0);
    let last = time.iter().copied().fold(0.0, f64::max);
    assert!(last < 1.2 * held_out as f64 / SHORT.rate_hz, "{last} s");
    assert!(time.is_sorted() && time.len() <= held_out / 10);
}

#[test]
fn identify_and_compare_write_their_page() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| run_in(folder.path(), arguments);
    let size = ["--runs", "3", "--seconds", "3", "--rate", "200"];
    run(&[&["simulate", "underwater-joint", "--out", "joint"], &size[..]].concat());
    let output = run(&["compare", "joint/data.csv", "--models", "linear,stribeck", "--out", "all"]);
    assert!(output.contains("all/compare.html"));
    run(&["identify", "joint/data.csv", "--model", "lugre", "--out", "one"]);
    for (file, names) in
        [("all/compare.html", &["data.csv"][..]), ("one/fit.html", &["lugre", "data.csv"])]
    {
        let html = fs::read_to_string(folder.path().join(file)).unwrap();
        let title = between(&html, "<h1>", "</h1>").unwrap();
        assert!(names.iter().all(|name| title.contains(name)), "{file}: {title}");
        assert!(html.len() < 800_000, "{file}: {} bytes", html.len());
        assert!(charts(&without_scripts(&html)).len() > 4, "{file}");
    }
}
