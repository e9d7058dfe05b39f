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
//! A register whose sign the log lost takes its kind before the size of a count: `tau:int16 0.01Nm` for two's complement,
//! `Present Speed:sign10 0.111rpm` if bit 10 is the sign.
//!
//! A unit in a column's own name (`speed_rpm`, `t (ms)`) is neither applied nor ignored. Without an explicit unit the
//! column is an error, whose message shows the option to use ([`in_name`]).

mod register;
mod table;

use super::contract;
use super::date::DateOrder;
use crate::setting::Setting;
use compensator_core::quantity::JointKind;
use register::Register;
pub(super) use register::split_register;
use table::{Dimension, Linear, SAME, UNITS, Unit};

/// Conversion of a column's numbers to the contract's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Conversion {
    linear: Linear,
    sign: f64,
    /// Offset in the column's unit.
    offset: f64,
    date_order: Option<DateOrder>,
    register: Register,
}

impl Conversion {
    const UNCHANGED: Self =
        Self { linear: SAME, sign: 1.0, offset: 0.0, date_order: None, register: Register::Signed };

    /// Returns the conversion of counts, each of a size in the contract's unit, which may be negative.
    pub fn of_count(size: f64, register: Register) -> Self {
        let linear = Linear { factor: size.abs(), ..SAME };
        Self { linear, sign: size.signum(), register, ..Self::UNCHANGED }
    }

    /// Converts a number of the column to the contract's unit.
    #[inline]
    pub fn apply(&self, value: f64) -> f64 {
        let Linear { factor, divisor, offset } = self.linear;
        let value = self.register.signed(value);
        self.sign * (value * factor / divisor + offset) + self.offset
    }

    /// Returns the number in the column, without the sign of a counter.
    pub fn inverse(&self, value: f64) -> f64 {
        let Linear { factor, divisor, offset } = self.linear;
        ((value - self.offset) / self.sign - offset) * divisor / factor
    }

    /// Returns true if the column is read as a register without a sign of its own.
    pub fn is_signed_counter(&self) -> bool {
        self.register != Register::Signed
    }

    /// Returns the order of day, month and year, if it was given in place of a unit.
    pub fn date_order(&self) -> Option<DateOrder> {
        self.date_order
    }

    /// Returns the nanoseconds in one unit of time; `None` if they are, beyond rounding errors, no whole number.
    pub fn nanoseconds(&self) -> Option<i128> {
        let ns = 1e9 * self.linear.factor / self.linear.divisor;
        let is_whole = (ns - ns.round()).abs() <= 4.0 * f64::EPSILON * ns && ns.round() > 0.0;
        is_whole.then_some(ns.round() as i128)
    }
}

/// Returns the dimension of a contract column, by the unit in its name; `None` for `run`.
fn dimension(contract_name: &str) -> Option<Dimension> {
    let (quantity, kind) = contract::quantity_of(contract_name)?;
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
    // A name of a unit may start like a number: `inf`, `nan`.
    if !text.starts_with(|c: char| c.is_ascii_digit() || c == '.') {
        return None;
    }
    let ends = text.char_indices().map(|(at, c)| at + c.len_utf8());
    ends.rev().find_map(|end| Some((text[..end].parse().ok()?, text[end..].trim_start())))
}

/// Why a text is no unit of a column, displayed as what is expected instead.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnitError {
    /// The column of this name has no unit.
    #[error("no unit: {0} has none")]
    OfText(String),
    /// Counts without their number.
    #[error("the counts of a turn before the unit, as 4096counts")]
    CountsOfTurn,
    /// A share of a rated torque that is not known.
    #[error("{}, which 100 % stands for", Setting::RatedTorque.alone())]
    RatedTorque,
    /// The unit is none of these.
    #[error("one of {}", .0.join(", "))]
    Unknown(Vec<&'static str>),
    /// The text does not begin with a number.
    #[error("a number with a unit, such as 1.2Nm")]
    NoValue,
}

