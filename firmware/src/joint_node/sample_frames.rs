//! The transmit PDOs of a sample, which the whole driver and the compact node send alike: their places and their rates.

/// Transmit PDO with the friction torque and the feed-forward current.
pub(crate) const ANSWER: usize = 0;

/// Transmit PDO with flags and sequence.
pub(crate) const STATUS: usize = 1;

/// Transmit PDO with every n-th sample (2001h:5).
pub(crate) const TELEMETRY: usize = 2;

/// Transmit PDO with velocity and position, which a master needs at every SYNC.
pub(crate) const MOTION: usize = 3;

/// Transmit PDO with torque and load torque.
pub(crate) const TORQUE: usize = 4;

/// Order at a SYNC: what was measured, then what was computed.
pub(crate) const SYNC_ORDER: [usize; 5] = [MOTION, TORQUE, ANSWER, STATUS, TELEMETRY];

/// A joint on its sensors sends its other PDOs at every n-th SYNC, so that its frames take 39 % of a bus of 1 Mbit/s at
/// 1 kHz. At every SYNC, they would take 88 %.
pub(crate) const SLOW_TYPE: u8 = 10;
