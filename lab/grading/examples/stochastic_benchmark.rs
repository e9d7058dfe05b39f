//! Counts how often the paper's rule names the hidden effect, on simulated scenarios with a known truth.
//!
//! Each scenario of the benchmark is fitted with plain LuGre and certified. The *literal* rule names the parameter with the
//! largest coefficient of variation. The *calibrated* rule names the parameter whose permitted spread grew most relative to a
//! scenario without a hidden effect, or none.
//!
//! A rule is right if a hidden cause acts through its parameter (`Cause::acts_on`), or if it names none in a scenario
//! without an effect. The constant answer *coulomb_torque* is the reference for guessing.
//!
//! `cargo run --release -p friction-grading --example stochastic_benchmark [WORLDS PER KIND] [SEED OF THE WORLDS] [SEED OF
//! THE CERTIFICATES]`

use compensator_core::{LawKind, ParameterId as Id};
use friction_diagnose::cause;
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Rows, fit, tracks};
use friction_grading::calibrated_rule::certify_calibrated;
use joint_rig::simulated;
use rayon::prelude::*;
use simulated_machines::scenarios::Scenario;
use std::collections::BTreeMap;
use stochastic_extension::Settings;
use unkind_worlds::planned::{Kind, benchmark, draw};

/// Base seed of the graded scenarios; the threshold of the rule was chosen with seed 1.
const GRADING_SEED: u64 = 20_261_121;

/// Answers of the rules for a scenario.
struct Verdicts {
    kind: &'static str,
    cause: &'static str,
    literal: Id,
    calibrated: Option<Id>,
    largest_ratio: f64,
    /// Whether each rule is right: literal, calibrated, constant.
    right: [bool; 3],
    sum_cv: f64,
    seconds: f64,
}

fn is_right(scenario: &Scenario, kind: Kind, named: Option<Id>) -> bool {
    let Some(id) = named else { return kind == Kind::None };
    let hidden = scenario.truth.hidden.iter().map(|hidden| hidden.cause);
    // If the data cannot distinguish two causes, both count as right.
    let twins = scenario.truth.confusable_with.iter().copied();
    let points_at = |name| cause::named(name).is_some_and(|cause| cause.acts_on().contains(&id));
    hidden.chain(twins).any(points_at)
}

fn evaluate(kind: Kind, seed: u64, settings: &Settings) -> Option<Verdicts> {
    let scenario = draw(kind, seed);
    let tracks = tracks(&simulated::dataset(&scenario.log));
    let spec = Spec::law(LawKind::Lugre);
    let rows = Rows { tracks: &tracks, decimate: 1 };
    let options = FitOptions { starts: 2, ..FitOptions::default() };
    let solution = fit(&spec, &spec.parameters().ok()?, rows, &options);
    let begin = std::time::Instant::now();
    let (certificate, calibrated) =
        certify_calibrated(&solution.parameters(), LawKind::Lugre.parameters(), &tracks, settings);
    let seconds = begin.elapsed().as_secs_f64();
    let right = |named| is_right(&scenario, kind, named);
    Some(Verdicts {
        kind: kind.name(),
        cause: scenario.truth.cause(),
        literal: certificate.verdict,
        calibrated: calibrated.verdict,
        largest_ratio: calibrated.ratios.iter().map(|ratio| ratio.1).fold(0.0, f64::max),
        right: [
            right(Some(certificate.verdict)),
            right(calibrated.verdict),
            right(Some(Id::CoulombTorque)),
        ],
        sum_cv: certificate.sum_cv,
        seconds,
    })
}

/// Groups the answers by name: number of scenarios, and right answers of each rule.
fn table<'a>(
    verdicts: impl Iterator<Item = (&'a str, &'a Verdicts)>,
) -> Vec<(&'a str, [usize; 4])> {
    let mut rows: Vec<(&str, [usize; 4])> = Vec::new();
    for (name, verdict) in verdicts {
        let known = rows.iter().position(|(other, _)| *other == name);
        let at = known.unwrap_or_else(|| {
            rows.push((name, [0; 4]));
            rows.len() - 1
        });
        rows[at].1[0] += 1;
        for (count, right) in rows[at].1[1..].iter_mut().zip(verdict.right) {
            *count += usize::from(right);
        }
    }
    rows
}

fn print(title: &str, rows: &[(&str, [usize; 4])]) {
    println!(
        "\n| {title} | scenarios | literal right | calibrated right | always coulomb_torque |"
    );
    println!("|---|---|---|---|---|");
    for (name, [scenarios, literal, calibrated, always]) in rows {
        println!("| {name} | {scenarios} | {literal} | {calibrated} | {always} |");
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: u64| {
        arguments.next().and_then(|text| text.parse::<u64>().ok()).unwrap_or(default)
    };
    let (per_kind, seed) = (number(2) as usize, number(GRADING_SEED));
    let settings = Settings { seed: number(0), ..Settings::default() };
    let scenarios: Vec<(Kind, u64)> = benchmark(seed, per_kind).collect();
    let verdicts: Vec<Verdicts> = scenarios
        .into_par_iter()
        .filter_map(|(kind, seed)| evaluate(kind, seed, &settings))
        .collect();
    for v in &verdicts {
        println!(
            "{:<11} {:<22} literal {:<18} calibrated {:<18} ratio {:>6.2} sum {:>7.2} {:.2} s",
            v.kind,
            v.cause,
            v.literal.name(),
            v.calibrated.map_or("none", Id::name),
            v.largest_ratio,
            v.sum_cv,
            v.seconds
        );
    }
    let mut rows = table(verdicts.iter().map(|v| (v.kind, v)));
    let sum = |of: usize| rows.iter().map(|row| row.1[of]).sum::<usize>();
    let all = [sum(0), sum(1), sum(2), sum(3)];
    rows.push(("all", all));
    print("kind", &rows);
    print(
        "hidden cause (kind one)",
        &table(verdicts.iter().filter(|v| v.kind == "one").map(|v| (v.cause, v))),
    );
    let mut named: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    for v in &verdicts {
        named.entry(v.literal.name()).or_default()[0] += 1;
        named.entry(v.calibrated.map_or("none", Id::name)).or_default()[1] += 1;
    }
    println!("\n| named | literal | calibrated |\n|---|---|---|");
    for (name, [literal, calibrated]) in named {
        println!("| {name} | {literal} | {calibrated} |");
    }
}
