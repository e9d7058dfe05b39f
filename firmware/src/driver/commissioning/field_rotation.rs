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

/// Angles or rotations of field and encoder, 2^-32 turns.
#[derive(Clone, Copy, Debug, Default)]
struct Turned {
    field: i64,
    encoder: i64,
}

/// Mean cosine and sine of the angle by which the rotor lags behind the field, or their sums.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lag {
    pub cosine: f32,
    pub sine: f32,
}

impl Lag {
    /// The rotor lies along the field.
    pub const NONE: Self = Self { cosine: 1.0, sine: 0.0 };
}

/// Sums over a window at constant speed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RotationWindow {
    /// Number of blocks.
    pub blocks: u32,
    /// Angles at the start; sums and last values of the rotation since.
    begin: Turned,
    sum: Turned,
    last: Turned,
    /// Sums of the rotor's lag, once the relation is known.
    lags: Lag,
}

impl RotationWindow {
    /// Returns the turns of the field per encoder turn, signed.
    pub fn turns_of_field(&self) -> f32 {
        let Turned { field, encoder } = self.last;
        if encoder == 0 { 0.0 } else { field as f32 / encoder as f32 }
    }

    /// Returns the mean angle of the field less `signed` times the encoder.
    #[inline(never)]
    pub fn apart(&self, signed: i64) -> u32 {
        let count = i64::from(self.blocks.max(1));
        let field = self.begin.field + self.sum.field / count;
        let encoder = self.begin.encoder + self.sum.encoder / count;
        field.wrapping_sub(signed.wrapping_mul(encoder)) as u32
    }

    /// Returns the mean lag of the rotor behind the field.
    #[inline(never)]
    pub fn lag(&self) -> Lag {
        let share = 1.0 / self.blocks.max(1) as f32;
        Lag { cosine: self.lags.cosine * share, sine: self.lags.sine * share }
    }

    /// Adds a block; `turned` is the rotation since the start.
    fn add(&mut self, block: &ProbeReport, turned: Turned, ratio: FieldRatio) {
        self.blocks += 1;
        self.sum.field += turned.field;
        self.sum.encoder += turned.encoder;
        self.last = turned;
        let rotor = ratio.signed.wrapping_mul(i64::from(block.encoder)) as u32;
        let behind = block.field.wrapping_sub(rotor).wrapping_sub(ratio.zero);
        let seen = Rotation::at(behind).park(Stationary { alpha: 1.0, beta: 0.0 });
        self.lags.cosine += seen.d;
        self.lags.sine -= seen.q;
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
    from: Turned,
    pub window: RotationWindow,
    ratio: FieldRatio,
}

impl FieldRotation {
    /// Starts a rotation at `hz` turns of the field per second; the motor may turn by `reach_rad`.
    pub fn begin(hz: f32, reach_rad: f32, ratio: FieldRatio) -> Self {
        Self {
            turn: (hz * PERIOD_S * TURN as f32) as i32,
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
        let turned =
            Turned { field: self.turned - self.from.field, encoder: encoder - self.from.encoder };
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
            Phase::LeadIn if turned.field.abs() >= FOLLOW_CHECK_ANGLE => {
                if turned.encoder.abs() < TURN / (2 * MAX_POLE_PAIRS) {
                    return Err(AbortReason::RotorStands);
                }
                self.window.begin =
                    Turned { field: block.field.into(), encoder: block.encoder.into() };
                self.enter(Phase::RotationWindow, encoder);
            }
            Phase::LeadIn => {}
            Phase::RotationWindow => {
                self.window.add(block, turned, self.ratio);
                if turned.encoder.abs() >= self.span {
                    self.enter(Phase::SlowDown, encoder);
                } else if turned.field.abs() > (MAX_POLE_PAIRS + 1) * TURN {
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
        self.from = Turned { field: self.turned, encoder };
    }
}
