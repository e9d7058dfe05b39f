//! The table of units: their dimensions, notations and conversions.
//!
//! A unit is a row, and reading, messages and suggestions follow. Symbols are as [`normalise`](super::normalise) returns them, without
//! signs of multiplication and with `deg` and `u` in place of the signs of degrees and micro. Notations that differ in case alone
//! (mN, MN) are two rows. Conversions are a product and a quotient of exact numbers where the unit is defined by them.

/// The dimension of a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dimension {
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

/// Conversion to the contract's unit: the value is multiplied, then divided, and the offset is added. The divisor keeps it exact:
/// 1 ms becomes the number nearest to 0.001.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Linear {
    pub factor: f64,
    pub divisor: f64,
    pub offset: f64,
}

pub(super) const SAME: Linear = Linear { factor: 1.0, divisor: 1.0, offset: 0.0 };

/// A unit with its notations.
pub(super) struct Unit {
    pub dimension: Dimension,
    pub symbols: &'static [&'static str],
    pub linear: Linear,
}

const fn unit(
    dimension: Dimension,
    symbols: &'static [&'static str],
    factor: f64,
    divisor: f64,
    offset: f64,
) -> Unit {
    Unit { dimension, symbols, linear: Linear { factor, divisor, offset } }
}

const TURN_RAD: f64 = std::f64::consts::TAU;
const GRAVITY_M_S2: f64 = 9.806_65;
const INCH_M: f64 = 0.0254;
const POUND_FORCE_N: f64 = 4.448_221_615_260_5;

/// The contract's own unit is the first of each dimension.
pub(super) const UNITS: &[Unit] = {
    use Dimension::*;
    &[
        unit(Time, &["s", "sec", "seconds", "iso", "iso8601", "date", "datetime"], 1.0, 1.0, 0.0),
        unit(Time, &["ms", "msec", "millis", "milliseconds"], 1.0, 1e3, 0.0),
        unit(Time, &["us", "usec", "micros", "microseconds"], 1.0, 1e6, 0.0),
        unit(Time, &["ns", "nsec", "nanos", "nanoseconds", "nanosec"], 1.0, 1e9, 0.0),
        unit(Time, &["min", "minutes"], 60.0, 1.0, 0.0),
        unit(Time, &["h", "hours"], 3600.0, 1.0, 0.0),
        unit(Time, &["d", "days"], 86_400.0, 1.0, 0.0),
        unit(Angle, &["rad"], 1.0, 1.0, 0.0),
        unit(Angle, &["mrad"], 1.0, 1e3, 0.0),
        unit(Angle, &["deg", "degrees"], TURN_RAD, 360.0, 0.0),
        unit(Angle, &["rev", "turn", "turns", "revolutions"], TURN_RAD, 1.0, 0.0),
        unit(AngularVelocity, &["rad/s", "radps", "rads1"], 1.0, 1.0, 0.0),
        unit(AngularVelocity, &["mrad/s"], 1.0, 1e3, 0.0),
        unit(AngularVelocity, &["deg/s", "degps", "dps"], TURN_RAD, 360.0, 0.0),
        unit(
            AngularVelocity,
            &["rpm", "1/min", "r/min", "rev/min", "U/min", "tr/min", "giri/min", "min1"],
            TURN_RAD,
            60.0,
            0.0,
        ),
        unit(AngularVelocity, &["rps", "rev/s", "turn/s", "turns/s"], TURN_RAD, 1.0, 0.0),
        unit(AngularAcceleration, &["rad/s2", "rad/s/s"], 1.0, 1.0, 0.0),
        unit(AngularAcceleration, &["deg/s2", "deg/s/s"], TURN_RAD, 360.0, 0.0),
        unit(AngularAcceleration, &["rpm/s"], TURN_RAD, 60.0, 0.0),
        unit(AngularAcceleration, &["rev/s2", "turn/s2", "turns/s2"], TURN_RAD, 1.0, 0.0),
        unit(Length, &["m"], 1.0, 1.0, 0.0),
        unit(Length, &["cm"], 1.0, 1e2, 0.0),
        unit(Length, &["mm"], 1.0, 1e3, 0.0),
        unit(Length, &["um"], 1.0, 1e6, 0.0),
        unit(Length, &["inch", "inches"], INCH_M, 1.0, 0.0),
        unit(Velocity, &["m/s"], 1.0, 1.0, 0.0),
        unit(Velocity, &["cm/s"], 1.0, 1e2, 0.0),
        unit(Velocity, &["mm/s"], 1.0, 1e3, 0.0),
        unit(Velocity, &["um/s"], 1.0, 1e6, 0.0),
        unit(Velocity, &["m/min"], 1.0, 60.0, 0.0),
        unit(Velocity, &["mm/min"], 1.0, 6e4, 0.0),
        unit(Velocity, &["inch/s", "in/s"], INCH_M, 1.0, 0.0),
        unit(Acceleration, &["m/s2", "m/s/s"], 1.0, 1.0, 0.0),
        unit(Acceleration, &["cm/s2"], 1.0, 1e2, 0.0),
        unit(Acceleration, &["mm/s2"], 1.0, 1e3, 0.0),
        unit(Torque, &["Nm"], 1.0, 1.0, 0.0),
        unit(Torque, &["cNm", "Ncm"], 1.0, 1e2, 0.0),
        unit(Torque, &["mNm", "Nmm"], 1.0, 1e3, 0.0),
        unit(Torque, &["uNm"], 1.0, 1e6, 0.0),
        unit(Torque, &["kNm"], 1e3, 1.0, 0.0),
        unit(Torque, &["MNm"], 1e6, 1.0, 0.0),
        unit(Torque, &["kgcm", "kgfcm"], GRAVITY_M_S2, 1e2, 0.0),
        unit(Torque, &["ozin", "ozfin"], POUND_FORCE_N * INCH_M, 16.0, 0.0),
        unit(Torque, &["lbin", "lbfin", "inlb"], POUND_FORCE_N * INCH_M, 1.0, 0.0),
        unit(Torque, &["lbft", "lbfft", "ftlb"], POUND_FORCE_N * INCH_M * 12.0, 1.0, 0.0),
        unit(Force, &["N"], 1.0, 1.0, 0.0),
        unit(Force, &["mN"], 1.0, 1e3, 0.0),
        unit(Force, &["kN"], 1e3, 1.0, 0.0),
        unit(Force, &["MN"], 1e6, 1.0, 0.0),
        unit(Force, &["kgf"], GRAVITY_M_S2, 1.0, 0.0),
        unit(Force, &["lbf"], POUND_FORCE_N, 1.0, 0.0),
        unit(Pressure, &["Pa"], 1.0, 1.0, 0.0),
        unit(Pressure, &["hPa", "mbar"], 1e2, 1.0, 0.0),
        unit(Pressure, &["kPa"], 1e3, 1.0, 0.0),
        unit(Pressure, &["MPa"], 1e6, 1.0, 0.0),
        unit(Pressure, &["bar"], 1e5, 1.0, 0.0),
        unit(Pressure, &["psi"], POUND_FORCE_N, INCH_M * INCH_M, 0.0),
        unit(Pressure, &["atm"], 101_325.0, 1.0, 0.0),
        unit(Temperature, &["degC", "C", "celsius"], 1.0, 1.0, 0.0),
        unit(Temperature, &["K", "kelvin"], 1.0, 1.0, -273.15),
        unit(Temperature, &["degF", "F", "fahrenheit"], 5.0, 9.0, -160.0 / 9.0),
    ]
};
