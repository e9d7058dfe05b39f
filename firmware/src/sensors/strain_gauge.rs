//! Side load on the shaft from a Wheatstone bridge of strain gauges.
//!
//! The amplified bridge voltage is linear in the force: `F = (u - u_0) k`. Hanging weights on the shaft
//! determines zero and slope. Near either rail the amplifier saturates, and a broken wire drives it there;
//! the force is then missing.

/// Calibration of the gauge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrainGauge {
    /// Share of the converter's range at zero force, from 0 to 1.
    pub zero: f32,
    /// Force that corresponds to the whole range, N; negative if the voltage falls with the force.
    pub range_n: f32,
}

/// Share of the range at either end that an intact bridge does not reach.
const RAIL_SHARE: f32 = 0.02;

impl StrainGauge {
    /// Returns the force, N, for a share of the converter's range; `None` at a rail or if the result is not
    /// finite.
    pub fn force_n(&self, share: f32) -> Option<f32> {
        let is_valid = share > RAIL_SHARE && share < 1.0 - RAIL_SHARE;
        let force_n = (share - self.zero) * self.range_n;
        (is_valid && force_n.is_finite()).then_some(force_n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn force_is_linear_between_the_rails() {
        let gauge = StrainGauge { zero: 0.5, range_n: -400.0 };
        assert_eq!(gauge.force_n(0.5), Some(0.0));
        assert_eq!(gauge.force_n(0.25), Some(100.0));
        for broken in [0.0, 0.02, 0.98, 1.0, f32::NAN] {
            assert_eq!(gauge.force_n(broken), None);
        }
        assert_eq!(StrainGauge { zero: f32::NAN, ..gauge }.force_n(0.5), None);
    }
}
