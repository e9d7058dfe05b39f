//! A wiring without an encoder at the joint's side of the gear.

use firmware::sensors::biss::WORDS;

/// There is none.
pub enum JointEncoder {}

impl JointEncoder {
    /// See `joint_encoder.rs`.
    pub fn start(&mut self) -> bool {
        match *self {}
    }

    /// See `joint_encoder.rs`.
    pub fn read(&mut self) -> [u16; WORDS] {
        match *self {}
    }
}
