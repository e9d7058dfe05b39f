//! Units of a log and their conversion to the units of the contract.
//!
//! The names of the contract contain their units (`velocity_rad_s`), so the target unit is known. The unit of a log's
//! column follows a colon: `--columns velocity_rad_s=speed:rpm`. A minus before the unit inverts the sign
//! (`torque_nm=tau:-Nm`). Common notations are accepted: `N·mm`, `N*mm` and `Nmm` are one unit, as are `°/s`, `deg/s`
//! and `dps`. Case is significant only where needed (mN, MN). A unit of another dimension is an error.
//!
//! A number before the unit is the size of one count (`Present Velocity:0.229rpm`, `tau_raw:4.2/1000Nm`), and a number
//! after it an offset (`oil:0.1degC-40`). An encoder's counts take the number of counts per turn: `enc:4096counts`.
//!
//! A unit in a column's own name (`speed_rpm`, `t (ms)`) is neither applied nor ignored. Without an explicit unit the
//! column is an error, whose message shows the option to use ([`in_name`]).

use super::date::DateOrder;
use crate::setting::Setting;
use compensator_core::quantity::{JointKind, Quantity};

/// The dimension of a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Dimension {
    Time,
    Angle,
    AngularVelocity,
    AngularAcceleration,
    Length,
    Velocity,
    Acceleration,
    Torque,
    Force,
    Pressure,
    Temperature,
}

/// Conversion to the contract's unit: (factor, divisor, offset). The value is multiplied, divided, and the offset is
/// added. The divisor keeps conversions exact: 1 ms becomes the number nearest to 0.001.
type LinearConversion = (f64, f64, f64);

/// A unit with its notations, as [`normalise`] returns them.
struct Unit {
    dimension: Dimension,
    symbols: &'static [&'static str],
    conversion: LinearConversion,
}

const fn unit(
    dimension: Dimension,
    symbols: &'static [&'static str],
    conversion: LinearConversion,
) -> Unit {
    Unit { dimension, symbols, conversion }
}

const TURN_RAD: f64 = std::f64::consts::TAU;
const GRAVITY_M_S2: f64 = 9.806_65;
const INCH_M: f64 = 0.0254;
const POUND_FORCE_N: f64 = 4.448_221_615_260_5;

