//! Coordinates of a fit, which keep parameters within their bounds.
//!
//! The optimiser itself has no bounds. A stiffness or a Stribeck velocity is represented by its logarithm, so that 1e3
//! and 1e6 are equally far from 3e4. `F_S = F_C sqrt(1 + u^2)` cannot fall below `F_C`. A parameter that cannot be
//! negative is `scale (cosh u - 1)`, which can reach 0 and is logarithmic for large values; a factor of a regressor is the
//! branch of a hyperbola, which is straight for large values. All others are their own coordinate. The change of
//! coordinates uses dual numbers, so that its derivative is exact.
//!
//! An undetermined parameter would diverge along its valley. A weak prior keeps it near the middle of its range: one row per
//! coordinate, with a width of one decade, that counts as a part of an independent observation ([`Scales::observation`]).

use super::scales::Scales;
use super::treatment::{self, Values, treatment_of};
use compensator_core::{ParameterId, Parameters, Real};

/// Coordinate of one parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Scale {
    /// `p = exp(u)`, with `u` between two logarithms.
    Logarithmic(f64, f64),
    /// `p = other sqrt(1 + u^2)`.
    NotBelow(ParameterId),
    /// `p = scale (cosh u - 1)`.
    NotNegative(f64),
    /// `p = (u + sqrt(u^2 + size^2)) / 2`.
    FactorNotNegative(f64),
    /// `p = bound u / sqrt(1 + u^2)`.
    Below(f64),
    /// `p = u`.
    Plain,
}

/// Coordinates of the free parameters of a fit; the others are constant.
#[derive(Clone, Debug)]
pub struct Coordinates {
    base: Parameters<f64>,
    free: Vec<(ParameterId, Scale)>,
    /// Centre of the prior: the middle of the range, or the start where the log has no range.
    centre: Vec<f64>,
    /// Error of an observation, Nm: the residual of the prior at one width.
    observation: f64,
}

/// Largest argument of the hyperbolic cosine, a factor of 1e17.
const MAX_COSH_ARGUMENT: f64 = 40.0;

/// Bend of the hyperbola of a factor, as a share of its typical size: far below any effect in a log.
const FACTOR_BEND: f64 = 1e-4;

/// Share of the bound beyond which a parameter that approaches it counts as at its bound.
const BOUND_SHARE: f64 = 0.98;

/// Coordinate of a typical size.
const TYPICAL_COSH: f64 = 1.317;

impl Coordinates {
    /// Creates coordinates for `free`, with every other parameter as in `base`.
    ///
    /// `scales` determine the typical size of parameters that cannot be negative, and the bounds of positive ones.
    pub fn new(base: &Parameters<f64>, free: &[ParameterId], scales: &Scales) -> Self {
        let scale = |id: ParameterId| match treatment::values(base.law, id) {
            Values::Any => Scale::Plain,
            Values::Positive(range) => {
                let (least, most) = treatment::bounds(id, range, scales);
                Scale::Logarithmic(least.ln(), most.ln())
            }
            Values::NotNegative(typical) => {
                Scale::NotNegative(typical(scales).max(f64::MIN_POSITIVE))
            }
            Values::FactorNotNegative(typical) => {
                Scale::FactorNotNegative((FACTOR_BEND * typical(scales)).max(f64::MIN_POSITIVE))
            }
            Values::Below(bound) => Scale::Below(bound),
            Values::NotBelow(other) => Scale::NotBelow(other),
        };
        let mut coordinates = Self {
            base: base.clone(),
            free: free.iter().map(|id| (*id, scale(*id))).collect(),
            centre: Vec::new(),
            observation: scales.observation,
        };
        coordinates.centre = coordinates.point(base);
        for (centre, (id, scale)) in coordinates.centre.iter_mut().zip(&coordinates.free) {
            match (treatment_of(*id).values, scale) {
                (Values::Positive(range), Scale::Logarithmic(least, most))
                    if range(scales).1.is_finite() =>
                {
                    *centre = 0.5 * (least + most);
                }
                (_, Scale::NotNegative(_)) => *centre = TYPICAL_COSH,
                (_, Scale::NotBelow(_)) => *centre = 0.0,
                _ => {}
            }
        }
        coordinates
    }

