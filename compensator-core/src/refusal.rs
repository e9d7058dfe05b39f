//! Why numbers that a person wrote were refused, in words that person understands.
//!
//! A refusal names the field, its value, the bound that the value broke, and why there is one.

use core::fmt::{self, Write};

/// A number in words for a person: seven digits, for records hold `f32`, and 1.8 should not read
/// 1.7999999523162842. Its own, for the library's way of printing floats, exact to the last of any number of
/// digits, is 16 kB of the driver's image.
pub struct Digits(pub f64);

/// How many digits are written.
const DIGITS: i32 = 7;

impl fmt::Display for Digits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// Exponents of ten between which a number is written out.
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
        // As a whole number of so many digits; rounding may have made one more of them.
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
        // Digits before the point; below 1 as many zeros after it.
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

/// The bound a refused value broke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// It must be at least this.
    AtLeast(f64),
    /// It must be at most this.
    AtMost(f64),
    /// It must be more than this.
    MoreThan(f64),
    /// It must be a finite number.
    Finite,
    /// It must be a whole number.
    Whole,
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Bound::AtLeast(bound) => write!(f, "at least {}", Digits(*bound)),
            Bound::AtMost(bound) => write!(f, "at most {}", Digits(*bound)),
            Bound::MoreThan(bound) => write!(f, "more than {}", Digits(*bound)),
            Bound::Finite => f.write_str("a finite number"),
            Bound::Whole => f.write_str("a whole number"),
        }
    }
}

/// Why parameters were refused: which, its value, its bound and the reason.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterError {
    /// Name of the parameter or envelope field.
    pub field: &'static str,
    /// Its value, in its own unit.
    pub value: f64,
    /// What it should have been.
    pub bound: Bound,
    /// Why.
    pub why: &'static str,
}

impl fmt::Display for ParameterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}: must be {}: {}", self.field, Digits(self.value), self.bound, self.why)
    }
}

impl core::error::Error for ParameterError {}

/// Checks numbers against ranges: smallest and largest legal value, and why, each in the order of the names.
///
/// # Errors
/// Names the first that is not a number or out of its range.
pub fn check_ranges(
    names: &[&'static str],
    values: &[f32],
    ranges: &[(f32, f32, &'static str)],
) -> Result<(), ParameterError> {
    for ((field, value), (least, most, why)) in names.iter().zip(values).zip(ranges) {
        let bound = if !value.is_finite() {
            Bound::Finite
        } else if value < least {
            Bound::AtLeast((*least).into())
        } else if value > most {
            Bound::AtMost((*most).into())
        } else {
            continue;
        };
        return refuse(field, (*value).into(), bound, why);
    }
    Ok(())
}

/// A refusal, as a result.
///
/// # Errors
/// Always.
pub(crate) fn refuse(
    field: &'static str,
    value: f64,
    bound: Bound,
    why: &'static str,
) -> Result<(), ParameterError> {
    Err(ParameterError { field, value, bound, why })
}

#[cfg(test)]
mod tests {
    use super::Digits;
    use std::string::ToString;

    #[test]
    fn numbers_read_as_a_person_writes_them() {
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
            assert_eq!(Digits(number).to_string(), text);
        }
    }
}
