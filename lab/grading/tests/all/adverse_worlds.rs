//! The diagnosis on unkind worlds, and properties of the worlds.
//!
//! The full benchmark, beside a plain regression, is `cargo run --release -p friction-grading --example unkind`; its tables are
//! in `lab/grading/graded/diagnosis-benchmark.tsv`. The limits are the results currently reached.

use friction_grading::contest::{Answer, Contest, Verdict, run_contest};
use rayon::prelude::*;
use unkind_worlds::{Family, SensorKind};

/// The shortest logs among the first forty tuning seeds, with every kind of sensor and both plants.
const UNKIND_SEEDS: [u64; 20] = [
    3323915129, 3277778862, 2304481543, 3168394164, 4015444991, 3925696585, 1977394007, 4140594655,
    2788323855, 815759781, 1648630490, 3740546275, 1948885999, 1744814678, 3755459222, 1359749738,
    740646060, 595735654, 2974031141, 3947094250,
];

/// Worlds without a detectable effect and with a base law of wrong shape: a badly fitted Stribeck curve, a memory effect, or
/// another curve of the bristles. A delay, a drag or an inertia could imitate it.
const WRONG_SHAPE_SEEDS: [u64; 3] = [953011756, 1225412155, 258476639];

/// Worlds with effects that imitate a cause: a backlash after which the friction returns early, and a negligible dwell-time
/// effect in a clean log. In the third one of four runs is fast and masks an error that depends on speed.
const IMITATED_SEEDS: [u64; 3] = [3276719070, 3749694388, 653957162];

/// Number of [`UNKIND_SEEDS`] that every run judges.
const SHORT: usize = 7;

/// Returns the diagnosis and the regression on worlds of the training family.
fn contests(seeds: &[u64]) -> Vec<Contest> {
    let contest = |seed: &u64| run_contest(*seed, Family::Training, false).expect("an answer");
    let contests: Vec<Contest> = seeds.par_iter().map(contest).collect();
    contests.iter().for_each(|contest| println!("{}", contest.line()));
    contests
}

fn ours(contest: &Contest) -> &Answer {
    contest.ours.as_ref().expect("the diagnosis was run")
}

#[test]
fn diagnose_on_adverse_scenarios_stays_within_grade_limits() {
    let count = if crate::is_long() { UNKIND_SEEDS.len() } else { SHORT };
    let contests = contests(&UNKIND_SEEDS[..count]);
    let of_ours =
        |verdict| contests.iter().filter(|contest| ours(contest).verdict == verdict).count();
    let (right, wrong) = (of_ours(Verdict::Right), of_ours(Verdict::Wrong));
    println!("{right} right and {wrong} wrong of {count}");
    assert!(2 * right >= count && 4 * wrong <= count, "{right} right, {wrong} wrong");
    let regression =
        contests.iter().filter(|contest| contest.rival.verdict == Verdict::Wrong).count();
    assert!(wrong < regression, "the plain regression is wrong less often");
}

/// The base law of these worlds has a wrong shape. At most one of them may be blamed on a cause, and never with certainty: of the
/// findings at 0.6 to 0.9 a fifth is not real.
#[test]
fn diagnose_with_base_law_of_wrong_shape_names_no_cause_with_certainty() {
    let contests = contests(&WRONG_SHAPE_SEEDS);
    let wrong = contests.iter().filter(|contest| ours(contest).verdict == Verdict::Wrong).count();
    assert!(wrong <= 1, "{wrong} of {} are named wrongly", contests.len());
    let sure = contests.iter().flat_map(|contest| &ours(contest).probabilities);
    assert!(
        sure.clone().all(|(p, is_real)| *p < 0.9 || *is_real),
        "{:?}",
        sure.collect::<Vec<_>>()
    );
    // The base law of the filtered torque stays far above the floor.
    let near = contests.iter().filter(|contest| ours(contest).error_over_floor < 1.5).count();
    assert!(near >= 2, "{near} of {} are near the floor", contests.len());
}

fn assert_names_no_cause(contest: &Contest) {
    let answer = ours(contest);
    assert_eq!(answer.verdict, Verdict::Right, "{}", contest.line());
    assert!(answer.named.iter().all(|name| *name == "unknown"), "{}", contest.line());
}

#[test]
fn diagnose_with_imitated_cause_names_none_and_reports_what_remains() {
    let contests = contests(&IMITATED_SEEDS);
    contests.iter().for_each(assert_names_no_cause);
    let answer = ours(&contests[2]);
    assert_eq!(answer.named, ["unknown"], "{}", contests[2].line());
}

#[test]
fn draw_with_same_seed_gives_same_scenario() {
    for seed in unkind_worlds::seeds(3).take(3) {
        let (one, other) = (unkind_worlds::draw(seed), unkind_worlds::draw(seed));
        assert_eq!(one.log, other.log);
        assert_eq!(one.truth.json(), other.truth.json());
    }
}

#[test]
fn draw_with_late_channel_keeps_all_rows() {
    let world = unkind_worlds::draw(453192869);
    for run in &world.log.runs {
        let rows: Vec<usize> = run.columns.iter().map(Vec::len).collect();
        assert!(rows.iter().all(|count| *count == rows[0]), "run {}: {rows:?}", run.name);
    }
}

#[test]
fn draw_covers_all_sensor_kinds_and_plants() {
    let worlds: Vec<_> = unkind_worlds::seeds(5)
        .take(24)
        .collect::<Vec<u64>>()
        .into_par_iter()
        .map(unkind_worlds::draw)
        .collect();
    for kind in SensorKind::ALL {
        assert!(worlds.iter().any(|w| w.truth.sensor == kind), "{}", kind.name());
    }
    for plant in ["bristles", "slip-elements"] {
        assert!(worlds.iter().any(|w| w.truth.plant == plant), "{plant}");
    }
    let hidden = |w: &&unkind_worlds::UnkindWorld| !w.truth.hidden.is_empty();
    assert!(worlds.iter().any(|w| !hidden(&w)));
    assert!(worlds.iter().filter(hidden).any(|w| !w.truth.is_detectable()));
    assert!(worlds.iter().filter(hidden).any(|w| w.truth.gain_in_errors() > 30.0));
    for world in &worlds {
        let truth = &world.truth;
        let seed = truth.seed;
        assert!((1_500..=25_000).contains(&world.log.rows()), "{seed}: {} rows", world.log.rows());
        assert!((3..=40).contains(&world.log.runs.len()), "{seed}");
        assert!((49.0..=2001.0).contains(&truth.rate_hz), "{seed}");
        assert!(truth.floor_nm.is_finite() && truth.floor_nm > 0.0, "{seed}");
        let position = world.log.columns.iter().any(|name| name == "position_rad");
        assert_eq!(position, truth.sensor != SensorKind::NoPosition, "{seed}");
        for run in &world.log.runs {
            assert!(run.columns.iter().flatten().all(|x| x.is_finite()), "{seed}");
            let is_increasing = run.columns[0].windows(2).all(|t| t[0] < t[1]);
            assert!(is_increasing, "{seed}: time does not increase");
        }
        // With exact sensors and a bristle plant, the floor is the sensor noise, plus that of the initial torque in
        // presliding.
        if truth.sensor == SensorKind::Exact && truth.plant == "bristles" {
            let ratio = truth.floor_nm / truth.noise_nm;
            assert!((0.95..1.5).contains(&ratio), "{seed}: {ratio}");
        }
    }
}