/// The contract's own unit is the first of each dimension.
const UNITS: &[Unit] = {
    use Dimension::*;
    &[
        unit(Time, &["s", "sec", "seconds", "iso", "iso8601", "date", "datetime"], (1.0, 1.0, 0.0)),
        unit(Time, &["ms", "msec", "millis", "milliseconds"], (1.0, 1e3, 0.0)),
        unit(Time, &["us", "usec", "micros", "microseconds"], (1.0, 1e6, 0.0)),
        unit(Time, &["ns", "nsec", "nanos", "nanoseconds", "nanosec"], (1.0, 1e9, 0.0)),
        unit(Time, &["min", "minutes"], (60.0, 1.0, 0.0)),
        unit(Time, &["h", "hours"], (3600.0, 1.0, 0.0)),
        unit(Time, &["d", "days"], (86_400.0, 1.0, 0.0)),
        unit(Angle, &["rad"], (1.0, 1.0, 0.0)),
        unit(Angle, &["mrad"], (1.0, 1e3, 0.0)),
        unit(Angle, &["deg", "degrees"], (TURN_RAD, 360.0, 0.0)),
        unit(Angle, &["rev", "turn", "turns", "revolutions"], (TURN_RAD, 1.0, 0.0)),
        unit(AngularVelocity, &["rad/s", "radps", "rads1"], (1.0, 1.0, 0.0)),
        unit(AngularVelocity, &["mrad/s"], (1.0, 1e3, 0.0)),
        unit(AngularVelocity, &["deg/s", "degps", "dps"], (TURN_RAD, 360.0, 0.0)),
        unit(
            AngularVelocity,
            &["rpm", "1/min", "r/min", "rev/min", "U/min", "tr/min", "giri/min", "min1"],
            (TURN_RAD, 60.0, 0.0),
        ),
        unit(AngularVelocity, &["rps", "rev/s", "turn/s", "turns/s"], (TURN_RAD, 1.0, 0.0)),
        unit(AngularAcceleration, &["rad/s2", "rad/s/s"], (1.0, 1.0, 0.0)),
        unit(AngularAcceleration, &["deg/s2", "deg/s/s"], (TURN_RAD, 360.0, 0.0)),
        unit(AngularAcceleration, &["rpm/s"], (TURN_RAD, 60.0, 0.0)),
        unit(AngularAcceleration, &["rev/s2", "turn/s2", "turns/s2"], (TURN_RAD, 1.0, 0.0)),
        unit(Length, &["m"], (1.0, 1.0, 0.0)),
        unit(Length, &["cm"], (1.0, 1e2, 0.0)),
        unit(Length, &["mm"], (1.0, 1e3, 0.0)),
        unit(Length, &["um"], (1.0, 1e6, 0.0)),
        unit(Length, &["inch", "inches"], (INCH_M, 1.0, 0.0)),
        unit(Velocity, &["m/s"], (1.0, 1.0, 0.0)),
        unit(Velocity, &["cm/s"], (1.0, 1e2, 0.0)),
        unit(Velocity, &["mm/s"], (1.0, 1e3, 0.0)),
        unit(Velocity, &["um/s"], (1.0, 1e6, 0.0)),
        unit(Velocity, &["m/min"], (1.0, 60.0, 0.0)),
        unit(Velocity, &["mm/min"], (1.0, 6e4, 0.0)),
        unit(Velocity, &["inch/s", "in/s"], (INCH_M, 1.0, 0.0)),
        unit(Acceleration, &["m/s2", "m/s/s"], (1.0, 1.0, 0.0)),
        unit(Acceleration, &["cm/s2"], (1.0, 1e2, 0.0)),
        unit(Acceleration, &["mm/s2"], (1.0, 1e3, 0.0)),
        unit(Torque, &["Nm"], (1.0, 1.0, 0.0)),
        unit(Torque, &["cNm", "Ncm"], (1.0, 1e2, 0.0)),
        unit(Torque, &["mNm", "Nmm"], (1.0, 1e3, 0.0)),
        unit(Torque, &["uNm"], (1.0, 1e6, 0.0)),
        unit(Torque, &["kNm"], (1e3, 1.0, 0.0)),
        unit(Torque, &["MNm"], (1e6, 1.0, 0.0)),
        unit(Torque, &["kgcm", "kgfcm"], (GRAVITY_M_S2, 1e2, 0.0)),
        unit(Torque, &["ozin", "ozfin"], (POUND_FORCE_N * INCH_M, 16.0, 0.0)),
        unit(Torque, &["lbin", "lbfin", "inlb"], (POUND_FORCE_N * INCH_M, 1.0, 0.0)),
        unit(Torque, &["lbft", "lbfft", "ftlb"], (POUND_FORCE_N * INCH_M * 12.0, 1.0, 0.0)),
        unit(Force, &["N"], (1.0, 1.0, 0.0)),
        unit(Force, &["mN"], (1.0, 1e3, 0.0)),
        unit(Force, &["kN"], (1e3, 1.0, 0.0)),
        unit(Force, &["MN"], (1e6, 1.0, 0.0)),
        unit(Force, &["kgf"], (GRAVITY_M_S2, 1.0, 0.0)),
        unit(Force, &["lbf"], (POUND_FORCE_N, 1.0, 0.0)),
        unit(Pressure, &["Pa"], (1.0, 1.0, 0.0)),
        unit(Pressure, &["hPa", "mbar"], (1e2, 1.0, 0.0)),
        unit(Pressure, &["kPa"], (1e3, 1.0, 0.0)),
        unit(Pressure, &["MPa"], (1e6, 1.0, 0.0)),
        unit(Pressure, &["bar"], (1e5, 1.0, 0.0)),
        unit(Pressure, &["psi"], (POUND_FORCE_N, INCH_M * INCH_M, 0.0)),
        unit(Pressure, &["atm"], (101_325.0, 1.0, 0.0)),
        unit(Temperature, &["degC", "C", "celsius"], (1.0, 1.0, 0.0)),
        unit(Temperature, &["K", "kelvin"], (1.0, 1.0, -273.15)),
        unit(Temperature, &["degF", "F", "fahrenheit"], (5.0, 9.0, -160.0 / 9.0)),
    ]
};

