//! Formatting of numbers with a meaningful number of digits.
//!
//! A number keeps a given count of significant digits. It is a plain decimal while that is short, and becomes
//! `2.400 × 10⁻⁶` otherwise. A value with a standard error is rounded to the second digit of the error. The text is plain
//! Unicode (a true minus, superscript digits), so that sentences, tables and charts show the same number alike.

/// Decimal exponents of plain decimals: 0.001 is readable, 1e-4 is not.
const PLAIN_EXPONENTS: std::ops::Range<i32> = -3..6;

/// Formats `value` with `digits` significant digits (at least one). Below a million, digits before the decimal point are
/// not rounded: `significant(46_414.3, 4)` is `46414`. NaN and infinity have names.
pub fn significant(value: f64, digits: usize) -> String {
    if let Some(named) = special(value) {
        return named;
    }
    let digits = digits.clamp(1, 17);
    let exponent = exponent_of(value, digits);
    let kept_after_first = digits as i32 - 1;
    if PLAIN_EXPONENTS.contains(&exponent) {
        fixed(value, kept_after_first - exponent)
    } else {
        format!("{} × 10{}", fixed(scaled(value, exponent), kept_after_first), raised(exponent))
    }
}

/// Formats a value with its standard error, both in the same unit, rounded to the error's second digit:
/// `1.502 ± 0.010`. An error that is not a positive number is shown as a dash.
pub fn with_error(value: f64, std_error: f64) -> String {
    if !value.is_finite() || !std_error.is_finite() || std_error <= 0.0 {
        return format!("{} ± –", significant(value, 4));
    }
    let error_exponent = exponent_of(std_error, 2);
    let exponent = error_exponent.max(if value == 0.0 { i32::MIN } else { exponent_of(value, 4) });
    if PLAIN_EXPONENTS.contains(&exponent) {
        let decimals = 1 - error_exponent;
        return format!("{} ± {}", fixed(value, decimals), fixed(std_error, decimals));
    }
    let decimals = 1 + exponent - error_exponent;
    let (value, std_error) = (scaled(value, exponent), scaled(std_error, exponent));
    format!(
        "({} ± {}) × 10{}",
        fixed(value, decimals),
        fixed(std_error, decimals),
        raised(exponent)
    )
}

/// Formats a count in groups of three: `46 414` (with narrow no-break spaces).
pub fn count(things: u64) -> String {
    let digits = things.to_string();
    let mut text = String::with_capacity(digits.len() * 2);
    for (index, digit) in digits.char_indices() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// Formats a number with four significant digits, without an exponent for common sizes.
pub fn figure(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e6).contains(&size) {
        return format!("{value:.3e}");
    }
    let digits = (3 - size.log10().floor() as i32).clamp(0, 6) as usize;
    format!("{value:.digits$}")
}

/// Formats values without digits: zero, NaN and the infinities.
fn special(value: f64) -> Option<String> {
    let name = match value {
        0.0 => "0",
        f64::INFINITY => "∞",
        f64::NEG_INFINITY => "−∞",
        _ if value.is_nan() => "NaN",
        _ => return None,
    };
    Some(name.to_owned())
}

/// Returns the decimal exponent of a finite value after rounding to `digits`: 9.99 is 10.0 in two.
fn exponent_of(value: f64, digits: usize) -> i32 {
    let text = format!("{value:.*e}", digits - 1);
    text.split_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0)
}

/// Returns `value / 10^exponent`, in two steps because one power of ten could leave the range of `f64`.
fn scaled(value: f64, exponent: i32) -> f64 {
    let half = exponent / 2;
    value / 10f64.powi(half) / 10f64.powi(exponent - half)
}

/// Formats a decimal with a true minus; never `-0.0`.
pub fn fixed(value: f64, decimals: i32) -> String {
    let text = format!("{:.*}", decimals.clamp(0, 20) as usize, value.abs());
    let is_zero = !text.contains(|c: char| ('1'..='9').contains(&c));
    if value < 0.0 && !is_zero { format!("−{text}") } else { text }
}

/// Formats an exponent in superscript digits.
pub fn raised(exponent: i32) -> String {
    let raise = |c: char| match c.to_digit(10) {
        Some(digit) => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][digit as usize],
        None => '⁻',
    };
    exponent.to_string().chars().map(raise).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn significant_keeps_requested_digits() {
        let cases = [
            (0.0312, "0.03120"),
            (1.5, "1.500"),
            (-2.4e-6, "−2.400 × 10⁻⁶"),
            (46_414.3, "46414"),
            (999_999.9, "1.000 × 10⁶"),
            (0.000_999_99, "0.001000"),
            (0.0, "0"),
            (-0.0, "0"),
            (f64::MIN_POSITIVE, "2.225 × 10⁻³⁰⁸"),
            (5e-324, "4.941 × 10⁻³²⁴"),
            (f64::MAX, "1.798 × 10³⁰⁸"),
            (f64::NAN, "NaN"),
            (f64::NEG_INFINITY, "−∞"),
        ];
        for (value, expected) in cases {
            assert_eq!(significant(value, 4), expected, "{value:e}");
        }
    }

    #[test]
    fn with_error_rounds_to_second_digit_of_error() {
        assert_eq!(with_error(1.502_34, 0.0101), "1.502 ± 0.010");
        assert_eq!(with_error(2.4e-6, 1e-8), "(2.400 ± 0.010) × 10⁻⁶");
        assert_eq!(with_error(-0.001, 0.25), "0.00 ± 0.25");
        assert_eq!(with_error(120.0, 35.0), "120 ± 35");
        assert_eq!(with_error(0.0, 1e-9), "(0.0 ± 1.0) × 10⁻⁹");
        assert_eq!(with_error(1.5, f64::NAN), "1.500 ± –");
        assert_eq!(with_error(f64::NAN, 1.0), "NaN ± –");
    }

    #[test]
    fn count_groups_by_three() {
        assert_eq!(count(7), "7");
        assert_eq!(count(46_414), "46\u{202f}414");
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
    }
}
