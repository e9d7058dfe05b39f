//! What can be wrong around a joint: sensors that fail, frames that come late.

use compensator_core::can::Frame;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use simulated_machines::joint_plant::Shown;
use std::collections::VecDeque;

/// When a sensor fails, ms after the start.
const FAILS_AT: u32 = 1500;

/// Share of the frames that get lost on a bad line.
const DROPPED: f64 = 0.5;

/// How the sensors of side load and pressure behave.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SealSensor {
    /// As they should.
    #[default]
    Sound,
    /// From 1.5 s on nothing is heard of them.
    Stale,
    /// From 1.5 s on they say the same, whatever is true.
    Stuck,
    /// Half of their frames get lost.
    Dropped,
    /// There are none.
    Absent,
}

/// What is wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Faults {
    /// Sensors of side load and pressure.
    pub seal: SealSensor,
    /// Share of the encoder's readings that fail, 0..=1.
    pub encoder_lost: f64,
    /// How late frames to the driver are, ms.
    pub delay_ms: usize,
    /// Draws what is lost.
    pub seed: u64,
}

impl Faults {
    /// Such sensors, all else sound.
    pub fn seal_sensor(seal: SealSensor) -> Self {
        Self { seal, ..Self::default() }
    }

    /// What the sensors send in a millisecond, or nothing; `stuck` is what they said last before they failed.
    pub(super) fn seal(
        &self,
        milliseconds: u32,
        shown: &Shown,
        stuck: &mut Option<[f64; 2]>,
    ) -> Option<Shown> {
        let failed = milliseconds >= FAILS_AT;
        match self.seal {
            SealSensor::Sound => Some(*shown),
            SealSensor::Absent => None,
            SealSensor::Stale => (!failed).then_some(*shown),
            SealSensor::Stuck => {
                if !failed {
                    *stuck = Some([shown.radial_force_n, shown.pressure_diff_pa]);
                }
                let [radial_force_n, pressure_diff_pa] =
                    stuck.unwrap_or([shown.radial_force_n, shown.pressure_diff_pa]);
                Some(Shown { radial_force_n, pressure_diff_pa, ..*shown })
            }
            SealSensor::Dropped => {
                let draw = u64::from(milliseconds).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ self.seed;
                Pcg64::seed_from_u64(draw).random_bool(1.0 - DROPPED).then_some(*shown)
            }
        }
    }
}

/// A line to the driver on which frames take their time.
#[derive(Debug)]
pub(super) struct Line {
    delay_ms: u64,
    now_ms: u64,
    frames: VecDeque<(u64, Frame)>,
}

impl Line {
    pub fn new(faults: &Faults) -> Self {
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
