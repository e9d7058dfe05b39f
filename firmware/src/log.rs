//! Log lines of the driver, where there is somebody to read them.
//!
//! On a board they are `defmt` frames, formatted on the reader's side; on a PC, or without the feature, they
//! are nothing, arguments included. Nothing in the current loop logs: what happens there is counted and flagged
//! in its reports.

/// `log!(level, "format", arguments)`, as `defmt`'s macros.
macro_rules! log {
    ($level:ident, $($arguments:tt)*) => {{
        #[cfg(all(feature = "defmt", target_os = "none"))]
        defmt::$level!($($arguments)*);
    }};
}

pub(crate) use log;
