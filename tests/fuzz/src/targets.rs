//! One module a target; its function `run` executes an input.

pub mod candump;
pub mod csv;
pub mod driver;
pub mod dry_side;
pub mod package;
pub mod params;
pub mod program;
pub mod program_flash;
pub mod record;
pub mod scope;
pub mod sdo;
pub mod slcan;
