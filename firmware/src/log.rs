//! Log lines of the driver.
//!
//! On a board they are `defmt` frames, formatted by the reader. On a PC, or without the feature, they
//! compile to nothing, including their arguments. The current loop does not log: it counts and sets flags
//! in its reports.

/// `log!(level, "format", arguments)`, as `defmt`'s macros.
macro_rules! log {
    ($level:ident, $($arguments:tt)*) => {{
        #[cfg(all(feature = "defmt", target_os = "none"))]
        defmt::$level!($($arguments)*);
    }};
}

pub(crate) use log;
