//! What distinguishes a variant of a cause: the constants that a search has found, and how a report states them.

use std::fmt;

/// What distinguishes a variant from the others of its cause and columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Detail {
    /// Nothing: the cause has one form.
    #[default]
    Only,
    /// A form that no fit of the driver's law needs to know.
    Form(String),
    /// Waves of the position.
    Waves {
        /// Their orders, in periods per rad or m times 2 pi.
        orders: Vec<f64>,
        /// What they are waves of.
        kind: WaveKind,
    },
    /// A stop operator behind a gap.
    Gap(Gap),
    /// A gap that was simulated with the driver's law.
    SimulatedGap(SimulatedGap),
    /// A column that the friction level follows, or that adds a torque.
    Curve {
        /// True for the level.
        of_level: bool,
        /// Shape of the curve; empty for a line.
        shape: &'static str,
    },
}

/// A gap, and the travel of the friction beside it, rad or m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Travel without friction after a reversal.
    pub gap: f64,
    /// Travel over which friction then builds up.
    pub travel: f64,
}

/// A gap in the driver's law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedGap {
    /// Travel with little stiffness, rad or m.
    pub gap: f64,
    /// True if it is crossed where the drive has unwound, false if right after a reversal.
    pub is_unloaded: bool,
    /// Stiffness of the bristles beside it, as a multiple of that of the law without a gap.
    pub stiffness_ratio: f64,
}

/// What waves are waves of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaveKind {
    /// The torque, the friction level or the angle.
    Plain,
    /// The motion: the torque grows with the speed.
    OfSpeed,
    /// The torque, with another phase in each run.
    FreePhase,
}

impl Detail {
    /// Returns waves of some orders, which are known to four decimals.
    pub(crate) fn waves(orders: &[f64], kind: WaveKind) -> Self {
        let orders = orders.iter().map(|order| (1e4 * order).round() / 1e4).collect();
        Self::Waves { orders, kind }
    }

    /// Returns a gap and a travel, which are known to four digits.
    pub(crate) fn gap(Gap { gap, travel }: Gap) -> Self {
        Self::Gap(Gap { gap: to_four_digits(gap), travel: to_four_digits(travel) })
    }

    /// Returns the orders of waves; none for other details.
    pub fn orders(&self) -> &[f64] {
        match self {
            Self::Waves { orders, .. } => orders,
            _ => &[],
        }
    }

    /// Returns true if a report has nothing to state.
    pub fn is_empty(&self) -> bool {
        *self == Self::Only
    }
}

fn to_four_digits(value: f64) -> f64 {
    let scale = 10f64.powi(3 - value.abs().log10().floor() as i32);
    if scale.is_finite() { (value * scale).round() / scale } else { value }
}

impl fmt::Display for Detail {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Only => Ok(()),
            Self::Form(form) => f.write_str(form),
            Self::Waves { orders, kind } => {
                let orders: Vec<String> = orders.iter().map(|n| format!("{n:.4}")).collect();
                let kind = match kind {
                    WaveKind::Plain => "",
                    WaveKind::OfSpeed => ", as of the speed",
                    WaveKind::FreePhase => ", another phase in each run",
                };
                write!(f, "order {}{kind}", orders.join(", "))
            }
            Self::Gap(Gap { gap, travel }) => write!(f, "gap {gap:.3e}, travel {travel:.3e}"),
            Self::SimulatedGap(SimulatedGap { gap, is_unloaded, stiffness_ratio }) => {
                let place = if *is_unloaded { "where unloaded" } else { "after the reversal" };
                write!(f, "gap {gap:.3e} {place}, stiffness x {stiffness_ratio}")
            }
            Self::Curve { of_level, shape } => {
                f.write_str(if *of_level { "level" } else { "torque" })?;
                if shape.is_empty() { Ok(()) } else { write!(f, ", {shape}") }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gap_is_rounded_as_it_is_printed() {
        for value in [1.23456e-4, 9.99996e-3, 0.25, 12.34567, 3.0] {
            let printed: f64 = format!("{value:.3e}").parse().expect("a number");
            assert_eq!(to_four_digits(value), printed);
        }
        let wave = Detail::waves(&[7.000_04, 12.5], WaveKind::OfSpeed);
        assert_eq!(wave.to_string(), "order 7.0000, 12.5000, as of the speed");
        assert_eq!(wave.orders(), [7.0, 12.5]);
    }
}
