//! The largest permitted spreads (Ding et al., eq. 4-5): one parameter alone, then all together.
//!
//! `P0`, the (1 - alpha) quantile of the violation probability over `n` sampled vectors, is at most
//! `rho` exactly if enough of the vectors are. *Alone*, a parameter is a line through the fitted vector:
//! where the line leaves the permitted set on either side settles it for every vector at once, so `n` costs
//! nothing. *Together*, the trace of eq. 5 has its maximum in a corner: whatever the data determine least
//! takes the whole allowance and leaves nothing for the others. As the constant ratios between the
//! columns of the paper's Table III show it went along a ray, so do we: the spreads alone, times the
//! largest common share that is permitted.

use super::draw::{Draws, END, varied};
use super::ensemble::Ensemble;
use super::levels::Levels;
use compensator_core::{ParameterId, Parameters};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Smallest deviation that is tried, as a logarithm; less counts as none.
const SMALLEST: f64 = 1e-4;

/// Halvings of the logarithm of a deviation: 2 % from 1e-4 to 2.
const HALVINGS: usize = 9;

/// Halvings of the common share: a hundredth.
const SHARE_HALVINGS: usize = 7;

/// A search in one speed class.
pub struct Search<'a> {
    /// What is violated.
    pub ensemble: &'a Ensemble<'a>,
    /// The fitted parameters.
    pub parameters: &'a Parameters<f64>,
    /// Those that vary.
    pub ids: &'a [ParameterId],
    /// How they are drawn.
    pub draws: &'a Draws,
    /// What must hold.
    pub levels: Levels,
    /// No spread is larger than this.
    pub spread_most: f64,
}

