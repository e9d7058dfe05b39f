//! Search for the largest permitted spreads (Ding et al., eq. 4-5): of one parameter alone, then of all together.
//!
//! `P0`, the (1 - alpha) quantile of the violation probability over `n` sampled vectors, is at most `rho` exactly if
//! enough of the vectors are. A parameter *alone* defines a line through the fitted vector. Its two limits determine the
//! result for all vectors, so that the cost does not depend on `n`. For all parameters *together*, the trace of eq. 5
//! has its maximum in a corner, where the least determined parameter takes the whole allowance. The constant ratios
//! between the columns of the paper's Table III show a search along a ray. This search does the same: it scales the
//! spreads found alone by the largest permitted common share.

use super::draw::{Draws, TRUNCATION_SIGMAS, varied};
use super::ensemble::Ensemble;
use super::levels::Levels;
use compensator_core::{ParameterId, Parameters};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Smallest deviation of the search, as a logarithm; a smaller one counts as 0.
const MIN_DEVIATION: f64 = 1e-4;

/// Bisections of the logarithm of a deviation: a resolution of 2 % between 1e-4 and 2.
const BISECTIONS: usize = 9;

/// Bisections of the common share: a resolution of 1 %.
const SHARE_BISECTIONS: usize = 7;

/// Search in one speed class.
pub struct SpreadSearch<'a> {
    /// Trials and ranges of the class.
    pub ensemble: &'a Ensemble<'a>,
    /// The fitted parameters.
    pub parameters: &'a Parameters<f64>,
    /// Parameters that vary.
    pub ids: &'a [ParameterId],
    /// Random numbers of the vectors.
    pub draws: &'a Draws,
    /// Required confidence and accuracy.
    pub levels: Levels,
    /// Largest spread of the search.
    pub max_spread: f64,
}

