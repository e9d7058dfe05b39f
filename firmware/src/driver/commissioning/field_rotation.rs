//! A rotation of the field at constant speed, and the window in which the rotor is observed.
//!
//! ```text
//! speed up -> lead-in: a turn of the field, so that friction and cogging act in one direction -> window: a motor turn -> slow down
//! ```
//! Angles are counted in 2^-32 turns, electrical for the field and mechanical for the encoder. Their sums are
//! exact integers.

use super::AbortReason;
use crate::control::PERIOD_S;
use crate::control::probe::ProbeReport;
use crate::control::transform::{Rotation, Stationary, UNITS_PER_RAD};

/// Blocks to accelerate the field, and to stop it.
const RAMP_BLOCKS: u32 = 300;
const TURN: i64 = 1 << 32;
/// Maximum number of pole pairs, and the angle of the field after which such a rotor must have turned.
const MAX_POLE_PAIRS: i64 = 64;
const FOLLOW_CHECK_ANGLE: i64 = 3 * TURN / 2;
/// Maximum share of the travel for the window; the rest is for the lead-in and the ramps.
const WINDOW_SHARE: f32 = 0.7;

/// Relation of encoder and field, once it is known.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FieldRatio {
    /// Field angle less the encoder's part, without load.
    pub zero: u32,
    /// Turns of the field per encoder turn, signed.
    pub signed: i64,
}

/// Sums over a window at constant speed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RotationWindow {
    /// Number of blocks.
    pub blocks: u32,
    /// Field and encoder at the start; sums and last values of their rotation since.
    begin: (u32, u32),
    sum: (i64, i64),
    last: (i64, i64),
    /// Sums of cosine and sine of the rotor's lag, once the relation is known.
    cosine: f32,
    sine: f32,
}

impl RotationWindow {
    /// Returns the turns of the field per encoder turn, signed.
    pub fn turns_of_field(&self) -> f32 {
        if self.last.1 == 0 { 0.0 } else { self.last.0 as f32 / self.last.1 as f32 }
    }

    /// Returns the mean angle of the field less `signed` times the encoder.
    #[inline(never)]
    pub fn apart(&self, signed: i64) -> u32 {
        let count = i64::from(self.blocks.max(1));
        let field = i64::from(self.begin.0) + self.sum.0 / count;
        let encoder = i64::from(self.begin.1) + self.sum.1 / count;
        field.wrapping_sub(signed.wrapping_mul(encoder)) as u32
    }

    /// Returns the mean cosine and sine of the rotor's lag behind the field.
    #[inline(never)]
    pub fn behind(&self) -> (f32, f32) {
        let share = 1.0 / self.blocks.max(1) as f32;
        (self.cosine * share, self.sine * share)
    }

    /// Adds a block; `gone` is the rotation of field and encoder since the start.
    fn add(&mut self, block: &ProbeReport, gone: (i64, i64), ratio: FieldRatio) {
        self.blocks += 1;
        self.sum = (self.sum.0 + gone.0, self.sum.1 + gone.1);
        self.last = gone;
        let rotor = ratio.signed.wrapping_mul(i64::from(block.encoder)) as u32;
        let behind = block.field.wrapping_sub(rotor).wrapping_sub(ratio.zero);
        let seen = Rotation::at(behind).park(Stationary { alpha: 1.0, beta: 0.0 });
        self.cosine += seen.d;
        self.sine -= seen.q;
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    #[default]
    SpeedUp,
    LeadIn,
    RotationWindow,
    SlowDown,
    Over,
}

/// One direction of the field's rotation.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FieldRotation {
    phase: Phase,
    /// Blocks since the start of the phase.
    blocks: u32,
    /// Angle of the field per period at full speed.
    turn: i32,
    /// Rotation of the encoder in the window.
    span: i64,
    /// Last field angle, its total rotation, and both rotations at the start of the phase.
    field: Option<u32>,
    turned: i64,
    from: (i64, i64),
    pub window: RotationWindow,
    ratio: FieldRatio,
}

impl FieldRotation {
    /// Starts a rotation at `hz` turns of the field per second; the motor may turn by `reach_rad`.
    pub fn begin(hz: f32, reach_rad: f32, ratio: FieldRatio) -> Self {
        Self {
            turn: (hz * PERIOD_S * 4_294_967_296.0) as i32,
            span: ((WINDOW_SHARE * reach_rad * UNITS_PER_RAD) as i64).min(TURN),
            ratio,
            ..Self::default()
        }
    }

    pub fn is_over(&self) -> bool {
        self.phase == Phase::Over
    }

    /// Processes a block; `encoder` is the total rotation of the encoder. Sets the field's angle per period.
    pub fn step(
        &mut self,
        block: &ProbeReport,
        encoder: i64,
        turn: &mut i32,
    ) -> Result<(), AbortReason> {
        self.blocks += 1;
        let moved = self.field.map_or(0, |field| block.field.wrapping_sub(field) as i32);
        self.field = Some(block.field);
        self.turned += i64::from(moved);
        let gone = (self.turned - self.from.0, encoder - self.from.1);
        let ramp = |blocks: u32| {
            let share =
                i64::from(self.turn) * i64::from(blocks.min(RAMP_BLOCKS)) / i64::from(RAMP_BLOCKS);
            share as i32
        };
        match self.phase {
            Phase::SpeedUp => {
                *turn = ramp(self.blocks);
                if self.blocks >= RAMP_BLOCKS {
                    self.enter(Phase::LeadIn, encoder);
                }
            }
            Phase::LeadIn if gone.0.abs() >= FOLLOW_CHECK_ANGLE => {
                if gone.1.abs() < TURN / (2 * MAX_POLE_PAIRS) {
                    return Err(AbortReason::RotorStands);
                }
                self.window.begin = (block.field, block.encoder);
                self.enter(Phase::RotationWindow, encoder);
            }
            Phase::LeadIn => {}
            Phase::RotationWindow => {
                self.window.add(block, gone, self.ratio);
                if gone.1.abs() >= self.span {
                    self.enter(Phase::SlowDown, encoder);
                } else if gone.0.abs() > (MAX_POLE_PAIRS + 1) * TURN {
                    return Err(AbortReason::PolePairsUnclear);
                }
            }
            Phase::SlowDown => {
                *turn = ramp(RAMP_BLOCKS.saturating_sub(self.blocks));
                if self.blocks >= RAMP_BLOCKS {
                    self.phase = Phase::Over;
                }
            }
            Phase::Over => {}
        }
        Ok(())
    }

    fn enter(&mut self, phase: Phase, encoder: i64) {
        self.phase = phase;
        self.blocks = 0;
        self.from = (self.turned, encoder);
    }
}