/// Conversion of a column's numbers to the contract's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Conversion {
    linear: LinearConversion,
    sign: f64,
    /// Offset in the column's unit.
    offset: f64,
    date_order: Option<DateOrder>,
}

impl Conversion {
    /// Converts a number of the column to the contract's unit.
    #[inline]
    pub fn apply(&self, value: f64) -> f64 {
        let (times, over, plus) = self.linear;
        self.sign * (value * times / over + plus) + self.offset
    }

    /// Returns the order of day, month and year, if it was given in place of a unit.
    pub fn date_order(&self) -> Option<DateOrder> {
        self.date_order
    }

    /// Returns the nanoseconds in one unit of time.
    pub fn nanoseconds(&self) -> i128 {
        let (times, over, _) = self.linear;
        (1e9 * times / over) as i128
    }
}

/// Returns the dimension of a contract column, by the unit in its name; `None` for `run`.
fn dimension(contract_name: &str) -> Option<Dimension> {
    let (quantity, kind) = Quantity::parse(contract_name)?;
    let symbol = normalise(quantity.unit(kind.unwrap_or(JointKind::Revolute)));
    UNITS.iter().find(|unit| unit.symbols.contains(&symbol.as_str())).map(|unit| unit.dimension)
}

/// Returns true if a contract column has a unit: all but `run`.
pub(super) fn has_unit(contract_name: &str) -> bool {
    dimension(contract_name).is_some()
}

fn units_of(dimension: Dimension) -> impl Iterator<Item = &'static Unit> {
    UNITS.iter().filter(move |unit| unit.dimension == dimension)
}

/// Removes the differences between notations of one unit.
fn normalise(symbol: &str) -> String {
    let mut text = String::new();
    for c in symbol.trim().chars() {
        match c {
            ' ' | '·' | '⋅' | '*' | '.' | '-' | '_' | '^' | '\u{a0}' => {}
            '°' => text.push_str("deg"),
            'µ' | 'μ' => text.push('u'),
            '²' => text.push('2'),
            '¹' => text.push('1'),
            '⁻' => {}
            other => text.push(other),
        }
    }
    match text.strip_suffix("/sec") {
        Some(head) => format!("{head}/s"),
        None => text,
    }
}

/// Returns the unit with a symbol. If no symbol matches exactly, case is ignored, provided that one unit remains.
fn find(symbol: &str, dimension: Dimension) -> Option<&'static Unit> {
    let symbol = normalise(symbol);
    let exact = units_of(dimension).find(|unit| unit.symbols.contains(&symbol.as_str()));
    exact.or_else(|| {
        let alike = |unit: &&Unit| unit.symbols.iter().any(|of| of.eq_ignore_ascii_case(&symbol));
        let mut all = units_of(dimension).filter(alike);
        all.next().filter(|_| all.next().is_none())
    })
}

/// Symbols of the counts of an encoder. The number before them is that of a turn, not of a count.
const COUNTS: [&str; 8] = ["counts", "count", "cpr", "ticks", "lsb", "cnt", "inc", "qc"];

/// A unit with the numbers beside it: `-4.2/1000Nm+0.3`.
struct Scaled {
    unit: &'static Unit,
    times: f64,
    over: f64,
    offset: f64,
}

