//! A field that turns at a speed, and the window in which the rotor is watched going with it.
//!
//! ```text
//! faster -> a turn of the field, so that friction, gear and cogging pull one way -> window: a turn of the motor -> slower
//! ```
//! Angles are counted in 2^-32 turns, the field's electrical, the encoder's mechanical; sums of them are integers, exact.

use super::Reason;
use crate::control::PERIOD_S;
use crate::control::probe::ProbeReport;
use crate::control::transform::{Rotation, Stationary, UNITS_PER_RAD};

/// Blocks in which the field comes to its speed, and to rest.
const RAMP: u32 = 300;
const TURN: i64 = 1 << 32;
/// Pole pairs, at most, and turns of the field by which such a rotor has to be seen turning.
const MOST_POLE_PAIRS: i64 = 64;
const FOLLOWS_AFTER: i64 = 3 * TURN / 2;
/// Share of the range that the window may take: the rest is for the turn before it and the ramps.
const WINDOW_SHARE: f32 = 0.7;

/// How the encoder goes with the field, once that is known.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gear {
    /// Field less the encoder's share, at no load.
    pub zero: u32,
    /// Turns of the field in one of the encoder, signed.
    pub signed: i64,
}

/// What was seen at speed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Window {
    /// Blocks in it.
    pub blocks: u32,
    /// Field and encoder where it began; sums and last of what they went on since.
    begin: (u32, u32),
    sum: (i64, i64),
    last: (i64, i64),
    /// Sums of cosine and sine of how far the rotor is behind, where that is known.
    cosine: f32,
    sine: f32,
}

impl Window {
    /// Turns of the field in one of the encoder, signed.
    pub fn turns_of_field(&self) -> f32 {
        if self.last.1 == 0 { 0.0 } else { self.last.0 as f32 / self.last.1 as f32 }
    }

    /// How far the field is ahead of so many times the encoder, in the mean.
    pub fn apart(&self, signed: i64) -> u32 {
        let count = i64::from(self.blocks.max(1));
        let field = i64::from(self.begin.0) + self.sum.0 / count;
        let encoder = i64::from(self.begin.1) + self.sum.1 / count;
        field.wrapping_sub(signed.wrapping_mul(encoder)) as u32
    }

    /// Mean cosine and sine of how far the rotor is behind the field.
    pub fn behind(&self) -> (f32, f32) {
        let share = 1.0 / self.blocks.max(1) as f32;
        (self.cosine * share, self.sine * share)
    }

    /// Takes a block: the field has turned so far, and the encoder.
    fn add(&mut self, block: &ProbeReport, gone: (i64, i64), gear: Gear) {
        self.blocks += 1;
        self.sum = (self.sum.0 + gone.0, self.sum.1 + gone.1);
        self.last = gone;
        let rotor = gear.signed.wrapping_mul(i64::from(block.encoder)) as u32;
        let behind = block.field.wrapping_sub(rotor).wrapping_sub(gear.zero);
        let seen = Rotation::at(behind).park(Stationary { alpha: 1.0, beta: 0.0 });
        self.cosine += seen.d;
        self.sine -= seen.q;
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    #[default]
    Faster,
    LeadIn,
    Window,
    Slower,
    Over,
}

/// One way of the field.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Turning {
    phase: Phase,
    /// Blocks in it.
    blocks: u32,
    /// Angle of the field in a period, at speed.
    turn: i32,
    /// How far the encoder goes in the window.
    span: i64,
    /// The field's last angle, and what it has turned, and both at the begin of the phase, with the encoder.
    field: Option<u32>,
    turned: i64,
    from: (i64, i64),
    pub window: Window,
    gear: Gear,
}

impl Turning {
    /// At so many turns of the field per second; the motor may go so far, rad.
    pub fn begin(hz: f32, reach_rad: f32, gear: Gear) -> Self {
        Self {
            turn: (hz * PERIOD_S * 4_294_967_296.0) as i32,
            span: ((WINDOW_SHARE * reach_rad * UNITS_PER_RAD) as i64).min(TURN),
            gear,
            ..Self::default()
        }
    }

    pub fn is_over(&self) -> bool {
        self.phase == Phase::Over
    }

    /// A block, and where the encoder is in all; sets how far the field turns in a period.
    pub fn step(
        &mut self,
        block: &ProbeReport,
        encoder: i64,
        turn: &mut i32,
    ) -> Result<(), Reason> {
        self.blocks += 1;
        let moved = self.field.map_or(0, |field| block.field.wrapping_sub(field) as i32);
        self.field = Some(block.field);
        self.turned += i64::from(moved);
        let gone = (self.turned - self.from.0, encoder - self.from.1);
        let ramp = |blocks: u32| {
            let share = i64::from(self.turn) * i64::from(blocks.min(RAMP)) / i64::from(RAMP);
            share as i32
        };
        match self.phase {
            Phase::Faster => {
                *turn = ramp(self.blocks);
                if self.blocks >= RAMP {
                    self.enter(Phase::LeadIn, encoder);
                }
            }
            Phase::LeadIn if gone.0.abs() >= FOLLOWS_AFTER => {
                if gone.1.abs() < TURN / (2 * MOST_POLE_PAIRS) {
                    return Err(Reason::RotorStands);
                }
                self.window.begin = (block.field, block.encoder);
                self.enter(Phase::Window, encoder);
            }
            Phase::LeadIn => {}
            Phase::Window => {
                self.window.add(block, gone, self.gear);
                if gone.1.abs() >= self.span {
                    self.enter(Phase::Slower, encoder);
                } else if gone.0.abs() > (MOST_POLE_PAIRS + 1) * TURN {
                    return Err(Reason::PolePairsUnclear);
                }
            }
            Phase::Slower => {
                *turn = ramp(RAMP.saturating_sub(self.blocks));
                if self.blocks >= RAMP {
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
