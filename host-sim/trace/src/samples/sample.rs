//! One sample of a joint, as the bus carries it.
//!
//! Each quantity is the 32-bit float of its process frame. NaN stands for a quantity that the joint does not measure, and for
//! one whose frame did not arrive. The driver's answers are optional, because a log may contain the inputs alone.

use compensator_core::can::{
    AnswerFrame, FrameError, MotionFrame, SealFrame, StatusFrame, SurroundingsFrame, TorqueFrame,
};
use compensator_core::quantity::Quantity;

/// A sample on the bus. A quantity that was not measured or not received is NaN.
#[derive(Clone, Copy, Debug)]
pub struct TraceSample {
    /// Line number of the SYNC in the log, from 1.
    pub line: u64,
    /// Time stamp of the SYNC, ns.
    pub time_ns: u64,
    /// Run number; `None` before the first run begins.
    pub run: Option<u32>,
    /// Number of the sample in the run, from 0. Lost samples count.
    pub sequence: u32,
    /// Motion of the joint.
    pub motion: MotionFrame,
    /// Position measured at the joint's side of the gear, rad.
    pub joint_position_rad: f64,
    /// Torque at the joint.
    pub torque: TorqueFrame,
    /// Side load and pressure at the seal.
    pub seal: SealFrame,
    /// Temperature and auxiliary covariate.
    pub surroundings: SurroundingsFrame,
    /// Answer of the driver, if it is in the log.
    pub answer: Option<AnswerFrame>,
    /// Status of the driver, if it is in the log.
    pub status: Option<StatusFrame>,
    /// Error of a frame of this sample that could not be parsed.
    pub fault: Option<FrameError>,
}

pub(super) const NO_MOTION: MotionFrame =
    MotionFrame { velocity_rad_s: f32::NAN, position_rad: f32::NAN };
pub(super) const NO_TORQUE: TorqueFrame =
    TorqueFrame { torque_nm: f32::NAN, load_torque_nm: f32::NAN };
const NO_SEAL: SealFrame = SealFrame { radial_force_n: f32::NAN, pressure_diff_pa: f32::NAN };
const NO_SURROUNDINGS: SurroundingsFrame =
    SurroundingsFrame { temperature_c: f32::NAN, auxiliary: f32::NAN };

impl Default for TraceSample {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl TraceSample {
    /// A sample without any value.
    pub const EMPTY: Self = Self {
        line: 0,
        time_ns: 0,
        run: None,
        sequence: 0,
        motion: NO_MOTION,
        joint_position_rad: f64::NAN,
        torque: NO_TORQUE,
        seal: NO_SEAL,
        surroundings: NO_SURROUNDINGS,
        answer: None,
        status: None,
        fault: None,
    };

    /// Returns the measured value of a quantity, in the unit of its log column. Returns NaN if it was not measured or if
    /// no frame carries it.
    pub fn get(&self, quantity: Quantity) -> f32 {
        let mut copy = *self;
        copy.field_mut(quantity).map_or(f32::NAN, |value| *value)
    }

    /// Sets the measured value of a quantity. Does nothing if no frame carries it.
    pub fn set(&mut self, quantity: Quantity, value: f32) {
        if let Some(field) = self.field_mut(quantity) {
            *field = value;
        }
    }

    /// Returns the field of a quantity, or `None` if no frame carries it.
    fn field_mut(&mut self, quantity: Quantity) -> Option<&mut f32> {
        Some(match quantity {
            Quantity::Velocity => &mut self.motion.velocity_rad_s,
            Quantity::Position => &mut self.motion.position_rad,
            Quantity::Torque => &mut self.torque.torque_nm,
            Quantity::LoadTorque => &mut self.torque.load_torque_nm,
            Quantity::RadialForce => &mut self.seal.radial_force_n,
            Quantity::Pressure => &mut self.seal.pressure_diff_pa,
            Quantity::Temperature => &mut self.surroundings.temperature_c,
            Quantity::Auxiliary => &mut self.surroundings.auxiliary,
            Quantity::CampaignTime | Quantity::Acceleration => return None,
        })
    }
}