/// Parses a unit without its sign. The whole text is tried as a unit before its parts, because units contain digits
/// (`1/min`, `rad/s2`).
fn parse_scaled(text: &str, dimension: Dimension) -> Option<Scaled> {
    if let Some(unit) = find(text, dimension) {
        return Some(Scaled { unit, times: 1.0, over: 1.0, offset: 0.0 });
    }
    let offset_at = text.rfind(['+', '-']).filter(|at| !text[..*at].ends_with(['e', 'E']));
    let with_offset = offset_at.and_then(|at| {
        let offset = text[at..].parse::<f64>().ok().filter(|offset| offset.is_finite())?;
        Some(Scaled { offset, ..parse_scaled(&text[..at], dimension)? })
    });
    with_offset.or_else(|| {
        let (number, symbol) = leading_number(text)?;
        let (over, symbol) = match symbol.strip_prefix('/').and_then(leading_number) {
            Some((over, symbol)) => (over, symbol),
            None => (1.0, symbol),
        };
        let is_size = |number: f64| number.is_finite() && number > 0.0;
        let unit = find(symbol, dimension);
        let counts = || counts(symbol, dimension).filter(|_| over == 1.0);
        let scaled = match unit {
            Some(unit) => Scaled { unit, times: number, over, offset: 0.0 },
            None => Scaled { unit: counts()?, times: 1.0, over: number, offset: 0.0 },
        };
        (is_size(number) && is_size(over)).then_some(scaled)
    })
}

/// Returns the turn, or the turn per second, for the counts of an encoder.
fn counts(symbol: &str, dimension: Dimension) -> Option<&'static Unit> {
    let (symbol, turn) = match symbol.split_once('/') {
        None => (symbol, "turn"),
        Some((symbol, "s")) => (symbol, "turn/s"),
        Some((symbol, "min")) => (symbol, "rpm"),
        Some(_) => return None,
    };
    let symbol = normalise(symbol).to_lowercase();
    COUNTS.contains(&symbol.as_str()).then(|| find(turn, dimension))?
}

/// Splits a text into the number that it starts with and the rest.
fn leading_number(text: &str) -> Option<(f64, &str)> {
    let lengths = text.char_indices().map(|(at, c)| at + c.len_utf8());
    let longest = lengths.rev().find(|end| text[..*end].parse::<f64>().is_ok())?;
    // A name of a unit may start like a number: `inf`, `nan`.
    let is_number = text.starts_with(|c: char| c.is_ascii_digit() || c == '.');
    is_number.then(|| (text[..longest].parse().unwrap_or(f64::NAN), text[longest..].trim_start()))
}

/// Returns the conversion from `symbol`, with an optional minus before it, to the unit of a contract column.
///
/// # Errors
/// The expected units, as the end of a message.
pub(super) fn conversion(contract_name: &str, symbol: &str) -> Result<Conversion, String> {
    let Some(dimension) = dimension(contract_name) else {
        return Err(format!("no unit: {contract_name} has none"));
    };
    let symbol = symbol.trim();
    let date_order = DateOrder::parse(symbol).filter(|_| dimension == Dimension::Time);
    if date_order.is_some() {
        return Ok(Conversion { linear: (1.0, 1.0, 0.0), sign: 1.0, offset: 0.0, date_order });
    }
    let (sign, bare) = match symbol.strip_prefix(['-', '−']) {
        Some(bare) if dimension != Dimension::Time => (-1.0, bare.trim_start()),
        _ => (1.0, symbol),
    };
    if let Some(Scaled { unit, times, over, offset }) = parse_scaled(bare, dimension) {
        let (factor, divisor, plus) = unit.conversion;
        let offset = offset * factor / divisor;
        let linear = (times * factor, over * divisor, plus);
        return Ok(Conversion { linear, sign, offset, date_order: None });
    }
    if counts(bare, dimension).is_some() {
        return Err("the counts of a turn before the unit, as 4096counts".into());
    }
    if bare.ends_with('%') && dimension == Dimension::Torque {
        return Err(format!("{}, which 100 % stands for", Setting::RatedTorque.alone()));
    }
    let known: Vec<&str> = units_of(dimension).map(|unit| unit.symbols[0]).collect();
    Err(format!("one of {}", known.join(", ")))
}

/// Parses a value with its unit, such as `1.2Nm`, and returns it in the unit of a contract column.
///
/// # Errors
/// The expected units, as the end of a message.
pub fn parse_value(contract_name: &str, text: &str) -> Result<f64, String> {
    let is_value = text.trim().trim_start_matches('-').starts_with(|c: char| c.is_ascii_digit());
    if !is_value {
        return Err("a number with a unit, such as 1.2Nm".into());
    }
    Ok(conversion(contract_name, text)?.apply(1.0))
}

