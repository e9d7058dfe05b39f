//! The diagnosis and the plain regression on unkind worlds, a short form of the bench.
//!
//! The whole is `cargo run --release -p host-sim --example unkind`; its table is in `docs/diagnosis-benchmark.md`. Here are
//! the shortest logs among the first forty of the tuning seeds, with `LONG_TESTS=1` all, else a few; the limits are what is
//! reached, to be tightened when more is.

use host_sim::benchmark::contest::{Contest, Verdict, contest};
use host_sim::benchmark::score::Count;
use rayon::prelude::*;
use simulated_machines::scenarios::unkind::{self, SensorKind};

/// Worlds that are graded: 3,100 to 6,700 rows, every kind of sensors, both plants.
const SEEDS: [u64; 20] = [
    3323915129, 3277778862, 2304481543, 3168394164, 4015444991, 3925696585, 1977394007, 4140594655,
    2788323855, 815759781, 1648630490, 3740546275, 1948885999, 1744814678, 3755459222, 1359749738,
    740646060, 595735654, 2974031141, 3947094250,
];

/// How many of the worlds are graded, least that is right and most that is wrong of those.
struct Asked {
    worlds: usize,
    right: usize,
    wrong: usize,
}

const LONG: Asked = Asked { worlds: 20, right: 10, wrong: 5 };
const SHORT: Asked = Asked { worlds: 7, right: 3, wrong: 1 };

#[test]
fn unkind_worlds_are_answered_no_worse_than_before() {
    let Asked { worlds, right, wrong } =
        if std::env::var_os("LONG_TESTS").is_some() { LONG } else { SHORT };
    let seeds = &SEEDS[..worlds];
    let contests: Vec<Contest> =
        seeds.par_iter().map(|seed| contest(*seed, false).expect("an answer")).collect();
    for contest in &contests {
        println!("{}", contest.line());
    }
    let ours = Count::of(contests.iter().filter_map(|contest| contest.ours.as_ref()));
    let rival = Count::of(contests.iter().map(|contest| &contest.rival));
    println!("diagnosis {ours:?}, regression {rival:?}");
    assert_eq!(ours.right + ours.wrong + ours.abstained, worlds);
    assert!(ours.right >= right, "{ours:?}");
    assert!(ours.wrong <= wrong, "{ours:?}");
}

/// Nothing anybody could see is hidden in these; what the base law gets wrong was named once: a delay of 44 ms and a drag where
/// the fit of a Stribeck curve had run wild and the bristles went with it (3.4 floors), an inertia and a drag where the
/// joint only remembers, or bends by another curve.
#[test]
fn what_a_law_of_another_shape_explains_is_not_named() {
    let seeds = [953011756, 1225412155, 258476639];
    for contest in named_nothing(seeds) {
        let ours = contest.ours.as_ref().expect("the diagnosis was asked");
        assert!(ours.error_over_floor < 1.5, "{}", contest.line());
    }
}

/// Asks the diagnosis about worlds in which it is right to name no cause.
fn named_nothing(seeds: [u64; 3]) -> Vec<Contest> {
    let contests: Vec<Contest> =
        seeds.into_par_iter().map(|seed| contest(seed, false).expect("an answer")).collect();
    for contest in &contests {
        println!("{}", contest.line());
        let ours = contest.ours.as_ref().expect("the diagnosis was asked");
        assert_eq!(ours.verdict, Verdict::Right, "{}", contest.line());
        assert!(ours.named.iter().all(|name| *name == "unknown"), "{}", contest.line());
    }
    contests
}

/// Misread laws that were named for a cause whose shape they leave: a play in which the friction is back long before it ends
/// (0.76 Nm of 4.3), and a trifle of contact age in a clean log. And a curve over the speed that one fast run of four hid.
#[test]
fn what_only_looks_like_a_cause_is_not_named_and_what_one_run_hides_is() {
    let seeds = [3276719070, 3749694388, 653957162];
    let contests = named_nothing(seeds);
    let hidden = contests[2].ours.as_ref().expect("the diagnosis was asked");
    assert!(hidden.error_over_floor < 2.0, "{}", contests[2].line());
    assert!(hidden.gain > 0.5, "{}", contests[2].line());
}

#[test]
fn the_same_seed_gives_the_same_world() {
    for seed in unkind::seeds(3).take(3) {
        let (one, other) = (unkind::draw(seed), unkind::draw(seed));
        assert_eq!(one.log, other.log);
        assert_eq!(one.truth.json(), other.truth.json());
    }
}

#[test]
fn a_late_channel_that_begins_before_the_log_leaves_no_row_out() {
    let world = unkind::draw(453192869);
    for run in &world.log.runs {
        let rows: Vec<usize> = run.columns.iter().map(Vec::len).collect();
        assert!(rows.iter().all(|count| *count == rows[0]), "run {}: {rows:?}", run.name);
    }
}

#[test]
fn worlds_are_as_varied_as_they_say() {
    let worlds: Vec<_> =
        unkind::seeds(5).take(24).collect::<Vec<u64>>().into_par_iter().map(unkind::draw).collect();
    for kind in SensorKind::ALL {
        assert!(worlds.iter().any(|w| w.truth.sensor == kind), "{}", kind.name());
    }
    for plant in ["bristles", "slip-elements"] {
        assert!(worlds.iter().any(|w| w.truth.plant == plant), "{plant}");
    }
    let hidden = |w: &&unkind::UnkindWorld| w.truth.hidden.is_some();
    assert!(worlds.iter().any(|w| !hidden(&w)));
    assert!(worlds.iter().filter(hidden).any(|w| !w.truth.detectable()));
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
            assert!(run.columns[0].windows(2).all(|t| t[0] < t[1]), "{seed}: time stands still");
        }
        // An exact log leaves its noise, where the plant is bristles, and in presliding that of the torque it began with.
        if truth.sensor == SensorKind::Exact && truth.plant == "bristles" {
            let ratio = truth.floor_nm / truth.noise_nm;
            assert!((0.95..1.5).contains(&ratio), "{seed}: {ratio}");
        }
    }
}
