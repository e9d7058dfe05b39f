//! Faults around a joint: failing sensors and late frames.

use compensator_core::can::Frame;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use simulated_machines::joint_plant::Shown;
use std::collections::VecDeque;

/// Time of the sensor failure, ms after the start.
const SENSOR_FAILURE_MS: u32 = 1500;

/// Probability that a frame of the sensors is lost, for [`SealSensorFault::Dropped`].
const FRAME_LOSS_PROBABILITY: f64 = 0.5;

/// 2^64 over the golden ratio, which spreads the seeds of consecutive milliseconds.
const SEED_SPREAD: u64 = 0x9E37_79B9_7F4A_7C15;

/// Fault of the side-load and pressure sensors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SealSensorFault {
    /// No fault.
    #[default]
    None,
    /// No frames after 1.5 s.
    Stale,
    /// Constant values after 1.5 s.
    Stuck,
    /// Half of the frames are lost.
    Dropped,
    /// No sensors.
    Absent,
}

/// Faults of a rig. The default has none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RigFaults {
    /// Fault of the side-load and pressure sensors.
    pub seal: SealSensorFault,
    /// Share of the encoder readings that fail, from 0 to 1.
    pub encoder_lost: f64,
    /// Delay of frames to the driver, ms.
    pub delay_ms: usize,
    /// Seed for the random losses.
    pub seed: u64,
}

impl RigFaults {
    /// Returns this sensor fault and no other.
    pub fn seal_sensor(seal: SealSensorFault) -> Self {
        Self { seal, ..Self::default() }
    }

    /// Returns what the sensors send in this millisecond, or `None`. `stuck` holds what they showed
    /// last before the failure.
    pub(super) fn seal_reading(
        &self,
        milliseconds: u32,
        shown: &Shown,
        stuck: &mut Option<Shown>,
    ) -> Option<Shown> {
        let has_failed = milliseconds >= SENSOR_FAILURE_MS;
        match self.seal {
            SealSensorFault::None => Some(*shown),
            SealSensorFault::Absent => None,
            SealSensorFault::Stale => (!has_failed).then_some(*shown),
            SealSensorFault::Stuck => {
                if !has_failed {
                    *stuck = Some(*shown);
                }
                let Shown { radial_force_n, pressure_diff_pa, .. } = stuck.unwrap_or(*shown);
                Some(Shown { radial_force_n, pressure_diff_pa, ..*shown })
            }
            SealSensorFault::Dropped => {
                let seed = u64::from(milliseconds).wrapping_mul(SEED_SPREAD) ^ self.seed;
                Pcg64::seed_from_u64(seed)
                    .random_bool(1.0 - FRAME_LOSS_PROBABILITY)
                    .then_some(*shown)
            }
        }
    }
}

/// A CAN line that delivers frames after a fixed delay.
#[derive(Debug)]
pub(super) struct DelayLine {
    delay_ms: u64,
    now_ms: u64,
    frames: VecDeque<(u64, Frame)>,
}

impl DelayLine {
    pub fn new(faults: &RigFaults) -> Self {
        Self { delay_ms: faults.delay_ms as u64, now_ms: 0, frames: VecDeque::new() }
    }

    pub fn send(&mut self, frame: Frame) {
        self.frames.push_back((self.now_ms + self.delay_ms, frame));
    }

    pub fn receive(&mut self) -> Option<Frame> {
        self.frames.pop_front_if(|(due_ms, _)| *due_ms <= self.now_ms).map(|(_, frame)| frame)
    }

    pub fn tick(&mut self) {
        self.now_ms += 1;
    }
}
