//! Side load on the shaft from a Wheatstone bridge of strain gauges.
//!
//! A bridge with its amplifier gives a voltage that is a straight line of the force: `F = (u - u_0) k`. Zero
//! and slope are found by hanging weights on the shaft. Near either rail the amplifier no longer follows, and
//! a broken wire goes to one: there is then no force rather than a large one.

/// The line, and where it ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrainGauge {
    /// Share of the converter's range at no force, 0..=1.
    pub zero: f32,
    /// Force that would move it over the whole range, N; negative where it falls with the force.
    pub range_n: f32,
}

/// Share of the range at either end that no sound bridge reaches.
const RAIL: f32 = 0.02;

impl StrainGauge {
    /// Force, N, at this share of the converter's range; `None` at a rail or where that is no number.
    pub fn force_n(&self, share: f32) -> Option<f32> {
        let sound = share > RAIL && share < 1.0 - RAIL;
        let force_n = (share - self.zero) * self.range_n;
        (sound && force_n.is_finite()).then_some(force_n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_between_the_rails() {
        let gauge = StrainGauge { zero: 0.5, range_n: -400.0 };
        assert_eq!(gauge.force_n(0.5), Some(0.0));
        assert_eq!(gauge.force_n(0.25), Some(100.0));
        for broken in [0.0, 0.02, 0.98, 1.0, f32::NAN] {
            assert_eq!(gauge.force_n(broken), None);
        }
        assert_eq!(StrainGauge { zero: f32::NAN, ..gauge }.force_n(0.5), None);
    }
}