/// Returns true if the symbol is a known unit. The text after a colon in a header's own name mostly is not.
pub(super) fn is_symbol(symbol: &str) -> bool {
    let text = symbol.trim().trim_start_matches(['-', '−']);
    let is_any = |text: &str| {
        let bare = normalise(text).to_lowercase();
        COUNTS.contains(&bare.as_str())
            || UNITS.iter().any(|unit| unit.symbols.iter().any(|of| of.eq_ignore_ascii_case(&bare)))
    };
    is_any(text) || leading_number(text).is_some_and(|(_, unit)| is_any(unit))
}

/// Returns the unit at the end of a column's name, if the contract column could be in it and it is not the contract's
/// own unit: `speed_rpm`, `t (ms)`, `tau[mNm]`, `omega_deg_s`.
pub(crate) fn in_name(contract_name: &str, foreign: &str) -> Option<&'static str> {
    // ROS uses this name for stamps in nanoseconds in its plain-text logs.
    if dimension(contract_name)? == Dimension::Time && foreign == "%time" {
        return Some("ns");
    }
    let unit = at_end(contract_name, foreign)?;
    (unit.conversion != (1.0, 1.0, 0.0)).then_some(unit.symbols[0])
}

/// Returns the unit at the end of a column's name, if the contract column could be in it.
pub(super) fn stated(contract_name: &str, foreign: &str) -> Option<&'static str> {
    at_end(contract_name, foreign).map(|unit| unit.symbols[0])
}

fn at_end(contract_name: &str, foreign: &str) -> Option<&'static Unit> {
    let dimension = dimension(contract_name)?;
    let text = foreign.trim_end();
    let bracketed = [('[', ']'), ('(', ')'), ('{', '}')].iter().find_map(|(open, close)| {
        let inside = text.strip_suffix(*close)?;
        Some(inside[inside.rfind(*open)? + open.len_utf8()..].to_owned())
    });
    match bracketed {
        Some(symbol) => find(&symbol, dimension),
        None => suffix(text, dimension),
    }
}

