//! Units a log may be in, and the way from each to the unit of the contract.
//!
//! The contract's names hold their units (`velocity_rad_s`), so what a column must become is known; what it is in
//! is said after a colon, `--columns velocity_rad_s=speed:rpm`. A minus before the unit turns the sign
//! (`torque_nm=tau:-Nm`). Symbols are taken as they are commonly written: `N·mm`, `N*mm` and `Nmm` are one unit, `°/s`,
//! `deg/s` and `dps` another; case counts only where it must (mN, MN). A unit of another dimension is refused.
//!
//! A header that names a unit itself (`speed_rpm`, `t (ms)`) is not believed and not overlooked: without a unit said
//! it is refused, with the words to type ([`in_name`]).

use compensator_core::quantity::{JointKind, Quantity};

/// What a unit measures.
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

/// From a unit to the contract's: times the first, over the second, plus the third. Over as well as times, so that
/// a millisecond is the number 0.001 and not one beside it.
type Way = (f64, f64, f64);

/// A unit with the ways it is written, after [`plain`].
struct Unit {
    of: Dimension,
    symbols: &'static [&'static str],
    way: Way,
}

const fn unit(of: Dimension, symbols: &'static [&'static str], way: Way) -> Unit {
    Unit { of, symbols, way }
}

const TURN: f64 = std::f64::consts::TAU;
const GRAVITY: f64 = 9.806_65;
const INCH: f64 = 0.0254;
const POUND: f64 = 4.448_221_615_260_5;

/// The contract's own unit is the first of each dimension.
const UNITS: &[Unit] = {
    use Dimension::*;
    &[
        unit(Time, &["s", "sec", "seconds", "iso", "iso8601"], (1.0, 1.0, 0.0)),
        unit(Time, &["ms", "msec", "millis", "milliseconds"], (1.0, 1e3, 0.0)),
        unit(Time, &["us", "usec", "micros", "microseconds"], (1.0, 1e6, 0.0)),
        unit(Time, &["ns", "nsec", "nanos", "nanoseconds", "nanosec"], (1.0, 1e9, 0.0)),
        unit(Time, &["min", "minutes"], (60.0, 1.0, 0.0)),
        unit(Time, &["h", "hours"], (3600.0, 1.0, 0.0)),
        unit(Angle, &["rad"], (1.0, 1.0, 0.0)),
        unit(Angle, &["mrad"], (1.0, 1e3, 0.0)),
        unit(Angle, &["deg", "degrees"], (TURN, 360.0, 0.0)),
        unit(Angle, &["rev", "turn", "turns", "revolutions"], (TURN, 1.0, 0.0)),
        unit(AngularVelocity, &["rad/s", "radps", "rads1"], (1.0, 1.0, 0.0)),
        unit(AngularVelocity, &["mrad/s"], (1.0, 1e3, 0.0)),
        unit(AngularVelocity, &["deg/s", "degps", "dps"], (TURN, 360.0, 0.0)),
        unit(AngularVelocity, &["rpm", "1/min", "r/min", "rev/min", "U/min"], (TURN, 60.0, 0.0)),
        unit(AngularVelocity, &["rps", "rev/s", "turn/s", "turns/s"], (TURN, 1.0, 0.0)),
        unit(AngularAcceleration, &["rad/s2", "rad/s/s"], (1.0, 1.0, 0.0)),
        unit(AngularAcceleration, &["deg/s2", "deg/s/s"], (TURN, 360.0, 0.0)),
        unit(AngularAcceleration, &["rpm/s"], (TURN, 60.0, 0.0)),
        unit(AngularAcceleration, &["rev/s2", "turn/s2", "turns/s2"], (TURN, 1.0, 0.0)),
        unit(Length, &["m"], (1.0, 1.0, 0.0)),
        unit(Length, &["cm"], (1.0, 1e2, 0.0)),
        unit(Length, &["mm"], (1.0, 1e3, 0.0)),
        unit(Length, &["um"], (1.0, 1e6, 0.0)),
        unit(Length, &["inch", "inches"], (INCH, 1.0, 0.0)),
        unit(Velocity, &["m/s"], (1.0, 1.0, 0.0)),
        unit(Velocity, &["cm/s"], (1.0, 1e2, 0.0)),
        unit(Velocity, &["mm/s"], (1.0, 1e3, 0.0)),
        unit(Velocity, &["um/s"], (1.0, 1e6, 0.0)),
        unit(Velocity, &["m/min"], (1.0, 60.0, 0.0)),
        unit(Velocity, &["mm/min"], (1.0, 6e4, 0.0)),
        unit(Velocity, &["inch/s", "in/s"], (INCH, 1.0, 0.0)),
        unit(Acceleration, &["m/s2", "m/s/s"], (1.0, 1.0, 0.0)),
        unit(Acceleration, &["cm/s2"], (1.0, 1e2, 0.0)),
        unit(Acceleration, &["mm/s2"], (1.0, 1e3, 0.0)),
        unit(Torque, &["Nm"], (1.0, 1.0, 0.0)),
        unit(Torque, &["cNm", "Ncm"], (1.0, 1e2, 0.0)),
        unit(Torque, &["mNm", "Nmm"], (1.0, 1e3, 0.0)),
        unit(Torque, &["uNm"], (1.0, 1e6, 0.0)),
        unit(Torque, &["kNm"], (1e3, 1.0, 0.0)),
        unit(Torque, &["MNm"], (1e6, 1.0, 0.0)),
        unit(Torque, &["kgcm", "kgfcm"], (GRAVITY, 1e2, 0.0)),
        unit(Torque, &["ozin", "ozfin"], (POUND * INCH, 16.0, 0.0)),
        unit(Torque, &["lbin", "lbfin", "inlb"], (POUND * INCH, 1.0, 0.0)),
        unit(Torque, &["lbft", "lbfft", "ftlb"], (POUND * INCH * 12.0, 1.0, 0.0)),
        unit(Force, &["N"], (1.0, 1.0, 0.0)),
        unit(Force, &["mN"], (1.0, 1e3, 0.0)),
        unit(Force, &["kN"], (1e3, 1.0, 0.0)),
        unit(Force, &["MN"], (1e6, 1.0, 0.0)),
        unit(Force, &["kgf"], (GRAVITY, 1.0, 0.0)),
        unit(Force, &["lbf"], (POUND, 1.0, 0.0)),
        unit(Pressure, &["Pa"], (1.0, 1.0, 0.0)),
        unit(Pressure, &["hPa", "mbar"], (1e2, 1.0, 0.0)),
        unit(Pressure, &["kPa"], (1e3, 1.0, 0.0)),
        unit(Pressure, &["MPa"], (1e6, 1.0, 0.0)),
        unit(Pressure, &["bar"], (1e5, 1.0, 0.0)),
        unit(Pressure, &["psi"], (POUND, INCH * INCH, 0.0)),
        unit(Pressure, &["atm"], (101_325.0, 1.0, 0.0)),
        unit(Temperature, &["degC", "C", "celsius"], (1.0, 1.0, 0.0)),
        unit(Temperature, &["K", "kelvin"], (1.0, 1.0, -273.15)),
        unit(Temperature, &["degF", "F", "fahrenheit"], (5.0, 9.0, -160.0 / 9.0)),
    ]
};

