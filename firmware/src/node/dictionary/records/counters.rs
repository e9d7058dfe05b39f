//! Counters of frames.

macro_rules! counters {
    ($($(#[$doc:meta])* $name:ident),* $(,)?) => {
        /// Counters of received, sent, unusable and lost frames.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct Counters { $($(#[$doc])* pub $name: u32),* }

        /// Names of the counters, in the order of their sub-indices.
        pub const FRAME_COUNTERS: &[&str] = &[$(stringify!($name)),*];

        impl Counters {
            /// Returns the counts in the order of [`FRAME_COUNTERS`].
            pub const fn words(&self) -> [u32; FRAME_COUNTERS.len()] {
                [$(self.$name),*]
            }
        }
    };
}

counters! {
    /// Frames received.
    received,
    /// Frames sent.
    sent,
    /// Frames dropped because the send queue was full.
    not_sent,
    /// Frames for other nodes.
    foreign,
    /// Process frames received while the node was not operational.
    passed_over,
    /// Frames for this node with a wrong number of bytes.
    wrong_length,
    /// Frames for this node with illegal content.
    wrong_content,
    /// SYNC frames lost.
    sync_lost,
    /// SYNC frames received twice.
    sync_duplicate,
    /// SYNC frames received after a later one.
    sync_late,
    /// Command frames received twice.
    command_duplicate,
    /// Command frames lost.
    command_lost,
    /// Command frames received after a later one.
    command_late,
    /// SDO requests refused.
    sdo_refused,
    /// Times the controller lost received frames.
    receiver_overrun,
    /// Times the controller went bus-off.
    bus_off,
    /// Synchronous frames received after the window of their SYNC.
    outside_window,
}
