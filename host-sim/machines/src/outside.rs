//! Effects that no cause of the catalogue describes. The correct diagnosis is `unknown`.

use crate::conditions::{Conditions, Extra};
use crate::sampler::Sampler;
use std::f64::consts::TAU;

/// Relation between the friction level and a column: a curve from 0 to 1 over the column's range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curve {
    /// Proportional.
    Straight,
    /// Quadratic.
    Square,
    /// Sigmoid: almost the whole change occurs within a small part of the range.
    Step,
}

impl Curve {
    /// Returns the curve at a share of the column's range.
    fn at(self, share: f64) -> f64 {
        match self {
            Curve::Straight => share,
            Curve::Square => share * share.abs(),
            Curve::Step => 1.0 / (1.0 + (-12.0 * (share - 0.5)).exp()),
        }
    }

    /// Returns the words for a description.
    const fn words(self) -> &'static str {
        match self {
            Curve::Straight => "in proportion to",
            Curve::Square => "with the square of",
            Curve::Step => "in a step over",
        }
    }
}

/// Kind of the effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Flavour {
    /// The level falls with temperature; the viscosity does not change.
    Temperature {
        /// Temperature from which the level falls, deg C.
        from_c: f64,
        /// Range over which it falls, K.
        range_k: f64,
        /// Form of the decrease.
        curve: Curve,
    },
    /// The level follows an extra column.
    Column {
        /// The column.
        extra: Extra,
        /// Reading from which the level changes.
        from: f64,
        /// Range of the reading over which it changes.
        range: f64,
        /// Form of the change.
        curve: Curve,
    },
    /// A local increase of the level around a speed.
    Band {
        /// Centre, rad/s.
        speed: f64,
        /// Width, rad/s.
        width: f64,
    },
    /// An additive torque proportional to the excess of the cable tension.
    Cable {
        /// Tension without a torque, N.
        from: f64,
    },
    /// A local increase of the level at one angle of the shaft.
    Scratch {
        /// Centre, rad.
        angle: f64,
        /// Width, rad.
        width: f64,
    },
}

/// An effect outside the catalogue, with its size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outside {
    /// Kind of the effect.
    pub flavour: Flavour,
    /// Relative change of the level. In Nm for a band, in Nm/N for a cable.
    pub size: f64,
}

impl Flavour {
    /// Draws a kind. Its range is set later, when the campaign is known.
    pub fn draw(sampler: &mut Sampler) -> Self {
        let curve = sampler.pick(&[Curve::Straight, Curve::Square, Curve::Step]);
        let curve = curve.unwrap_or(Curve::Straight);
        let column = |extra| Flavour::Column { extra, from: 0.0, range: 1.0, curve };
        match sampler.below(6) {
            // Only a step: a proportional change would be confounded with other temperature effects.
            0 => Flavour::Temperature { from_c: 0.0, range_k: 1.0, curve: Curve::Step },
            1 => column(Extra::Humidity),
            2 => column(Extra::LubricantAge),
            3 => Flavour::Band { speed: 1.0, width: 1.0 },
            4 => Flavour::Cable { from: Extra::CableTension.range().0 },
            _ => Flavour::Scratch {
                angle: sampler.between(-3.0, 3.0),
                width: sampler.log_between(0.06, 0.3),
            },
        }
    }

    /// Returns the extra column that causes the effect.
    pub fn extra(&self) -> Option<Extra> {
        match self {
            Flavour::Column { extra, .. } => Some(*extra),
            Flavour::Cable { .. } => Some(Extra::CableTension),
            _ => None,
        }
    }

    /// Returns the column that the effect depends on.
    pub const fn column(&self) -> &'static str {
        match self {
            Flavour::Temperature { .. } => "temperature_c",
            Flavour::Column { extra, .. } => extra.column(),
            Flavour::Band { .. } => "velocity_rad_s",
            Flavour::Cable { .. } => Extra::CableTension.column(),
            Flavour::Scratch { .. } => "position_rad",
        }
    }

    /// Returns the unit of the size.
    pub const fn unit(&self) -> &'static str {
        match self {
            Flavour::Band { .. } => "Nm",
            Flavour::Cable { .. } => "Nm/N",
            _ => "1",
        }
    }

    /// Returns the smallest and largest size that is drawn.
    pub fn limits(&self, coulomb_nm: f64) -> (f64, f64) {
        match self {
            Flavour::Band { .. } => (0.02, 0.8 * coulomb_nm),
            Flavour::Cable { .. } => (5e-4, 0.02),
            Flavour::Scratch { .. } => (0.05, 1.5),
            Flavour::Temperature { .. } => (0.03, 0.6),
            Flavour::Column { .. } => (0.03, 1.0),
        }
    }

    /// Returns a description of the effect.
    pub fn words(&self) -> String {
        match self {
            Flavour::Temperature { curve, .. } => {
                format!("the friction level falls {} temperature_c", curve.words())
            }
            Flavour::Column { extra, curve, .. } => {
                format!("the friction level rises {} {}", curve.words(), extra.column())
            }
            Flavour::Band { speed, width } => {
                format!("more friction at speeds of {speed:.3} rad/s (width {width:.3} rad/s)")
            }
            Flavour::Cable { .. } => {
                "a torque that adds in proportion to cable_tension_n".to_owned()
            }
            Flavour::Scratch { angle, width } => {
                format!("more friction at the shaft angle {angle:.3} rad (width {width:.3} rad)")
            }
        }
    }
}

/// Gaussian bump of height 1.
fn bump(distance: f64, width: f64) -> f64 {
    let ratio = distance / width;
    (-ratio * ratio).exp()
}

impl Outside {
    /// Returns true if the effect depends on the temperature.
    pub fn follows_temperature(&self) -> bool {
        matches!(self.flavour, Flavour::Temperature { .. })
    }

    /// Returns the level with the effect, Nm.
    pub fn level(&self, level: f64, speed: f64, angle: f64, now: &Conditions) -> f64 {
        let size = self.size;
        match self.flavour {
            Flavour::Temperature { from_c, range_k, curve } => {
                level * (1.0 - size * curve.at((now.temperature - from_c) / range_k))
            }
            Flavour::Column { from, range, curve, .. } => {
                level * (1.0 + size * curve.at((now.extra - from) / range))
            }
            Flavour::Band { speed: middle, width } => level + size * bump(speed - middle, width),
            Flavour::Cable { .. } => level,
            Flavour::Scratch { angle: at, width } => {
                level * (1.0 + size * bump(wrapped_difference(angle, at), width))
            }
        }
    }

    /// Returns the additive torque of the effect, Nm.
    pub fn added(&self, now: &Conditions) -> f64 {
        match self.flavour {
            Flavour::Cable { from } => self.size * (now.extra - from),
            _ => 0.0,
        }
    }
}

/// Returns the angle difference wrapped to the range -pi to pi.
fn wrapped_difference(angle: f64, from: f64) -> f64 {
    let turned = (angle - from).rem_euclid(TAU);
    if turned > 0.5 * TAU { turned - TAU } else { turned }
}
