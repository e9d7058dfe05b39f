//! Limits above which an error that no cause explains is `unknown`.

/// Ratio of the held-out error to the noise floor above which an error that is correlated from row to row has structure.
pub const STRUCTURE: f64 = 1.2;

/// Share of the torque's standard deviation below which such an error is negligible: a hundredth of the variance. The error of
/// logs with nothing hidden is mostly below it, that of measured machines without a known cause above it.
pub const NEGLIGIBLE: f64 = 0.1;
