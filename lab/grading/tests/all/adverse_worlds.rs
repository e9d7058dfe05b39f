//! A short form of the benchmark of adverse scenarios: the diagnosis compared with a plain regression.
//!
//! The full benchmark is `cargo run --release -p friction-grading --example unkind`; its tables are in
//! `lab/grading/graded/diagnosis-benchmark.tsv`. This test uses the shortest logs among the first forty tuning seeds: all of them with
//! `LONG_TESTS=1`, otherwise a few. The limits are the results currently reached.

use friction_grading::contest::{Contest, Verdict, run_contest};
use friction_grading::score::Count;
use rayon::prelude::*;
use unkind_worlds::{Family, SensorKind};

/// Seeds of the graded scenarios: 3,100 to 6,700 rows, every kind of sensor, both plants.
const SEEDS: [u64; 20] = [
    3323915129, 3277778862, 2304481543, 3168394164, 4015444991, 3925696585, 1977394007, 4140594655,
    2788323855, 815759781, 1648630490, 3740546275, 1948885999, 1744814678, 3755459222, 1359749738,
    740646060, 595735654, 2974031141, 3947094250,
];

/// Number of graded scenarios, and limits on their results.
struct GradeLimits {
    count: usize,
    /// Minimum number of right diagnoses.
    right: usize,
    /// Maximum number of wrong diagnoses.
    wrong: usize,
}

const LONG: GradeLimits = GradeLimits { count: 20, right: 10, wrong: 5 };
const SHORT: GradeLimits = GradeLimits { count: 7, right: 4, wrong: 1 };

#[test]
fn diagnose_on_adverse_scenarios_stays_within_grade_limits() {
    let GradeLimits { count, right, wrong } = if crate::is_long() { LONG } else { SHORT };
    let seeds = &SEEDS[..count];
    let contests: Vec<Contest> = seeds
        .par_iter()
        .map(|seed| run_contest(*seed, Family::Training, false).expect("an answer"))
        .collect();
    for contest in &contests {
        println!("{}", contest.line());
    }
    let ours = Count::of(contests.iter().filter_map(|contest| contest.ours.as_ref()));
    let rival = Count::of(contests.iter().map(|contest| &contest.rival));
    println!("diagnosis {ours:?}, regression {rival:?}");
    assert_eq!(ours.right + ours.wrong + ours.abstained, count);
    assert!(ours.right >= right, "{ours:?}");
    assert!(ours.wrong <= wrong, "{ours:?}");
}

/// These scenarios contain no detectable effect. The base law has a wrong shape: a badly fitted Stribeck curve, a memory
/// effect, or another curve of the bristles. A delay, a drag or an inertia could imitate it and must not be named.
#[test]
fn diagnose_with_base_law_of_wrong_shape_names_no_cause() {
    let seeds = [953011756, 1225412155, 258476639];
    for contest in diagnose_without_cause(seeds) {
        let ours = contest.ours.as_ref().expect("the diagnosis was asked");
        assert!(ours.error_over_floor < 1.5, "{}", contest.line());
    }
}

/// Diagnoses scenarios and checks that no cause is named, which is the right result for them.
fn diagnose_without_cause(seeds: [u64; 3]) -> Vec<Contest> {
    let contests: Vec<Contest> = seeds
        .into_par_iter()
        .map(|seed| run_contest(seed, Family::Training, false).expect("an answer"))
        .collect();
    for contest in &contests {
        println!("{}", contest.line());
        let ours = contest.ours.as_ref().expect("the diagnosis was asked");
        assert_eq!(ours.verdict, Verdict::Right, "{}", contest.line());
        assert!(ours.named.iter().all(|name| *name == "unknown"), "{}", contest.line());
    }
    contests
}

/// Effects that imitate a cause: a backlash after which the friction returns early, and a negligible dwell-time effect in
/// a clean log. In the third scenario, one of four runs is fast and masks a speed-dependent error that must be corrected.
#[test]
fn diagnose_with_imitated_cause_names_none_and_corrects_speed_dependence() {
    let seeds = [3276719070, 3749694388, 653957162];
    let contests = diagnose_without_cause(seeds);
    let hidden = contests[2].ours.as_ref().expect("the diagnosis was asked");
    assert!(hidden.error_over_floor < 2.0, "{}", contests[2].line());
    assert!(hidden.gain > 0.5, "{}", contests[2].line());
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
    let hidden = |w: &&unkind_worlds::UnkindWorld| w.truth.hidden.is_some();
    assert!(worlds.iter().any(|w| !hidden(&w)));
    assert!(worlds.iter().filter(hidden).any(|w| !w.truth.is_detectable()));
    assert!(worlds.iter().filter(hidden).any(|w| w.truth.gain_in_errors > 30.0));
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
