//! What the kinds of encoders say of a period.

/// What an encoder other than an AS504x says of a period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Evaluation {
    /// The angle, 2^-32 turns of the motor.
    Angle(u32),
    /// An angle that is used, and a fault that is reported: lost counts, or a warning of the encoder.
    Doubtful(u32),
    /// No angle in this period: a disturbance, or an encoder that does not know its angle yet.
    Missing,
    /// Readings that contradict each other: there is no angle for 25 ms, so that the bridge opens.
    Contradiction,
}
