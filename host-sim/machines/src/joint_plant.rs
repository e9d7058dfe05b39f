//! An underwater joint richer than any model that is fitted to it: what the published experiments are repeated on.
//!
//! ```text
//! bridge -> winding -> gear -> shaft with its seal -> water, propeller, leg, platform
//!           machine            seal, shaft            load
//! ```
//! Its seal is not LuGre ([`seal`]). Every constant is in one table with its source ([`parameters`]), fixed before
//! anything was measured. [`mod@bench`] drives the same seal by hand, as a test stand does; [`machine`] is
//! what a current loop is connected to, with noise and steps in what it measures. A bus capacitor ([`supply`]), a winding that
//! heats up ([`winding`]), a coupling with compliance and play, cogging and an eccentric magnet are there to be asked for. All of it is simulated, in
//! double precision, by its own equations: nothing here can see the law that is judged.

pub mod bench;
pub mod comparators;
pub mod load;
pub mod machine;
pub mod parameters;
pub mod seal;
pub mod shaft;
pub mod supply;
pub mod winding;

pub use bench::Bench;
pub use load::Load;
pub use machine::{JointPlant, Measured, Shown};
pub use parameters::{Entry, Parameters};