/// Returns the conversion from `symbol`, with an optional minus before it, to the unit of a contract column.
///
/// # Errors
/// The expected units, as the end of a message.
pub(super) fn conversion(contract_name: &str, symbol: &str) -> Result<Conversion, UnitError> {
    let Some(dimension) = dimension(contract_name) else {
        return Err(UnitError::OfText(contract_name.to_owned()));
    };
    let symbol = symbol.trim();
    let date_order = DateOrder::parse(symbol).filter(|_| dimension == Dimension::Time);
    if date_order.is_some() {
        return Ok(Conversion { date_order, ..Conversion::UNCHANGED });
    }
    let register = Register::parse(symbol).filter(|_| dimension != Dimension::Time);
    if let Some((register, unit)) = register {
        let of_count = match unit {
            "" => Conversion::UNCHANGED,
            unit => conversion(contract_name, unit)?,
        };
        return Ok(Conversion { register, ..of_count });
    }
    let (sign, bare) = match symbol.strip_prefix(['-', '−']) {
        Some(bare) if dimension != Dimension::Time => (-1.0, bare.trim_start()),
        _ => (1.0, symbol),
    };
    if let Some(Scaled { unit, times, over, offset }) = parse_scaled(bare, dimension) {
        let Linear { factor, divisor, .. } = unit.linear;
        let offset = offset * factor / divisor;
        let linear = Linear { factor: times * factor, divisor: over * divisor, ..unit.linear };
        return Ok(Conversion { linear, sign, offset, ..Conversion::UNCHANGED });
    }
    if counts(bare, dimension).is_some() {
        return Err(UnitError::CountsOfTurn);
    }
    if bare.ends_with('%') && dimension == Dimension::Torque {
        return Err(UnitError::RatedTorque);
    }
    Err(UnitError::Unknown(units_of(dimension).map(|unit| unit.symbols[0]).collect()))
}

/// Returns the number in a column for one unit of the contract; `None` if `symbol` is no unit of the contract column.
pub(super) fn size(contract_name: &str, symbol: &str) -> Option<f64> {
    Some(conversion(contract_name, symbol).ok()?.inverse(1.0))
}

/// Parses a value with its unit, such as `1.2Nm`, and returns it in the unit of a contract column.
///
/// # Errors
/// The expected units, as the end of a message.
pub fn parse_value(contract_name: &str, text: &str) -> Result<f64, UnitError> {
    let is_value = text.trim().trim_start_matches('-').starts_with(|c: char| c.is_ascii_digit());
    if !is_value {
        return Err(UnitError::NoValue);
    }
    Ok(conversion(contract_name, text)?.apply(1.0))
}

/// Returns the unit in a cell, which may be in brackets or quotes.
pub(super) fn in_cell(cell: &[u8]) -> String {
    String::from_utf8_lossy(cell).trim_matches(['[', ']', '(', ')', '"', ' ']).to_owned()
}

/// A unit with the number in a column for one unit of the contract.
#[derive(Clone, Copy)]
pub(super) struct SizedUnit {
    pub unit: &'static str,
    pub size: f64,
}

/// Returns units of a contract column with their sizes.
pub(super) fn sized(contract_name: &str, units: &[&'static str]) -> Vec<SizedUnit> {
    let sized = |unit: &&'static str| Some(SizedUnit { unit, size: size(contract_name, unit)? });
    units.iter().filter_map(sized).collect()
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
    (unit.linear != SAME).then_some(unit.symbols[0])
}

/// Returns the unit at the end of a column's name, if the contract column could be in it.
pub(super) fn stated(contract_name: &str, foreign: &str) -> Option<&'static str> {
    at_end(contract_name, foreign).map(|unit| unit.symbols[0])
}

