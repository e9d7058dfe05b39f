//! Registers with a sign bit that the log holds as positive numbers.
//!
//! Servos of hobby and research robots report a speed or a load as a magnitude with the sign in the bit above it, mostly bit 10
//! or 15. A log of the plain number has large speeds where the joint turns backwards. The position shows it: with the sign
//! bit the velocity follows the derivative of the position, without it not.

use super::column::Column;
use super::log::Log;
use super::suspicion::Suspicion;
use super::{LogFindingKind, header};
use crate::motion::quantum;
use crate::statistics::correlation;
use crate::torque_scale::amperes;
use crate::unit::conversion;
use crate::{Quantity, differences};

/// Bits that hold a sign in known registers, and those between.
const SIGN_BITS: std::ops::RangeInclusive<u32> = 7..=15;

/// Maximum distance of a value from a whole number of counts, caused by the rounding of its unit.
const MAX_FRACTION: f64 = 1e-3;

/// Minimum number of rows with and without the sign bit.
const MIN_ROWS: usize = 20;

/// Minimum correlation with the position's derivative if the sign bit is read.
const MIN_CORRELATION: f64 = 0.8;

/// Maximum correlation with it as logged.
const MAX_LOGGED_CORRELATION: f64 = 0.5;

/// Minimum gap below the bit, and maximum least magnitude, as shares of the bit.
const MIN_GAP: f64 = 0.2;
const MAX_BEGIN: f64 = 0.03;

/// A column whose sign bit is read as a part of the number.
pub struct SignBit {
    /// The name of the column in the contract.
    pub name: String,
    /// The unit to give in `--columns`.
    pub unit: String,
    /// The bit.
    pub bit: u32,
    /// The values with their sign, counts.
    pub values: Vec<Vec<f64>>,
    /// The size of a count in the unit of the contract.
    pub size: f64,
}

impl SignBit {
    /// Returns true if the numbers with the bit begin anew at its value, as magnitudes do, above a gap: a number without a sign
    /// passes through the values below.
    pub fn begins_anew(&self) -> bool {
        let sign = 2f64.powi(self.bit as i32);
        let counts = || self.values.iter().flatten().copied();
        let largest = |of: f64| counts().map(|count| count * of).fold(0.0, f64::max);
        let nearly_0 =
            |of: f64| counts().any(|count| count * of > 0.0 && count * of <= MAX_BEGIN * sign);
        largest(1.0) < (1.0 - MIN_GAP) * sign && nearly_0(1.0) && nearly_0(-1.0)
    }

    /// Returns the pair of `--columns` that reads it.
    pub fn pair(&self, log: &Log) -> String {
        format!("{}={}:{}", self.name, header(log.data, &self.name), self.unit)
    }
}

/// Returns the reason to refuse a velocity with a sign bit, and the torque if it has one too.
pub fn suspicion(log: &Log) -> Option<Suspicion> {
    let velocity = log.column(log.velocity()).and_then(|column| sign_bit(log, column))?;
    let runs = log.data.runs.iter().zip(log.data.columns_of(Quantity::Position)?);
    let derivatives: Vec<f64> =
        runs.flat_map(|(run, position)| differences(&run.time_s, position)).collect();
    let derivatives = derivatives.iter().copied();
    let signed = velocity.values.iter().flatten().copied();
    let logged = log.data.runs.iter().flat_map(|run| run.velocity.iter().copied());
    if correlation(signed.zip(derivatives.clone())) < MIN_CORRELATION
        || correlation(logged.zip(derivatives)) > MAX_LOGGED_CORRELATION
    {
        return None;
    }
    let torque = log.column(log.torque()).and_then(|column| sign_bit(log, column));
    let bits = [Some(velocity), torque].into_iter().flatten().collect();
    Some(refusal(log, bits, &format!("contradicts {}", log.position())))
}

/// Returns the reason to refuse columns with a sign bit; `evidence` says how the first shows it.
pub fn refusal(log: &Log, bits: Vec<SignBit>, evidence: &str) -> Suspicion {
    let names: Vec<&str> = bits.iter().map(|bit| bit.name.as_str()).collect();
    let found = format!("a {} that {evidence}, whose bit {} is its sign", names[0], bits[0].bit);
    let pairs = bits.iter().map(|bit| bit.pair(log)).collect::<Vec<_>>().join(",");
    Suspicion::typed(LogFindingKind::SignBit, &names, found, &[pairs])
}

/// Returns the sign bit of a column of whole positive counts: the highest bit, if it is set in many rows and not in others.
pub fn sign_bit(log: &Log, column: &Column) -> Option<SignBit> {
    let unit = log.data.given_unit(&column.name);
    let conversion = unit.and_then(|unit| conversion(&column.name, unit).ok());
    if conversion.is_some_and(|conversion| conversion.is_signed_counter()) {
        return None;
    }
    // The scale of a current is known; another one that is given beside the unit, such as the rated torque, is in the steps of
    // the column.
    let amperes = || amperes(unit?).zip(log.data.torque_constant);
    let of_current = amperes().map(|(amperes, constant)| (amperes * constant).abs());
    let step = of_current.unwrap_or_else(|| quantum(column.runs.iter().copied()));
    let is_scaled = conversion.is_none() && unit.is_some() && step > 0.0;
    let size = if is_scaled { step } else { 1.0 };
    let size = conversion.map_or(size, |of| (of.apply(1.0) - of.apply(0.0)).abs());
    let count = |value: f64| conversion.map_or(value / size, |of| of.inverse(value));
    let is_count = |value: f64| {
        let count = count(value);
        count > -0.5 && (count - count.round()).abs() < MAX_FRACTION
    };
    if !column.values().all(is_count) {
        return None;
    }
    let largest = column.values().map(count).fold(0.0, f64::max);
    let bit = largest.max(1.0).log2().floor() as u32;
    let sign = 2f64.powi(bit as i32);
    let negative = column.values().filter(|value| count(*value) >= sign).count();
    let positive = column.values().count() - negative;
    if !SIGN_BITS.contains(&bit) || negative.min(positive) < MIN_ROWS {
        return None;
    }
    let signed = |value: &f64| {
        let count = count(*value);
        if count >= sign { sign - count } else { count }
    };
    let values = column.runs.iter().map(|run| run.iter().map(signed).collect()).collect();
    let unit = format!("sign{bit} {}", unit.unwrap_or(&column.unit));
    Some(SignBit { name: column.name.clone(), unit, bit, values, size })
}