/// How numbers of a column become numbers in the contract's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Conversion {
    way: Way,
    sign: f64,
}

impl Conversion {
    /// A number of the column in the contract's unit.
    #[inline]
    pub fn apply(&self, value: f64) -> f64 {
        let (times, over, plus) = self.way;
        self.sign * (value * times / over + plus)
    }

    /// Of a time: nanoseconds in one unit.
    pub fn nanoseconds(&self) -> i128 {
        let (times, over, _) = self.way;
        (1e9 * times / over) as i128
    }
}

/// The dimension a column of the contract has, by the unit in its name; `None` of `run`.
fn dimension(contract_name: &str) -> Option<Dimension> {
    let (quantity, kind) = Quantity::parse(contract_name)?;
    let symbol = plain(quantity.unit(kind.unwrap_or(JointKind::Revolute)));
    UNITS.iter().find(|unit| unit.symbols.contains(&symbol.as_str())).map(|unit| unit.of)
}

fn of(dimension: Dimension) -> impl Iterator<Item = &'static Unit> {
    UNITS.iter().filter(move |unit| unit.of == dimension)
}

/// A symbol without what is written one way by one and another by the next.
fn plain(symbol: &str) -> String {
    let mut text = String::new();
    for c in symbol.trim().chars() {
        match c {
            ' ' | '·' | '⋅' | '*' | '.' | '-' | '_' | '^' | '\u{a0}' => {}
            '°' => text.push_str("deg"),
            'µ' | 'μ' => text.push('u'),
            '²' => text.push('2'),
            other => text.push(other),
        }
    }
    text
}

/// The unit of that dimension and symbol: as it is written, else whatever the case where that leaves one.
fn find(symbol: &str, dimension: Dimension) -> Option<&'static Unit> {
    let symbol = plain(symbol);
    let exact = of(dimension).find(|unit| unit.symbols.contains(&symbol.as_str()));
    exact.or_else(|| {
        let alike = |unit: &&Unit| unit.symbols.iter().any(|of| of.eq_ignore_ascii_case(&symbol));
        let mut all = of(dimension).filter(alike);
        all.next().filter(|_| all.next().is_none())
    })
}