/// Returns the unit that the last words of a name form. Three words are tried before two and one.
fn suffix(name: &str, dimension: Dimension) -> Option<&'static Unit> {
    let words: Vec<&str> = name.split(['_', ' ', '.', '-']).filter(|w| !w.is_empty()).collect();
    (1..=3.min(words.len())).rev().find_map(|count| {
        let last = &words[words.len() - count..];
        let ratio: Vec<&str> = last.iter().copied().filter(|word| *word != "per").collect();
        find(&ratio.join("/"), dimension).or_else(|| find(&last.concat(), dimension))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setting::plain;

    fn in_si(contract_name: &str, symbol: &str, value: f64) -> f64 {
        conversion(contract_name, symbol).unwrap().apply(value)
    }

    #[test]
    fn conversion_with_common_units_returns_si_values() {
        for (name, symbol, value, expected) in [
            ("time_s", "ms", 1.0, 0.001),
            ("time_s", "µs", 3.0, 3e-6),
            ("time_s", "min", 2.0, 120.0),
            ("velocity_rad_s", "rpm", 60.0, TURN_RAD),
            ("velocity_rad_s", "tr/min", 60.0, TURN_RAD),
            ("velocity_rad_s", "min⁻¹", 60.0, TURN_RAD),
            ("velocity_rad_s", "deg/sec", 180.0, TURN_RAD / 2.0),
            ("velocity_rad_s", "°/s", 180.0, TURN_RAD / 2.0),
            ("velocity_rad_s", "deg/s", 180.0, TURN_RAD / 2.0),
            ("velocity_m_s", "mm/s", 5.0, 0.005),
            ("position_rad", "deg", 90.0, TURN_RAD / 4.0),
            ("position_m", "mm", 7.0, 0.007),
            ("acceleration_rad_s2", "deg/s²", 360.0, TURN_RAD),
            ("torque_nm", "N·mm", 1500.0, 1.5),
            ("torque_nm", "mNm", 1500.0, 1.5),
            ("torque_nm", "-Nm", 2.0, -2.0),
            ("force_n", "kN", 2.0, 2000.0),
            ("pressure_diff_pa", "bar", 3.0, 3e5),
            ("pressure_diff_pa", "MPa", 3.0, 3e6),
            ("pressure_diff_pa", "psi", 1.0, 6_894.757_293_168_361),
            ("temperature_c", "K", 300.0, 26.850_000_000_000_023),
            ("temperature_c", "degF", 212.0, 100.0),
            ("time_s", "days", 0.5, 43_200.0),
            ("velocity_rad_s", "0.229rpm", 100.0, 22.9 * TURN_RAD / 60.0),
            ("velocity_rad_s", "0.5 1/min", 100.0, 50.0 * TURN_RAD / 60.0),
            ("velocity_rad_s", "-4096counts/s", 4096.0, -TURN_RAD),
            ("position_rad", "4096counts", 1024.0, TURN_RAD / 4.0),
            ("position_rad", "360cpr-1.5", 0.0, -1.5 * TURN_RAD),
            ("torque_nm", "4.2/1000Nm", 500.0, 2.1),
            ("torque_nm", "-1e-3Nm", 500.0, -0.5),
            ("pressure_diff_pa", "0.0122bar-1.5", 1000.0, 1.07e6),
            ("temperature_c", "0.1degC-40", 650.0, 25.0),
            ("temperature_c", "0.01K", 30_000.0, 26.850_000_000_000_023),
        ] {
            let found = in_si(name, symbol, value);
            assert!((found / expected - 1.0).abs() < 1e-12, "{name} {symbol}: {found}");
        }
    }

    #[test]
    fn conversion_ignores_case_unless_ambiguous() {
        assert_eq!(in_si("pressure_diff_pa", "mpa", 1.0), 1e6);
        assert_eq!(in_si("velocity_rad_s", "RPM", 60.0), in_si("velocity_rad_s", "rpm", 60.0));
        assert_eq!(in_si("force_n", "MN", 1.0), 1e6);
        assert_eq!(in_si("force_n", "mN", 1.0), 1e-3);
        assert!(conversion("force_n", "mn").is_err(), "a millinewton or a meganewton");
    }

    #[test]
    fn conversion_with_other_dimension_lists_valid_units() {
        let error = conversion("velocity_rad_s", "Nm").unwrap_err();
        assert_eq!(error, "one of rad/s, mrad/s, deg/s, rpm, rps");
        assert!(conversion("run", "s").unwrap_err().contains("no unit"));
    }

    #[test]
    fn conversion_with_invalid_scale_says_what_is_expected() {
        for (name, symbol, expected) in [
            ("position_rad", "counts", "the counts of a turn before the unit, as 4096counts"),
            ("position_rad", "0counts", "one of rad, mrad, deg, rev"),
            ("position_rad", "1/0deg", "one of rad, mrad, deg, rev"),
            ("position_rad", "infdeg", "one of rad, mrad, deg, rev"),
            ("torque_nm", "%", "rated torque, which 100 % stands for"),
            ("torque_nm", "0.1%", "rated torque, which 100 % stands for"),
        ] {
            assert_eq!(plain(&conversion(name, symbol).unwrap_err()), expected, "{symbol}");
        }
    }

    #[test]
    fn in_name_with_unit_suffix_returns_unit() {
        for (name, foreign, unit) in [
            ("velocity_rad_s", "speed_rpm", Some("rpm")),
            ("velocity_rad_s", "speed [1/min]", Some("rpm")),
            ("velocity_rad_s", "omega_deg_s", Some("deg/s")),
            ("velocity_rad_s", "omega_deg_per_s", Some("deg/s")),
            ("velocity_rad_s", "omega_rad_s", None),
            ("velocity_rad_s", "dq_3", None),
            ("time_s", "t (ms)", Some("ms")),
            ("time_s", "t_s", None),
            ("time_s", "%time", Some("ns")),
            ("torque_nm", "motor_force_N", None),
            ("torque_nm", "drive_voltage_v", None),
            ("torque_nm", "tau_mNm", Some("mNm")),
            ("pressure_diff_pa", "p_bar", Some("bar")),
            ("temperature_c", "oil [°F]", Some("degF")),
            ("run", "trial_s", None),
        ] {
            assert_eq!(in_name(name, foreign), unit, "{foreign}");
        }
    }
}
