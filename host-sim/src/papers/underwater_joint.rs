//! Ding et al.: the underwater joint, repeated on a simulated one with the shipped driver in the loop.

mod arms;
mod campaign;
mod tasks;

use super::{Outcome, Paper, Request};
use campaign::Campaign;
use simulated_machines::joint_plant::bench::Amount;
use simulated_machines::joint_plant::{Bench, Parameters};
use tasks::{Conditions, Task};

/// The paper.
pub struct UnderwaterJoint;

impl Paper for UnderwaterJoint {
    fn name(&self) -> &'static str {
        "underwater-joint"
    }

    fn about(&self) -> &'static str {
        "The improved LuGre model of a sealed underwater joint (Ding et al.), on a simulated joint"
    }

    fn title(&self) -> &'static str {
        "The underwater joint of Ding et al., simulated"
    }

    fn run(&self, request: &Request) -> Result<Outcome, String> {
        let begin = std::time::Instant::now();
        let p = Parameters::default();
        let amount = Amount { learned: 2, held_out: 4, seconds: 6.0, both_motions: false };
        let bench = Bench { parameters: p, phase_rad: [0.7, 2.1], seed: request.seed };
        let campaign = Campaign::measure(&bench, &amount);
        eprintln!("campaign {:?} rows {}", begin.elapsed(), campaign.all.rows);
        let (arms, diagnosis) = arms::arms(&campaign)?;
        eprintln!("arms {:?}; diagnosis {:.1} s", begin.elapsed(), diagnosis.seconds);
        for f in &diagnosis.findings {
            eprintln!("  {} {:?} {:?}", f.cause.name(), f.columns, f.in_words); } for n in diagnosis.log.notes.iter().take(12) { eprintln!("  note {n}");
        }
        eprintln!(
            "base {} ext {} rmse {} -> {} floor {}",
            diagnosis.baseline.spec,
            diagnosis.extended.spec,
            diagnosis.baseline.test.rmse,
            diagnosis.extended.test.rmse,
            diagnosis.noise_floor
        );
        for arm in &arms {
            if let Some(fit) = &arm.fit {
                eprintln!(
                    "{} {} {:.1}s rmse {:.4}",
                    arm.name, fit.spec, fit.seconds, fit.train.rmse
                );
                for e in &fit.estimates {
                    eprintln!("   {} {:.5} {}", e.id.info().name, e.value, e.state.name());
                }
                for v in &fit.verdicts {
                    eprintln!("   - {v}");
                }
            }
        }
        for task in [Task::VelocityTracking, Task::LowSpeed, Task::Impact] {
            for arm in &arms {
                let start = std::time::Instant::now();
                let c = Conditions {
                    parameters: p,
                    phase_rad: [0.7, 2.1],
                    faults: Default::default(),
                    temperature_c: 20.0,
                    wear: 1.0,
                    seed: 1,
                };
                let course = match tasks::run(task, arm, &c) {
                    Ok(c) => c,
                    Err(e) => {
                        eprintln!("{task:?} {}: {e}", arm.name);
                        continue;
                    }
                };
                let n = course.time_s.len() as f64;
                let e: f64 = course
                    .velocity_rad_s
                    .iter()
                    .zip(&course.wanted_rad_s)
                    .map(|(a, b)| (a - b).abs())
                    .sum::<f64>()
                    / n;
                let top = course.position_rad.iter().copied().fold(f64::MIN, f64::max);
                let reach =
                    course.position_rad.iter().position(|q| (q - tasks::TARGET_RAD).abs() < 0.02);
                eprintln!(
                    "{task:?} {}: mean |e| {e:.5} rad/s, top {top:.3}, reach {reach:?} stopped {} oob {} in {:?} ({:.0}x)",
                    arm.name,
                    course.stopped,
                    course.out_of_band,
                    start.elapsed(),
                    course.time_s.len() as f64 * 1e-3 / start.elapsed().as_secs_f64()
                );
            }
        }
        Ok(Outcome::default())
    }
}