/// The way from `symbol`, with a minus before it or not, to the unit of that column of the contract; else the units
/// there are.
pub(super) fn conversion(contract_name: &str, symbol: &str) -> Result<Conversion, String> {
    let Some(dimension) = dimension(contract_name) else {
        return Err(format!("no unit, as {contract_name} has none"));
    };
    let symbol = symbol.trim();
    let (sign, bare) = match symbol.strip_prefix(['-', '−']) {
        Some(bare) if dimension != Dimension::Time => (-1.0, bare),
        _ => (1.0, symbol),
    };
    match find(bare, dimension) {
        Some(unit) => Ok(Conversion { way: unit.way, sign }),
        None => {
            let known: Vec<&str> = of(dimension).map(|unit| unit.symbols[0]).collect();
            Err(format!("one of {}", known.join(", ")))
        }
    }
}

/// Whether anything is in a unit written so: what follows a colon in a header's own name is not, mostly.
pub(super) fn is_symbol(symbol: &str) -> bool {
    let bare = plain(symbol.trim().trim_start_matches(['-', '−']));
    UNITS.iter().any(|unit| unit.symbols.iter().any(|of| of.eq_ignore_ascii_case(&bare)))
}

/// The unit a foreign name ends in, if it is one this column of the contract could be in but for its own:
/// `speed_rpm`, `t (ms)`, `tau[mNm]`, `omega_deg_s`.
pub(super) fn in_name(contract_name: &str, foreign: &str) -> Option<&'static str> {
    let dimension = dimension(contract_name)?;
    // ROS stamps its plain-text logs in nanoseconds under this name.
    if dimension == Dimension::Time && foreign == "%time" {
        return Some("ns");
    }
    let text = foreign.trim_end();
    let bracketed = [('[', ']'), ('(', ')'), ('{', '}')].iter().find_map(|(open, close)| {
        let inside = text.strip_suffix(*close)?;
        Some(inside[inside.rfind(*open)? + open.len_utf8()..].to_owned())
    });
    let unit = match bracketed {
        Some(symbol) => find(&symbol, dimension)?,
        None => suffix(text, dimension)?,
    };
    (unit.way != (1.0, 1.0, 0.0)).then_some(unit.symbols[0])
}

/// The unit that the last words of a name make, the most words first.
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

    fn in_si(contract_name: &str, symbol: &str, value: f64) -> f64 {
        conversion(contract_name, symbol).unwrap().apply(value)
    }

    #[test]
    fn units_become_those_of_the_contract() {
        for (name, symbol, value, expected) in [
            ("time_s", "ms", 1.0, 0.001),
            ("time_s", "µs", 3.0, 3e-6),
            ("time_s", "min", 2.0, 120.0),
            ("velocity_rad_s", "rpm", 60.0, TURN),
            ("velocity_rad_s", "°/s", 180.0, TURN / 2.0),
            ("velocity_rad_s", "deg/s", 180.0, TURN / 2.0),
            ("velocity_m_s", "mm/s", 5.0, 0.005),
            ("position_rad", "deg", 90.0, TURN / 4.0),
            ("position_m", "mm", 7.0, 0.007),
            ("acceleration_rad_s2", "deg/s²", 360.0, TURN),
            ("torque_nm", "N·mm", 1500.0, 1.5),
            ("torque_nm", "mNm", 1500.0, 1.5),
            ("torque_nm", "-Nm", 2.0, -2.0),
            ("force_n", "kN", 2.0, 2000.0),
            ("pressure_diff_pa", "bar", 3.0, 3e5),
            ("pressure_diff_pa", "MPa", 3.0, 3e6),
            ("pressure_diff_pa", "psi", 1.0, 6_894.757_293_168_361),
            ("temperature_c", "K", 300.0, 26.850_000_000_000_023),
            ("temperature_c", "degF", 212.0, 100.0),
        ] {
            let found = in_si(name, symbol, value);
            assert!((found / expected - 1.0).abs() < 1e-12, "{name} {symbol}: {found}");
        }
    }

    #[test]
    fn case_counts_only_where_it_must() {
        assert_eq!(in_si("pressure_diff_pa", "mpa", 1.0), 1e6);
        assert_eq!(in_si("velocity_rad_s", "RPM", 60.0), in_si("velocity_rad_s", "rpm", 60.0));
        assert_eq!(in_si("force_n", "MN", 1.0), 1e6);
        assert_eq!(in_si("force_n", "mN", 1.0), 1e-3);
        assert!(conversion("force_n", "mn").is_err(), "a millinewton or a meganewton");
    }

    #[test]
    fn a_unit_of_something_else_is_refused_with_those_there_are() {
        let error = conversion("velocity_rad_s", "Nm").unwrap_err();
        assert_eq!(error, "one of rad/s, mrad/s, deg/s, rpm, rps");
        assert!(conversion("run", "s").unwrap_err().contains("no unit"));
    }

    #[test]
    fn a_unit_in_a_name_is_seen() {
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
