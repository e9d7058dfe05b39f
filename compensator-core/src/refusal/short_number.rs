//! Numbers in texts of refusals.

use core::fmt::{self, Write};

/// Prints a number with at most seven significant digits, as `f32` holds.
///
/// So the `f32` value 1.8 reads `1.8`, not `1.7999999523162842`. The formatter of the standard library would add
/// 16 kB to the firmware image.
pub struct ShortNumber(pub f64);

/// Maximum number of significant digits.
const DIGITS: i32 = 7;

impl fmt::Display for ShortNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// Exponents of ten for which the number is written without an exponent.
        const WRITTEN_OUT: core::ops::Range<i32> = -10..16;
        let (mut size, mut exponent) = (self.0.abs(), 0);
        if self.0.is_nan() {
            return f.write_str("NaN");
        }
        if self.0 < 0.0 {
            f.write_char('-')?;
        }
        if size.is_infinite() || size == 0.0 {
            return f.write_str(if size == 0.0 { "0" } else { "inf" });
        }
        while size >= 10.0 {
            size /= 10.0;
            exponent += 1;
        }
        while size < 1.0 {
            size *= 10.0;
            exponent -= 1;
        }
        // The digits as an integer. Rounding may have added one digit.
        let mut digits = (size * 1e6 + 0.5) as u32;
        if digits >= 10_000_000 {
            digits /= 10;
            exponent += 1;
        }
        let mut count = DIGITS;
        while digits.is_multiple_of(10) {
            digits /= 10;
            count -= 1;
        }
        let written_out = WRITTEN_OUT.contains(&exponent);
        // Number of digits before the point; if not positive, number of zeros after it, negated.
        let whole = if written_out { exponent + 1 } else { 1 };
        if whole <= 0 {
            f.write_str("0.")?;
            (whole..0).try_for_each(|_| f.write_char('0'))?;
        }
        for at in 0..count.max(whole) {
            if at == whole && whole > 0 {
                f.write_char('.')?;
            }
            let place = (count - 1 - at).max(0) as u32;
            let digit = if at < count { digits / 10u32.pow(place) % 10 } else { 0 };
            f.write_char(char::from(b'0' + digit as u8))?;
        }
        if written_out { Ok(()) } else { write!(f, "e{exponent}") }
    }
}

#[cfg(test)]
mod tests {
    use super::ShortNumber;
    use std::string::ToString;

    #[test]
    fn short_number_prints_at_most_seven_digits() {
        for (number, text) in [
            (1.8f32.into(), "1.8"),
            (-0.05, "-0.05"),
            (1e-9, "0.000000001"),
            (1e-12, "1e-12"),
            (2.4e-6, "0.0000024"),
            (1e9, "1000000000"),
            (123_456.78, "123456.8"),
            (9.999_999_96, "10"),
            (0.1 + 0.2, "0.3"),
            (f64::MAX, "1.797693e308"),
            (5e-324, "4.940656e-324"),
            (0.0, "0"),
            (f64::NAN, "NaN"),
            (f64::NEG_INFINITY, "-inf"),
        ] {
            assert_eq!(ShortNumber(number).to_string(), text);
        }
    }
}
