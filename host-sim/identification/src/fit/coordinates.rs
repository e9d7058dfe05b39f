//! The coordinates a fit moves in.
//!
//! An optimiser without bounds is simple and well kept; bounds are brought in by coordinates that
//! cannot leave them. A stiffness or a Stribeck velocity moves by its logarithm, so 1e3 and 1e6 are
//! equally far from 3e4. `F_S = F_C sqrt(1 + u^2)` cannot fall below `F_C`. What cannot be negative is
//! `scale (cosh u - 1)`: it can reach 0, and moves by its logarithm where it is large. All else is itself. The change of coordinates is made in dual numbers,
//! so its derivative is exact too.
//!
//! What the data do not determine would run off along its valley. A weak prior holds it near its start:
//! one more row per such coordinate, worth one measured row, with a width of a decade. A parameter the
//! data do determine (an error of a percent, say) is moved by it by less than a hundredth of its error.

use super::scales::Scales;
use super::treatment::{self, Values};
use compensator_core::{ParameterId, Parameters, Real};

/// How one parameter is moved.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Scale {
    /// `p = exp(u)`, with `u` kept between two logarithms.
    Logarithmic(f64, f64),
    /// `p = other sqrt(1 + u^2)`.
    NotBelow(ParameterId),
    /// `p = scale (cosh u - 1)`.
    NotNegative(f64),
    /// `p = u`.
    Plain,
}

/// The free parameters of a fit, in coordinates; the others stay as they are.
#[derive(Clone, Debug)]
pub struct Coordinates {
    base: Parameters<f64>,
    free: Vec<(ParameterId, Scale)>,
    /// Where the prior is centred: the start.
    centre: Vec<f64>,
    /// Noise of a row, Nm; what a width of the prior costs.
    noise: f64,
}

/// Largest argument of the hyperbolic cosine: a factor of 1e17.
const LARGEST_ARGUMENT: f64 = 40.0;

impl Coordinates {
    /// Coordinates for `free`, with every other parameter as in `base`.
    ///
    /// `scales` say how large a parameter that cannot be negative is expected to be, from where on
    /// its coordinate is proportional, and between which bounds a positive one is sought.
    pub fn new(base: &Parameters<f64>, free: &[ParameterId], scales: &Scales) -> Self {
        let scale = |id: ParameterId| match treatment::of(id).values {
            Values::Any => Scale::Plain,
            Values::Positive(range) => {
                let (least, most) = treatment::bounds(id, range, scales);
                Scale::Logarithmic(least.ln(), most.ln())
            }
            Values::NotNegative(typical) => {
                Scale::NotNegative(typical(scales).max(f64::MIN_POSITIVE))
            }
            Values::NotBelow(other) => Scale::NotBelow(other),
        };
        let mut coordinates = Self {
            base: base.clone(),
            free: free.iter().map(|id| (*id, scale(*id))).collect(),
            centre: Vec::new(),
            noise: scales.noise,
        };
        coordinates.centre = coordinates.point(base);
        coordinates
    }

    /// The prior's rows: index of the coordinate, its derivative, its residual.
    pub fn prior<'a>(&'a self, point: &'a [f64]) -> impl Iterator<Item = (usize, f64, f64)> + 'a {
        self.free.iter().enumerate().filter_map(move |(index, (_, scale))| {
            let width = match scale {
                Scale::Logarithmic(..) | Scale::NotNegative(_) => std::f64::consts::LN_10,
                // F_S / F_C up to 1.8, rarely to 3.
                Scale::NotBelow(_) => 1.5,
                Scale::Plain => return None,
            };
            let slope = self.noise / width;
            Some((index, -slope, slope * (self.centre[index] - point[index])))
        })
    }

    /// The free parameters.
    pub fn ids(&self) -> impl Iterator<Item = ParameterId> + '_ {
        self.free.iter().map(|(id, _)| *id)
    }

    /// Number of free parameters.
    pub fn len(&self) -> usize {
        self.free.len()
    }

    /// Whether nothing is free.
    pub fn is_empty(&self) -> bool {
        self.free.is_empty()
    }

    /// The parameters at a point, in the number of the coordinates.
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
                        let u = u.within(T::from_f64(LARGEST_ARGUMENT));
                        let cosh = (u.exp() + (-u).exp()) * half;
                        T::from_f64(*size) * (cosh - T::one())
                    }
                    // Within its legal range, which only a degenerate log reaches the end of.
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

    /// The point of some parameters. On a bound, a little inside it: there the coordinate has a
    /// slope to leave by.
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
                    Scale::Plain => value,
                }
            })
            .collect()
    }

    /// Whether a coordinate moves by its logarithm and has a prior, so that its error is relative and
    /// never larger than the prior's width.
    pub fn is_held_by_prior(&self, index: usize) -> bool {
        matches!(self.free[index].1, Scale::Logarithmic(..) | Scale::NotNegative(_))
    }

    /// Whether a free parameter stands at a bound of its coordinate or of its legal range.
    pub fn at_bound(&self, index: usize, point: &[f64], parameters: &Parameters<f64>) -> bool {
        let (id, scale) = self.free[index];
        let value = parameters.get(id);
        let info = id.info();
        let coordinate = match scale {
            Scale::NotBelow(_) | Scale::NotNegative(_) => point[index].abs() < 2e-2,
            // Within a percent: a bound is approached, seldom reached.
            Scale::Logarithmic(least, most) => {
                point[index] < least + 0.01 || point[index] > most - 0.01
            }
            Scale::Plain => false,
        };
        // Legal ones are brought a rounding inside.
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
        travel: 3.0,
        campaign_s: 100.0,
        temperature_c: 20.0,
        noise: 0.01,
        period_s: 1e-3,
    };

    #[test]
    fn a_point_gives_its_parameters_back() {
        let base = Parameters::<f64>::new(LawKind::Lugre)
            .with(Id::CoulombTorque, 1.5)
            .with(Id::StaticTorque, 2.2)
            .with(Id::StribeckVelocity, 0.07)
            .with(Id::BristleStiffness, 3e4)
            .with(Id::BristleDamping, 12.0)
            .with(Id::ViscousFriction, -0.3);
        let free: Vec<_> = LawKind::Lugre.parameters().to_vec();
        let coordinates = Coordinates::new(&base, &free, &SCALES);
        let back: Parameters<f64> = coordinates.parameters(&coordinates.point(&base));
        for id in free {
            assert!((back.get(id) / base.get(id) - 1.0).abs() < 1e-12, "{}", id.name());
        }
    }

    #[test]
    fn no_point_leaves_the_bounds() {
        let base = Parameters::<f64>::new(LawKind::Lugre);
        let coordinates = Coordinates::new(&base, LawKind::Lugre.parameters(), &SCALES);
        for size in [-1e9, -3.0, 0.0, 1e-9, 3.0, 1e9] {
            let parameters: Parameters<f64> = coordinates.parameters(&[size; 6]);
            assert!(parameters.get(Id::CoulombTorque) > 0.0);
            assert!(parameters.get(Id::StaticTorque) >= parameters.get(Id::CoulombTorque));
            assert!(parameters.get(Id::BristleDamping) >= 0.0);
        }
    }
}