/// Returns true if the case of the unit at the end of a column's name leaves two: `force_mn` may be mN or MN.
pub(super) fn is_ambiguous(contract_name: &str, foreign: &str) -> bool {
    let last =
        bracketed(foreign).or_else(|| foreign.rsplit(['_', ' ', '.']).next().map(str::to_owned));
    let (symbol, dimension) = (normalise(&last.unwrap_or_default()), dimension(contract_name));
    let is_it = |unit: &Unit| unit.symbols.iter().any(|of| of.eq_ignore_ascii_case(&symbol));
    dimension.is_some_and(|of| find(&symbol, of).is_none() && units_of(of).any(is_it))
}

fn at_end(contract_name: &str, foreign: &str) -> Option<&'static Unit> {
    let dimension = dimension(contract_name)?;
    let text = foreign.trim_end();
    match bracketed(text) {
        Some(symbol) => find(&symbol, dimension),
        // The last letter of a longer unit is no unit: `deg_s` is not in seconds.
        None => suffix(text, dimension)
            .filter(|unit| unit.symbols[0].len() > 1 || !is_part_of_unit(text)),
    }
}

/// Splits a name into what is before the brackets at its end, and the text in these.
fn split_brackets(text: &str) -> Option<(&str, &str)> {
    [('[', ']'), ('(', ')'), ('{', '}')]
        .iter()
        .find_map(|(open, close)| text.strip_suffix(*close)?.rsplit_once(*open))
}

/// Returns the text in brackets at the end of a name.
fn bracketed(text: &str) -> Option<String> {
    split_brackets(text).map(|(_, inside)| inside.to_owned())
}

/// Returns a name without brackets at its end; the name itself if there is nothing else.
pub(super) fn without_brackets(name: &str) -> &str {
    let head = split_brackets(name.trim_end()).map(|(head, _)| head);
    head.filter(|head| !head.trim().is_empty()).unwrap_or(name)
}

/// Returns true if the last word of a name is a part of a longer unit.
fn is_part_of_unit(name: &str) -> bool {
    let last = name.rsplit(['_', ' ', '.', '-']).find(|word| !word.is_empty());
    any_in_name(name).is_some_and(|unit| unit.contains('/') && Some(unit) != last)
}

/// Returns the unit that the last words of a name form, of any quantity: the longest, so that `bucket_deg_s` is in deg/s.
pub(crate) fn any_in_name(name: &str) -> Option<&'static str> {
    use Dimension::*;
    let motions = [AngularAcceleration, AngularVelocity, Acceleration, Velocity];
    let others = [Torque, Force, Pressure, Angle, Length, Temperature, Time];
    let all = motions.into_iter().chain(others);
    if let Some(symbol) = bracketed(name.trim_end()) {
        return all.clone().find_map(|of| find(&symbol, of)).map(|unit| unit.symbols[0]);
    }
    (1..=3).rev().find_map(|count| {
        let unit = all.clone().find_map(|of| of_last_words(name.trim_end(), count, of));
        unit.map(|unit| unit.symbols[0])
    })
}

/// Returns the unit that the last words of a name form. Three words are tried before two and one.
fn suffix(name: &str, dimension: Dimension) -> Option<&'static Unit> {
    (1..=3).rev().find_map(|count| of_last_words(name, count, dimension))
}

/// Returns the unit that some last words of a name form.
fn of_last_words(name: &str, count: usize, dimension: Dimension) -> Option<&'static Unit> {
    let words: Vec<&str> = name.split(['_', ' ', '.', '-']).filter(|w| !w.is_empty()).collect();
    let last = &words[words.len().checked_sub(count)?..];
    let ratio: Vec<&str> = last.iter().copied().filter(|word| *word != "per").collect();
    // A symbol before a unit is no prefix of it: `M_Nm`.
    let is_prefix = count > 1 && last[0].len() == 1 && !last[0].eq_ignore_ascii_case("n");
    let joined = || (!is_prefix).then(|| last.concat());
    find(&ratio.join("/"), dimension).or_else(|| find(&joined()?, dimension))
}

#[cfg(test)]
mod tests;
