//! What the interrupt records of a period, and by which order.

/// Maximum number of signals in a row.
pub const MAX_SIGNALS: usize = 8;

/// What the interrupt records.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ScopeOrder {
    /// Numbers of the signals, 0 for none.
    pub signals: [u8; MAX_SIGNALS],
    /// Periods from one row to the next; 0 records nothing.
    pub every: u16,
    /// Number of the capture, which the rows repeat: rows of an earlier capture are told apart.
    pub capture: u8,
}

impl ScopeOrder {
    /// Records nothing.
    pub const OFF: Self = Self { signals: [0; MAX_SIGNALS], every: 0, capture: 0 };
}

/// Values of one period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScopeRow {
    /// Values of the signals in their order.
    pub values: [f32; MAX_SIGNALS],
    /// Number of the capture.
    pub capture: u8,
    /// Rows before this one are lost: the queue was full.
    pub is_after_gap: bool,
}