impl Search<'_> {
    fn permits(&self, logarithms: &[(ParameterId, f64)]) -> bool {
        self.ensemble.permits(&varied(self.parameters, logarithms), self.levels.rho)
    }

    /// How far a parameter alone may deviate to one side (`sign` is 1 or -1), as a logarithm;
    /// infinite where nothing stops it, 0 where nothing is permitted.
    pub fn limit(&self, id: ParameterId, sign: f64) -> f64 {
        let permits = |deviation: f64| self.permits(&[(id, sign * deviation)]);
        let (mut good, mut bad) = (SMALLEST, END * self.spread_most);
        if permits(bad) {
            return f64::INFINITY;
        }
        if !permits(good) {
            return 0.0;
        }
        for _ in 0..HALVINGS {
            let middle = (good * bad).sqrt();
            if permits(middle) { good = middle } else { bad = middle }
        }
        good
    }

    /// The largest spread of a parameter alone, from its limits below and above.
    pub fn spread(&self, below: f64, above: f64) -> f64 {
        let alone = self.draws.alone();
        let mut largest: Vec<f64> = alone
            .iter()
            .map(|z| (if *z < 0.0 { below } else { above } / z.abs()).min(self.spread_most))
            .collect();
        // Each vector permits spreads up to its own; that many must permit it at once.
        largest.sort_by(|a, b| b.total_cmp(a));
        let rank = self.levels.vectors_that_must_pass(alone.len());
        largest.get(rank - 1).copied().unwrap_or(0.0)
    }

    fn vector(&self, spreads: &[f64], share: f64, z: &[f64]) -> Vec<(ParameterId, f64)> {
        let logarithm = |((id, spread), z): ((&ParameterId, &f64), &f64)| (*id, share * spread * z);
        self.ids.iter().zip(spreads).zip(z).map(logarithm).collect()
    }

    /// Whether all parameters may vary together with this share of their spreads.
    fn permits_together(&self, spreads: &[f64], share: f64) -> bool {
        let vectors = self.draws.vectors();
        let may_fail = vectors.len() - self.levels.vectors_that_must_pass(vectors.len());
        let failed = AtomicUsize::new(0);
        vectors.par_iter().for_each(|z| {
            let settled = failed.load(Ordering::Relaxed) > may_fail;
            if !settled && !self.permits(&self.vector(spreads, share, z)) {
                failed.fetch_add(1, Ordering::Relaxed);
            }
        });
        failed.into_inner() <= may_fail
    }

    /// The largest share of the spreads alone that all parameters may have together.
    pub fn share(&self, spreads: &[f64]) -> f64 {
        if self.permits_together(spreads, 1.0) {
            return 1.0;
        }
        let (mut good, mut bad) = (0.0, 1.0);
        for _ in 0..SHARE_HALVINGS {
            let middle = 0.5 * (good + bad);
            if self.permits_together(spreads, middle) { good = middle } else { bad = middle }
        }
        good
    }

    /// Violation probability of every sampled vector, ascending: the certificate itself.
    pub fn violations(&self, spreads: &[f64], share: f64) -> Vec<f64> {
        let of = |z: &Vec<f64>| {
            let vector = varied(self.parameters, &self.vector(spreads, share, z));
            self.ensemble.violation(&vector)
        };
        let mut violations: Vec<f64> = self.draws.vectors().par_iter().map(of).collect();
        violations.sort_by(f64::total_cmp);
        violations
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::{Resolution, Track};
    use crate::stochastic::CV_MOST;
    use crate::stochastic::draw::spread_at;
    use crate::stochastic::range::Ranges;
    use crate::stochastic::trials::Trials;
    use ParameterId as Id;
    use compensator_core::{LawKind, Sample};

    /// A joint that slides at 2 rad/s under Coulomb and viscous friction of 1 Nm each.
    fn sliding() -> (Parameters<f64>, Track) {
        let sample = Sample { velocity_rad_s: 2.0, ..Sample::default() };
        let track = Track::even(vec![sample; 1000], vec![2.0; 1000], 0.01);
        let parameters = Parameters::new(LawKind::Lugre).with(Id::ViscousFriction, 0.5);
        (parameters, track)
    }

    fn with_search(levels: Levels, check: impl Fn(&Search)) {
        let (parameters, track) = sliding();
        let trials = Trials::new(&parameters, &[&track], 50, 100, Resolution::PLAIN, 0);
        // 0.5 Nm to either side.
        let ranges = Ranges::new([(2.0, -0.5), (2.0, 0.5)].into_iter(), 50);
        let ensemble = Ensemble::new(&trials, &ranges, 50);
        let ids = [Id::CoulombTorque, Id::ViscousFriction, Id::BristleStiffness];
        let draws = Draws::new(1, &ids, levels.counts().sampled_vectors);
        check(&Search {
            ensemble: &ensemble,
            parameters: &parameters,
            ids: &ids,
            draws: &draws,
            levels,
            spread_most: spread_at(CV_MOST),
        });
    }

    #[test]
    fn limits_are_where_the_torque_leaves_the_range() {
        with_search(Levels::default(), |search| {
            for id in [Id::CoulombTorque, Id::ViscousFriction] {
                assert!((search.limit(id, 1.0) / 1.5f64.ln() - 1.0).abs() < 0.025);
                assert!((search.limit(id, -1.0) / 2f64.ln() - 1.0).abs() < 0.025);
            }
            // In steady sliding the stiffness does not reach the torque at all.
            assert_eq!(search.limit(Id::BristleStiffness, 1.0), f64::INFINITY);
            assert_eq!(search.spread(f64::INFINITY, f64::INFINITY), search.spread_most);
        });
    }

    #[test]
    fn a_spread_alone_is_what_sampling_vectors_would_find() {
        let levels = Levels { alpha: 0.1, delta: 0.05, ..Levels::default() };
        with_search(levels, |search| {
            let (below, above) =
                (search.limit(Id::CoulombTorque, -1.0), search.limit(Id::CoulombTorque, 1.0));
            let spread = search.spread(below, above);
            let passing = |spread: f64| {
                let permits = |z: &&f64| search.permits(&[(Id::CoulombTorque, spread * **z)]);
                search.draws.alone().iter().filter(permits).count()
            };
            let must = levels.vectors_that_must_pass(search.draws.alone().len());
            assert!(passing(0.97 * spread) >= must, "{spread}");
            assert!(passing(1.03 * spread) < must, "{spread}");
        });
    }

    #[test]
    fn together_the_certificate_holds_and_no_more_would() {
        with_search(Levels { alpha: 0.1, delta: 0.05, ..Levels::default() }, |search| {
            let spreads = [0.3, 0.4, 0.8];
            let share = search.share(&spreads);
            assert!((0.2..0.95).contains(&share), "{share}");
            let quantile = |share: f64| {
                let violations = search.violations(&spreads, share);
                violations[search.levels.vectors_that_must_pass(violations.len()) - 1]
            };
            assert!(quantile(share) <= search.levels.rho);
            assert!(quantile(share + 0.01) > search.levels.rho);
        });
    }
}