    /// Returns the error of an observation that the prior has, Nm.
    pub fn observation(&self) -> f64 {
        self.observation
    }

    /// Replaces the error of an observation, Nm.
    #[must_use]
    pub fn with_observation(self, observation: f64) -> Self {
        Self { observation, ..self }
    }

    /// Returns the rows of the prior: index of the coordinate, derivative, residual.
    pub fn prior<'a>(&'a self, point: &'a [f64]) -> impl Iterator<Item = (usize, f64, f64)> + 'a {
        self.free.iter().enumerate().filter_map(move |(index, (_, scale))| {
            let width = match scale {
                Scale::Logarithmic(..) | Scale::NotNegative(_) => std::f64::consts::LN_10,
                // F_S / F_C up to 1.8, rarely to 3.
                Scale::NotBelow(_) => 1.5,
                Scale::FactorNotNegative(_) | Scale::Below(_) | Scale::Plain => return None,
            };
            let slope = self.observation / width;
            Some((index, -slope, slope * (self.centre[index] - point[index])))
        })
    }

    /// Returns the free parameters.
    pub fn ids(&self) -> impl Iterator<Item = ParameterId> + '_ {
        self.free.iter().map(|(id, _)| *id)
    }

    /// Returns the number of free parameters.
    pub fn len(&self) -> usize {
        self.free.len()
    }

    /// Returns true if no parameter is free.
    pub fn is_empty(&self) -> bool {
        self.free.is_empty()
    }

    /// Returns the parameters at a point, in the number type of the coordinates.
    pub fn parameters<T: Real>(&self, point: &[T]) -> Parameters<T> {
        let mut parameters = self.base.convert::<T>();
        let half = T::from_f64(0.5);
        let root = |u: T| (T::one() + u * u).pow(half);
        let set = |parameters: &mut Parameters<T>, dependent: bool| {
            for ((id, scale), u) in self.free.iter().zip(point) {
                let value = match scale {
                    Scale::NotBelow(other) if dependent => parameters.get(*other) * root(*u),
                    Scale::NotBelow(_) => continue,
                    _ if dependent => continue,
                    Scale::Logarithmic(least, most) => {
                        u.at_least(T::from_f64(*least)).at_most(T::from_f64(*most)).exp()
                    }
                    Scale::NotNegative(size) => {
                        let u = u.within(T::from_f64(MAX_COSH_ARGUMENT));
                        let cosh = (u.exp() + (-u).exp()) * half;
                        T::from_f64(*size) * (cosh - T::one())
                    }
                    Scale::FactorNotNegative(size) => {
                        let size = T::from_f64(*size);
                        (*u + (*u * *u + size * size).pow(half)) * half
                    }
                    Scale::Below(bound) => T::from_f64(*bound) * *u / root(*u),
                    // Limited to its legal range, whose ends only a degenerate log reaches.
                    Scale::Plain => {
                        let info = id.info();
                        u.at_least(T::from_f64(info.lower)).at_most(T::from_f64(info.upper))
                    }
                };
                parameters.set(*id, value);
            }
        };
        set(&mut parameters, false);
        set(&mut parameters, true);
        parameters
    }

    /// Returns the point of some parameters. A value at a bound is moved slightly inside it, where the coordinate has a
    /// nonzero derivative.
    pub fn point(&self, parameters: &Parameters<f64>) -> Vec<f64> {
        let inverse_root = |ratio: f64| (ratio * ratio - 1.0).max(1e-4).sqrt();
        self.free
            .iter()
            .map(|(id, scale)| {
                let value = parameters.get(*id);
                match scale {
                    Scale::Logarithmic(least, most) => {
                        value.max(f64::MIN_POSITIVE).ln().clamp(*least, *most)
                    }
                    Scale::NotBelow(other) => {
                        inverse_root(value / parameters.get(*other).max(f64::MIN_POSITIVE))
                    }
                    Scale::NotNegative(size) => (1.0 + (value / size).max(5e-5)).acosh(),
                    Scale::FactorNotNegative(size) => {
                        let value = value.max(0.5 * size);
                        value - 0.25 * size * size / value
                    }
                    Scale::Below(bound) => {
                        let share = (value / bound).clamp(-BOUND_SHARE, BOUND_SHARE);
                        share / (1.0 - share * share).sqrt()
                    }
                    Scale::Plain => value,
                }
            })
            .collect()
    }

    /// Returns true if a coordinate is logarithmic with a prior, so that its error is relative and at most the prior's
    /// width.
    pub fn is_held_by_prior(&self, index: usize) -> bool {
        matches!(self.free[index].1, Scale::Logarithmic(..) | Scale::NotNegative(_))
    }

    /// Returns true if 0 fits best for a free parameter that is not negative.
    pub fn is_at_zero(&self, index: usize, point: &[f64]) -> bool {
        match self.free[index].1 {
            Scale::NotNegative(_) => point[index].abs() < 2e-2,
            Scale::FactorNotNegative(_) => point[index] <= 0.0,
            _ => false,
        }
    }

    /// Returns true if a free parameter is at an end of the range that is searched. There the log has a better value outside,
    /// unlike at a bound where an effect is absent.
    pub fn is_at_end(&self, index: usize, point: &[f64], parameters: &Parameters<f64>) -> bool {
        let is_absent = match self.free[index].1 {
            Scale::NotBelow(_) => point[index].abs() < 2e-2,
            _ => self.is_at_zero(index, point),
        };
        !is_absent && self.is_at_bound(index, point, parameters)
    }

    /// Returns true if a free parameter is at a bound of its coordinate or of its legal range.
    pub fn is_at_bound(&self, index: usize, point: &[f64], parameters: &Parameters<f64>) -> bool {
        let (id, scale) = self.free[index];
        let value = parameters.get(id);
        let info = id.info();
        let coordinate = match scale {
            _ if self.is_at_zero(index, point) => true,
            Scale::NotBelow(_) => point[index].abs() < 2e-2,
            Scale::Below(bound) => value.abs() > BOUND_SHARE * bound,
            // Within one percent, because a bound is approached but rarely reached.
            Scale::Logarithmic(least, most) => {
                point[index] < least + 0.01 || point[index] > most - 0.01
            }
            _ => false,
        };
        // Values at the end of the legal range are moved inside it by a rounding.
        let rounding = |bound: f64| 2e-6 * bound.abs();
        let (least, most) = (info.lower + rounding(info.lower), info.upper - rounding(info.upper));
        coordinate || value <= least || value >= most
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ParameterId as Id;
    use compensator_core::LawKind;

    const SCALES: Scales = Scales {
        speed: 1.0,
        torque: 2.0,
        slow_speed: 0.01,
        acceleration: 1.0,
        travel: 3.0,
        swing: 1.0,
        campaign_s: 100.0,
        temperature_c: 20.0,
        noise: 0.01,
        observation: 0.01,
        period_s: 1e-3,
    };

    #[test]
    fn parameters_of_point_equal_original_parameters() {
        let base = Parameters::<f64>::new(LawKind::Lugre)
            .with(Id::CoulombTorque, 1.5)
            .with(Id::StaticTorque, 2.2)
            .with(Id::StribeckVelocity, 0.07)
            .with(Id::BristleStiffness, 3e4)
            .with(Id::BristleDamping, 12.0)
            .with(Id::ViscousFriction, 0.3);
        let free: Vec<_> = LawKind::Lugre.parameters().to_vec();
        let coordinates = Coordinates::new(&base, &free, &SCALES);
        let back: Parameters<f64> = coordinates.parameters(&coordinates.point(&base));
        for id in free {
            assert!((back.get(id) / base.get(id) - 1.0).abs() < 1e-12, "{}", id.name());
        }
    }

    #[test]
    fn parameters_of_any_point_are_within_bounds() {
        let base = Parameters::<f64>::new(LawKind::Lugre);
        let coordinates = Coordinates::new(&base, LawKind::Lugre.parameters(), &SCALES);
        for size in [-1e9, -3.0, 0.0, 1e-9, 3.0, 1e9] {
            let parameters: Parameters<f64> = coordinates.parameters(&[size; 6]);
            assert!(parameters.get(Id::CoulombTorque) > 0.0);
            assert!(parameters.get(Id::StaticTorque) >= parameters.get(Id::CoulombTorque));
            assert!(parameters.get(Id::BristleDamping) >= 0.0);
            assert!(parameters.get(Id::ViscousFriction) >= 0.0);
        }
    }
}
