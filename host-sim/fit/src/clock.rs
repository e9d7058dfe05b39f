//! Durations of computations, and the date.
//!
//! `wasm32-unknown-unknown` has no clock. A program for it passes one with `set_source`; without it, the time stands at
//! the start of 1970.

#[cfg(all(target_family = "wasm", target_os = "unknown"))]
pub use of_host::{Instant, set_source, since_epoch};
#[cfg(not(all(target_family = "wasm", target_os = "unknown")))]
pub use of_system::{Instant, since_epoch};

#[cfg(not(all(target_family = "wasm", target_os = "unknown")))]
mod of_system {
    pub use std::time::Instant;
    use std::time::{Duration, SystemTime, UNIX_EPOCH};

    /// Returns the time since the start of 1970, UTC; zero if the clock is before.
    pub fn since_epoch() -> Duration {
        SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
    }
}

#[cfg(all(target_family = "wasm", target_os = "unknown"))]
mod of_host {
    use std::sync::OnceLock;
    use std::time::Duration;

    static SOURCE: OnceLock<fn() -> f64> = OnceLock::new();

    /// Sets the clock: milliseconds since the start of 1970, UTC. Only the first call has an effect.
    pub fn set_source(milliseconds: fn() -> f64) {
        let _ = SOURCE.set(milliseconds);
    }

    /// Returns the time since the start of 1970, UTC; zero without a clock.
    pub fn since_epoch() -> Duration {
        let milliseconds = SOURCE.get().map_or(0.0, |now| now());
        Duration::try_from_secs_f64(milliseconds / 1e3).unwrap_or_default()
    }

    /// A point in time.
    #[derive(Clone, Copy, Debug)]
    pub struct Instant(Duration);

    impl Instant {
        /// Returns the present.
        pub fn now() -> Self {
            Self(since_epoch())
        }

        /// Returns the time since then; zero if the clock was set back.
        pub fn elapsed(self) -> Duration {
            since_epoch().saturating_sub(self.0)
        }
    }
}
