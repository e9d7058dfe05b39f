//! Structure that no cause of the catalogue has: the right answer to it is `unknown`.

use super::sampler::Sampler;
use super::surroundings::{Around, Extra};
use std::f64::consts::TAU;

/// How a level follows a column: a curve from 0 to 1 over the column's range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Curve {
    /// In proportion.
    Straight,
    /// Slowly, then faster.
    Square,
    /// Hardly, then all within a small part of the range.
    Step,
}

impl Curve {
    fn at(self, share: f64) -> f64 {
        match self {
            Curve::Straight => share,
            Curve::Square => share * share.abs(),
            Curve::Step => 1.0 / (1.0 + (-12.0 * (share - 0.5)).exp()),
        }
    }

    const fn words(self) -> &'static str {
        match self {
            Curve::Straight => "in proportion to",
            Curve::Square => "with the square of",
            Curve::Step => "in a step over",
        }
    }
}

/// One such structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Flavour {
    /// The level (not the viscosity) falls with temperature from `from_c` over `range_k`.
    Temperature { from_c: f64, range_k: f64, curve: Curve },
    /// The level follows an extra column over its range.
    Column { extra: Extra, from: f64, range: f64, curve: Curve },
    /// A bump of the level about a speed.
    Band { speed: f64, width: f64 },
    /// An additive torque in proportion to a cable's tension, from `from` on.
    Cable { from: f64 },
    /// A bump of the level at one angle of the shaft.
    Scratch { angle: f64, width: f64 },
}

/// A structure and how large it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Outside {
    pub flavour: Flavour,
    /// Relative change of the level; Nm for a band; Nm/N for a cable.
    pub size: f64,
}

impl Flavour {
    /// One at random, to be placed when the campaign is known.
    pub fn draw(sampler: &mut Sampler) -> Self {
        let curve = sampler.pick(&[Curve::Straight, Curve::Square, Curve::Step]);
        let curve = curve.unwrap_or(Curve::Straight);
        let column = |extra| Flavour::Column { extra, from: 0.0, range: 1.0, curve };
        match sampler.below(6) {
            // Never straight: that would be hard to tell from anything else that warms up.
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

    /// The extra column that acts.
    pub fn extra(&self) -> Option<Extra> {
        match self {
            Flavour::Column { extra, .. } => Some(*extra),
            Flavour::Cable { .. } => Some(Extra::CableTension),
            _ => None,
        }
    }

    /// The column the structure follows.
    pub const fn column(&self) -> &'static str {
        match self {
            Flavour::Temperature { .. } => "temperature_c",
            Flavour::Column { extra, .. } => extra.column(),
            Flavour::Band { .. } => "velocity_rad_s",
            Flavour::Cable { .. } => Extra::CableTension.column(),
            Flavour::Scratch { .. } => "position_rad",
        }
    }

    /// Unit of the size.
    pub const fn unit(&self) -> &'static str {
        match self {
            Flavour::Band { .. } => "Nm",
            Flavour::Cable { .. } => "Nm/N",
            _ => "1",
        }
    }

    /// Smallest and largest size that is drawn.
    pub fn limits(&self, coulomb_nm: f64) -> (f64, f64) {
        match self {
            Flavour::Band { .. } => (0.02, 0.8 * coulomb_nm),
            Flavour::Cable { .. } => (5e-4, 0.02),
            Flavour::Scratch { .. } => (0.05, 1.5),
            Flavour::Temperature { .. } => (0.03, 0.6),
            Flavour::Column { .. } => (0.03, 1.0),
        }
    }

    /// The structure in words.
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

fn bump(distance: f64, width: f64) -> f64 {
    let ratio = distance / width;
    (-ratio * ratio).exp()
}

impl Outside {
    /// Whether temperature acts.
    pub fn follows_temperature(&self) -> bool {
        matches!(self.flavour, Flavour::Temperature { .. })
    }

    /// The level with the structure in it, Nm.
    pub fn level(&self, level: f64, speed: f64, angle: f64, now: &Around) -> f64 {
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
                level * (1.0 + size * bump(on_the_shaft(angle, at), width))
            }
        }
    }

    /// The torque it adds beside friction, Nm.
    pub fn added(&self, now: &Around) -> f64 {
        match self.flavour {
            Flavour::Cable { from } => self.size * (now.extra - from),
            _ => 0.0,
        }
    }
}

/// The angle's distance from another on the shaft, -pi to pi.
fn on_the_shaft(angle: f64, from: f64) -> f64 {
    let turned = (angle - from).rem_euclid(TAU);
    if turned > 0.5 * TAU { turned - TAU } else { turned }
}
