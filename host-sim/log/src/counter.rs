//! Detection of signed values that the log holds as unsigned counters.
//!
//! Modbus registers and CAN signals of 16 or 32 bits are often logged without their sign: -1 appears as 65535. Then
//! neighbouring rows around 0 differ by nearly the whole range, and no value lies in its middle.

use super::unit::Conversion;

/// Widths that are recognised, bits. Eight bits are too few: a command may switch between 0 and 255.
const WIDTHS_BITS: [u32; 2] = [16, 32];

/// Minimum jump between neighbouring rows, in ranges of the counter.
const MIN_JUMP: f64 = 0.75;

/// Minimum number of such jumps: a single one may be a fault.
const MIN_JUMPS: usize = 3;

/// Maximum distance of a value from a whole number of counts, caused by the rounding of its unit.
const MAX_FRACTION: f64 = 1e-3;

/// Returns the width of the counter, bits, if the values of all runs are unsigned counts of a signed quantity.
pub(super) fn unsigned_bits<'a>(
    runs: impl Iterator<Item = &'a [f64]> + Clone,
    conversion: Option<Conversion>,
) -> Option<u32> {
    if conversion.is_some_and(|conversion| conversion.is_signed_counter()) {
        return None;
    }
    let count = |value: f64| conversion.map_or(value, |of| of.inverse(value));
    WIDTHS_BITS.into_iter().find(|bits| {
        let range = 2f64.powi(*bits as i32);
        let is_valid = |value: &f64| {
            let count = count(*value);
            let is_middle = (0.25 * range..0.75 * range).contains(&count);
            (-0.5..range).contains(&count)
                && (count - count.round()).abs() < MAX_FRACTION
                && !is_middle
        };
        let values = runs.clone().flatten().filter(|value| !value.is_nan());
        let jumps = runs.clone().flat_map(|run| run.windows(2)).filter(|pair| {
            let jump = (count(pair[1]) - count(pair[0])).abs();
            (MIN_JUMP * range..range).contains(&jump)
        });
        values.clone().all(is_valid) && jumps.count() >= MIN_JUMPS
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::unit::conversion;

    fn found(values: &[f64], unit: Option<&str>) -> Option<u32> {
        let conversion = unit.map(|unit| conversion("torque_nm", unit).unwrap());
        unsigned_bits([values].into_iter(), conversion)
    }

    #[test]
    fn unsigned_bits_with_negative_values_as_unsigned_returns_width() {
        let signed: Vec<f64> =
            (0..200).map(|row| (300.0 * (0.1 * f64::from(row)).sin()).round()).collect();
        let unsigned: Vec<f64> = signed.iter().map(|value| value.rem_euclid(65536.0)).collect();
        assert_eq!(found(&unsigned, None), Some(16));
        let scaled: Vec<f64> = unsigned.iter().map(|value| value * 0.01).collect();
        assert_eq!(found(&scaled, Some("0.01Nm")), Some(16));
        let wide: Vec<f64> = signed.iter().map(|value| value.rem_euclid(4_294_967_296.0)).collect();
        assert_eq!(found(&wide, None), Some(32));
        assert_eq!(found(&signed, None), None);
        assert_eq!(found(&signed, Some("int16 0.01Nm")), None);
    }

    #[test]
    fn unsigned_bits_with_large_signal_returns_none() {
        let large: Vec<f64> =
            (0..200).map(|row| (3e4 * (1.0 + (0.1 * f64::from(row)).sin())).round()).collect();
        assert_eq!(found(&large, None), None);
    }
}
