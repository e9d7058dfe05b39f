//! Hides an effect in a measured log.
//!
//! Simulated worlds contain sensors and friction that were programmed; a measured log has its own. Here a friction effect that
//! follows a covariate is added to the torque of a real machine. The effect uses an elastic sign (a stop operator, no law of
//! the core) over a random travel. The covariate is logged with it: a level for each run and a slow variation within.
//!
//! The diagnosis must name this cause besides those of the machine. A decoy is such a column without an effect, and must not
//! be named.

use super::stop_operator::{displacements, stop};
use joint_log::{Dataset, Quantity, Run};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// An effect to hide.
#[derive(Clone, Copy, Debug)]
pub struct PlantedEffect {
    /// The cause; `None` for a decoy.
    pub cause: Option<&'static str>,
    /// The covariate that the effect follows.
    pub covariate: Quantity,
    /// Range of the covariate, in its contract unit.
    range: [f64; 2],
    /// Unscaled torque for a covariate from -0.5 to 0.5, an elastic sign, and a velocity.
    shape: fn(f64, f64, f64) -> f64,
}

/// All effects.
pub const PLANTED_EFFECTS: [PlantedEffect; 5] = [
    PlantedEffect {
        cause: None,
        covariate: Quantity::Pressure,
        range: [1e5, 7e5],
        shape: |_, _, _| 0.0,
    },
    PlantedEffect {
        cause: Some("pressure-coulomb"),
        covariate: Quantity::Pressure,
        range: [1e5, 7e5],
        shape: |of, sign, _| of * sign,
    },
    PlantedEffect {
        cause: Some("radial-force-coulomb"),
        covariate: Quantity::RadialForce,
        range: [0.0, 200.0],
        shape: |of, sign, _| of * sign,
    },
    PlantedEffect {
        cause: Some("temperature-coulomb"),
        covariate: Quantity::Temperature,
        range: [10.0, 40.0],
        shape: |of, sign, _| -of * sign,
    },
    PlantedEffect {
        cause: Some("temperature-viscous"),
        covariate: Quantity::Temperature,
        range: [10.0, 40.0],
        shape: |of, _, velocity| -of * velocity,
    },
];

/// Range of the elastic sign's travel as a share of the median run's stroke; its logarithm is uniform.
const TRAVEL_RANGE: [f64; 2] = [1e-3, 2e-2];

/// Variation of the covariate within a run, as a share of that between runs.
const COVARIATE_WANDER_SHARE: f64 = 0.4;

impl PlantedEffect {
    /// Hides the effect with this RMS, in the unit of the torque, drawn from a seed. Replaces an existing column of the covariate.
    pub fn hide(&self, data: &mut Dataset, rms: f64, seed: u64) {
        let mut random = Pcg64::seed_from_u64(seed);
        let travel = median_stroke(data)
            * TRAVEL_RANGE[0]
            * (TRAVEL_RANGE[1] / TRAVEL_RANGE[0]).powf(random.random());
        let covariates: Vec<Vec<f64>> =
            data.runs.iter().map(|run| draw_covariate(run, &mut random)).collect();
        let all = || covariates.iter().flatten();
        let least = all().copied().fold(f64::INFINITY, f64::min);
        let span =
            (all().copied().fold(f64::NEG_INFINITY, f64::max) - least).max(f64::MIN_POSITIVE);
        let middle = all().map(|value| (value - least) / span).sum::<f64>() / all().count() as f64;
        let mut effects: Vec<Vec<f64>> = Vec::new();
        for (run, covariate) in data.runs.iter_mut().zip(&covariates) {
            let of: Vec<f64> = covariate.iter().map(|value| (value - least) / span).collect();
            let signs = stop(&displacements(run), travel, 0.0);
            let rows = of.iter().zip(signs).zip(&run.velocity);
            effects.push(
                rows.map(|((of, sign), velocity)| (self.shape)(of - middle, sign, *velocity))
                    .collect(),
            );
            let [low, high] = self.range;
            run.set(self.covariate, of.iter().map(|of| low + (high - low) * of).collect());
        }
        let squares: f64 = effects.iter().flatten().map(|torque| torque * torque).sum();
        let rows = effects.iter().flatten().count() as f64;
        let scale = if squares > 0.0 { rms / (squares / rows).sqrt() } else { 0.0 };
        for (run, effect) in data.runs.iter_mut().zip(&effects) {
            let hidden =
                run.torque.iter().zip(effect).map(|(torque, effect)| torque + scale * effect);
            run.torque = hidden.collect();
        }
    }
}

/// Returns a random level with a slow variation.
fn draw_covariate(run: &Run, random: &mut Pcg64) -> Vec<f64> {
    let level: f64 = random.random();
    let waves: Vec<(f64, f64, f64)> = (1..=5u32)
        .map(|count| {
            let count = f64::from(count);
            (count, (2.0 * random.random::<f64>() - 1.0) / count, random.random())
        })
        .collect();
    let (begin, last) = (run.time_s[0], run.time_s[run.len() - 1]);
    let duration_s = (last - begin).max(f64::MIN_POSITIVE);
    let at = |time_s: &f64| {
        let part = (time_s - begin) / duration_s;
        let wave =
            |(count, size, phase): &(f64, f64, f64)| size * (TAU * (count * part + phase)).sin();
        level + COVARIATE_WANDER_SHARE * waves.iter().map(wave).sum::<f64>()
    };
    run.time_s.iter().map(at).collect()
}

fn median_stroke(data: &Dataset) -> f64 {
    let stroke = |run: &Run| {
        let (mut at, mut low, mut high) = (0.0f64, 0.0f64, 0.0f64);
        for step in displacements(run) {
            at += step;
            (low, high) = (low.min(at), high.max(at));
        }
        high - low
    };
    let mut strokes: Vec<f64> = data.runs.iter().map(stroke).collect();
    strokes.sort_by(f64::total_cmp);
    strokes[strokes.len() / 2]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log() -> Dataset {
        let names = ["time_s", "velocity_rad_s", "torque_nm"].map(str::to_owned);
        let runs = (0..3).map(|run| {
            let time: Vec<f64> = (0..400).map(|row| f64::from(row) * 0.01).collect();
            let velocity = time.iter().map(|time| (3.0 * time).sin()).collect();
            (run.to_string(), vec![time, velocity, vec![0.0; 400]])
        });
        Dataset::from_columns(&names, runs).expect("the columns of a log")
    }

    #[test]
    fn hidden_effect_has_requested_rms_and_covariate_range() {
        for planted in PLANTED_EFFECTS {
            let mut data = log();
            planted.hide(&mut data, 0.3, 7);
            let torques: Vec<f64> = data.runs.iter().flat_map(|run| run.torque.clone()).collect();
            let rms = (torques.iter().map(|t| t * t).sum::<f64>() / torques.len() as f64).sqrt();
            let wanted = if planted.cause.is_some() { 0.3 } else { 0.0 };
            assert!((rms - wanted).abs() < 1e-9, "{planted:?}: {rms}");
            let [low, high] = planted.range;
            let column =
                data.runs.iter().flat_map(|run| run.get(planted.covariate).expect("logged"));
            let (least, most) = column
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| {
                    (least.min(*value), most.max(*value))
                });
            assert!((least - low).abs() < 1e-6 * high && (most - high).abs() < 1e-6 * high);
        }
    }
}
