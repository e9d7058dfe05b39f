//! Evidence that the learnt level follows a quantity which the model does not use.
//!
//! A level that rises with pressure is better modelled by a term of the pressure than learnt anew at each depth. This module
//! keeps a few sums of the learnt level and of each quantity. The share of the level's variance that a straight line over
//! the quantity explains is the evidence. Time is one of the quantities: a level that only drifts follows time better
//! than a sensor that happens to drift too.

use crate::number::Real;
use crate::parameters::Parameters;
use crate::quantity::Quantity;

/// Quantities that are compared, in the order of their numbers from 1.
pub const FOLLOWED: [Quantity; 3] =
    [Quantity::Pressure, Quantity::RadialForce, Quantity::Temperature];

/// Candidates: these quantities and time.
const CANDIDATES: usize = FOLLOWED.len() + 1;

/// Time from one pair of values to the next, s of sliding. It is twice the memory of the regression at its default, so that
/// pairs are nearly independent.
const INTERVAL_S: f32 = 20.0;

/// Share of the sums that a new pair replaces: the memory is about an hour of sliding.
const FORGOTTEN: f32 = 1.0 / 180.0;

/// Pairs before the evidence is reported.
const LEAST_PAIRS: f32 = 12.0;

/// Least standard deviation of the level that needs an explanation.
const LEAST_DEVIATION: f32 = 0.03;

/// Least share of the variance that a quantity has to explain.
const LEAST_SHARE: f32 = 0.7;

/// Share by which a quantity has to explain more of the variance than time does.
const LEAST_MARGIN: f32 = 0.1;

/// Weighted mean and central sum of squares of one variable (Welford).
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    mean: f32,
    square: f32,
}

impl Moments {
    /// Takes a value with this share of the weights. Returns its distance from the mean before and after.
    fn take(&mut self, value: f32, share: f32) -> [f32; 2] {
        let before = value - self.mean;
        self.mean += share * before;
        let after = value - self.mean;
        self.square = (1.0 - FORGOTTEN) * self.square + before * after;
        [before, after]
    }
}

/// Sums of pairs of a quantity and the level.
#[derive(Clone, Copy, Debug, Default)]
struct PairSums {
    weight: f32,
    quantity: Moments,
    level: Moments,
    product: f32,
}

impl PairSums {
    fn take(&mut self, quantity: f32, level: f32) {
        self.weight = (1.0 - FORGOTTEN) * self.weight + 1.0;
        let share = 1.0 / self.weight;
        let [quantity_before, _] = self.quantity.take(quantity, share);
        let [_, level_after] = self.level.take(level, share);
        self.product = (1.0 - FORGOTTEN) * self.product + quantity_before * level_after;
    }

    /// Returns the share of the level's variance that a line over the quantity explains; 0 if unknown.
    fn share(&self) -> f32 {
        let (quantity, level) = (self.quantity.square, self.level.square);
        let is_enough = self.weight >= LEAST_PAIRS && quantity > 0.0;
        let variance = level / self.weight.at_least(1.0);
        if !is_enough || variance < LEAST_DEVIATION * LEAST_DEVIATION {
            return 0.0;
        }
        // Divided twice, because the product of the squares may overflow.
        (self.product / quantity * (self.product / level)).at_most(1.0)
    }
}

/// A quantity that the level follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FollowedQuantity {
    /// The quantity.
    pub quantity: Quantity,
    /// Share of the level's variance that it explains, 0..=1.
    pub share: f32,
}

/// The sums of one joint.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Evidence {
    sums: [PairSums; CANDIDATES],
    waited_s: f32,
    time: f32,
}

impl Evidence {
    /// Takes the level after some time of sliding, s, with the present quantities.
    pub fn step(&mut self, level: f32, quantities: &[Option<f32>; FOLLOWED.len()], slid_s: f32) {
        self.waited_s += slid_s;
        if self.waited_s < INTERVAL_S {
            return;
        }
        self.waited_s = 0.0;
        self.time += 1.0;
        let values = quantities.iter().copied().chain([Some(self.time)]);
        for (sums, value) in self.sums.iter_mut().zip(values) {
            if let Some(value) = value.filter(|value| value.is_finite()) {
                sums.take(value, level);
            }
        }
    }

    /// Returns the quantity that the level follows most, unless the model uses it or time explains as much.
    pub fn followed(&self, written: &Parameters<f32>) -> Option<FollowedQuantity> {
        let by_time = self.sums.last().map_or(0.0, PairSums::share);
        let mut best: Option<FollowedQuantity> = None;
        for (sums, quantity) in self.sums.iter().zip(FOLLOWED) {
            let share = sums.share();
            if share > best.map_or(0.0, |best| best.share) && !uses(written, quantity) {
                best = Some(FollowedQuantity { quantity, share });
            }
        }
        best.filter(|best| best.share >= LEAST_SHARE && best.share >= by_time + LEAST_MARGIN)
    }
}

/// Returns true if the levels of a model depend on a quantity.
fn uses(written: &Parameters<f32>, quantity: Quantity) -> bool {
    let is_load = matches!(quantity, Quantity::Pressure | Quantity::RadialForce);
    let by_term = written.terms.iter().any(|kind| kind.reads() == Some(quantity));
    by_term || is_load && written.law.has_seal_load()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::LawKind;

    /// Level and quantities over an hour.
    fn evidence(level: impl Fn(f32) -> f32, pressure: impl Fn(f32) -> f32) -> Evidence {
        let mut evidence = Evidence::default();
        for step in 0..180 {
            let time_h = step as f32 / 180.0;
            let quantities = [Some(pressure(time_h)), None, Some(f32::NAN)];
            evidence.step(level(time_h), &quantities, INTERVAL_S);
        }
        evidence
    }

    #[test]
    fn followed_of_level_over_pressure_is_pressure() {
        let dives = |time_h: f32| libm::sinf(20.0 * time_h);
        let evidence = evidence(|time_h| 1.0 + 0.2 * dives(time_h), dives);
        let followed = evidence.followed(&Parameters::new(LawKind::Lugre)).unwrap();
        assert_eq!(followed.quantity, Quantity::Pressure);
        assert!(followed.share > 0.99, "{followed:?}");
        assert_eq!(evidence.followed(&Parameters::new(LawKind::ImprovedLugre)), None, "it is used");
    }

    #[test]
    fn followed_of_steady_or_drifting_level_is_none() {
        let dives = |time_h: f32| libm::sinf(20.0 * time_h);
        let plain = Parameters::new(LawKind::Lugre);
        assert_eq!(evidence(|_| 1.0, dives).followed(&plain), None);
        assert_eq!(evidence(|time_h| 1.0 + 0.3 * time_h, dives).followed(&plain), None);
        // The sensor drifts too.
        let drift = evidence(|time_h| 1.0 + 0.3 * time_h, |time_h| 2.0 * time_h);
        assert_eq!(drift.followed(&plain), None);
    }
}
