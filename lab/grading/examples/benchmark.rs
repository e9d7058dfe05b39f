//! Grades the diagnosis on scenarios with hidden effects: `benchmark [SEED_BASE] [PER_KIND] [FILTER]`.

use friction_grading::{TUNING_SEED, grade_scenario};
use rayon::prelude::*;
use std::collections::BTreeMap;
use unkind_worlds::planned::{Kind, benchmark};

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let number = |at: usize, default: u64| {
        arguments.get(at).and_then(|text| text.parse().ok()).unwrap_or(default)
    };
    let filter = arguments.get(3).cloned().unwrap_or_default();
    let scenarios: Vec<(Kind, u64)> = benchmark(number(1, TUNING_SEED), number(2, 1) as usize)
        .filter(|(kind, _)| format!("{kind:?}").contains(&filter))
        .collect();
    if let Some(folder) = arguments.get(4) {
        for (index, (kind, seed)) in scenarios.iter().enumerate() {
            let scenario = unkind_worlds::planned::draw(*kind, *seed);
            println!(
                "{index} {:?} {:?} {} Hz noise {}",
                scenario.truth.hidden,
                scenario.truth.seal,
                scenario.truth.rate_hz,
                scenario.truth.noise_nm
            );
            let csv = scenario.log.csv();
            let written = std::fs::write(format!("{folder}/{index}.csv"), csv);
            assert!(written.is_ok(), "{folder}: not written");
        }
        return;
    }
    let mut grades: Vec<_> = scenarios
        .into_par_iter()
        .filter_map(|(kind, seed)| match grade_scenario(kind, seed) {
            Ok(grade) => Some(grade),
            Err(why) => {
                println!("FAILED {why}");
                None
            }
        })
        .collect();
    grades.sort_by_key(|grade| format!("{:?}", grade.kind));
    let mut by_kind: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    let (mut inside, mut sized, mut low) = (0, 0, 0);
    for grade in &grades {
        let entry = by_kind.entry(grade.kind.name()).or_default();
        entry.1 += 1;
        entry.0 += usize::from(grade.right);
        sized += usize::from(grade.size_inside.is_some());
        inside += usize::from(grade.size_inside == Some(true));
        low += usize::from(grade.error_over_noise <= 1.2);
        println!(
            "{} {:?} seed {} rows {} visible {:.2} named {:?} confusable {:?} error/noise {:.3} {:.1} s size {:?}",
            if grade.right { "ok   " } else { "WRONG" },
            grade.kind,
            grade.seed,
            grade.rows,
            grade.visible,
            grade.named,
            grade.confusable,
            grade.error_over_noise,
            grade.seconds,
            grade.sizes
        );
        if !grade.right {
            println!("      hidden {:?}; candidates {}", grade.hidden, grade.candidates);
        }
    }
    for (kind, (right, all)) in by_kind {
        println!("{kind}: {right} of {all}");
    }
    println!(
        "sizes inside {inside} of {sized}; error within 1.2 of noise {low} of {}",
        grades.len()
    );
}