impl SpreadSearch<'_> {
    fn permits(&self, logarithms: &[(ParameterId, f64)]) -> bool {
        self.ensemble.permits(&varied(self.parameters, logarithms), self.levels.rho)
    }

    /// Returns the largest permitted deviation of one parameter alone to one side (`sign` is 1 or -1), as a logarithm. It is
    /// infinite if every deviation is permitted, and 0 if none is.
    pub fn limit(&self, id: ParameterId, sign: f64) -> f64 {
        let permits = |deviation: f64| self.permits(&[(id, sign * deviation)]);
        let (mut good, mut bad) = (MIN_DEVIATION, TRUNCATION_SIGMAS * self.max_spread);
        if permits(bad) {
            return f64::INFINITY;
        }
        if !permits(good) {
            return 0.0;
        }
        for _ in 0..BISECTIONS {
            let middle = (good * bad).sqrt();
            if permits(middle) { good = middle } else { bad = middle }
        }
        good
    }

    /// Returns the largest spread of a parameter alone, from its lower and upper limits.
    pub fn spread(&self, below: f64, above: f64) -> f64 {
        let alone = &self.draws.alone;
        let mut largest: Vec<f64> = alone
            .iter()
            .map(|z| (if *z < 0.0 { below } else { above } / z.abs()).min(self.max_spread))
            .collect();
        // Each vector permits spreads up to its own value; the required number of vectors must permit the result.
        largest.sort_by(|a, b| b.total_cmp(a));
        let rank = self.levels.required_passing_vectors(alone.len());
        largest.get(rank - 1).copied().unwrap_or(0.0)
    }

    fn vector(&self, spreads: &[f64], share: f64, z: &[f64]) -> Vec<(ParameterId, f64)> {
        let logarithm = |((id, spread), z): ((&ParameterId, &f64), &f64)| (*id, share * spread * z);
        self.ids.iter().zip(spreads).zip(z).map(logarithm).collect()
    }

    /// Returns true if all parameters may vary together with this share of their spreads.
    fn permits_together(&self, spreads: &[f64], share: f64) -> bool {
        let vectors = &self.draws.vectors;
        let may_fail = vectors.len() - self.levels.required_passing_vectors(vectors.len());
        let failed = AtomicUsize::new(0);
        vectors.par_iter().for_each(|z| {
            let settled = failed.load(Ordering::Relaxed) > may_fail;
            if !settled && !self.permits(&self.vector(spreads, share, z)) {
                failed.fetch_add(1, Ordering::Relaxed);
            }
        });
        failed.into_inner() <= may_fail
    }

    /// Returns the largest permitted common share of the spreads found alone.
    pub fn share(&self, spreads: &[f64]) -> f64 {
        if self.permits_together(spreads, 1.0) {
            return 1.0;
        }
        let (mut good, mut bad) = (0.0, 1.0);
        for _ in 0..SHARE_BISECTIONS {
            let middle = 0.5 * (good + bad);
            if self.permits_together(spreads, middle) { good = middle } else { bad = middle }
        }
        good
    }

    /// Returns the violation probability of every sampled vector, ascending.
    pub fn violations(&self, spreads: &[f64], share: f64) -> Vec<f64> {
        let of = |z: &Vec<f64>| {
            let vector = varied(self.parameters, &self.vector(spreads, share, z));
            self.ensemble.violation(&vector)
        };
        let mut violations: Vec<f64> = self.draws.vectors.par_iter().map(of).collect();
        violations.sort_by(f64::total_cmp);
        violations
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MAX_CV;
    use crate::draw::spread_at;
    use crate::range::Ranges;
    use crate::trials::Trials;
    use ParameterId as Id;
    use compensator_core::{LawKind, Sample};
    use friction_fit::{Resolution, Track};

    /// A joint that slides at 2 rad/s under Coulomb and viscous friction of 1 Nm each.
    fn sliding() -> (Parameters<f64>, Track) {
        let sample = Sample { velocity_rad_s: 2.0, ..Sample::default() };
        let track = Track::even(vec![sample; 1000], vec![2.0; 1000], 0.01);
        let parameters = Parameters::new(LawKind::Lugre).with(Id::ViscousFriction, 0.5);
        (parameters, track)
    }

    fn with_search(levels: Levels, check: impl Fn(&SpreadSearch)) {
        let (parameters, track) = sliding();
        let trials = Trials::new(&parameters, &[&track], 50, 100, Resolution::PLAIN, 0);
        // 0.5 Nm to either side.
        let ranges = Ranges::new([(2.0, -0.5), (2.0, 0.5)].into_iter(), 50);
        let ensemble = Ensemble::new(&trials, &ranges, 50);
        let ids = [Id::CoulombTorque, Id::ViscousFriction, Id::BristleStiffness];
        let draws = Draws::new(1, &ids, levels.counts().sampled_vectors);
        check(&SpreadSearch {
            ensemble: &ensemble,
            parameters: &parameters,
            ids: &ids,
            draws: &draws,
            levels,
            max_spread: spread_at(MAX_CV),
        });
    }

    #[test]
    fn limit_is_where_torque_leaves_range() {
        with_search(Levels::default(), |search| {
            for id in [Id::CoulombTorque, Id::ViscousFriction] {
                assert!((search.limit(id, 1.0) / 1.5f64.ln() - 1.0).abs() < 0.025);
                assert!((search.limit(id, -1.0) / 2f64.ln() - 1.0).abs() < 0.025);
            }
            // In steady sliding the stiffness does not reach the torque at all.
            assert_eq!(search.limit(Id::BristleStiffness, 1.0), f64::INFINITY);
            assert_eq!(search.spread(f64::INFINITY, f64::INFINITY), search.max_spread);
        });
    }

    #[test]
    fn spread_alone_matches_sampled_vectors() {
        let levels = Levels { alpha: 0.1, delta: 0.05, ..Levels::default() };
        with_search(levels, |search| {
            let (below, above) =
                (search.limit(Id::CoulombTorque, -1.0), search.limit(Id::CoulombTorque, 1.0));
            let spread = search.spread(below, above);
            let passing = |spread: f64| {
                let permits = |z: &&f64| search.permits(&[(Id::CoulombTorque, spread * **z)]);
                search.draws.alone.iter().filter(permits).count()
            };
            let must = levels.required_passing_vectors(search.draws.alone.len());
            assert!(passing(0.97 * spread) >= must, "{spread}");
            assert!(passing(1.03 * spread) < must, "{spread}");
        });
    }

    #[test]
    fn share_is_largest_with_valid_certificate() {
        with_search(Levels { alpha: 0.1, delta: 0.05, ..Levels::default() }, |search| {
            let spreads = [0.3, 0.4, 0.8];
            let share = search.share(&spreads);
            assert!((0.2..0.95).contains(&share), "{share}");
            let quantile = |share: f64| {
                let violations = search.violations(&spreads, share);
                violations[search.levels.required_passing_vectors(violations.len()) - 1]
            };
            assert!(quantile(share) <= search.levels.rho);
            assert!(quantile(share + 0.01) > search.levels.rho);
        });
    }
}
