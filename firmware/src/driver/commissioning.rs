//! Commissioning: the driver measures its own motor at low current, in bounded steps.
//!
//! ```text
//! offsets -> R, dead time: three currents along a fixed field -> L: a superposed square wave, along and across
//!         -> slow rotation, both directions: pole pairs, direction, electrical zero -> fast rotation: flux -> current to 0
//! ```
//! Three currents are used because the dead time takes a voltage that does not depend on a large current, and less at
//! a small one (`loss`); the slope is R. Friction makes the field lead the rotor in one direction and lag in the other: the mean is the electrical
//! zero, and half the difference is the friction. Over a whole motor turn, cogging and eccentricity cancel. Flux
//! is found *across* the current, where resistance and dead time have no effect: `-v i_across = w L i^2 + w psi
//! (i_d cos lag - i_q sin lag)`.
//!
//! The procedure runs in the background, one step per millisecond, on the reports of [`crate::control::probe`].
//! Current, voltage, travel, time and the master's confirmation are bounded, and every end opens the bridge. The
//! results are staged. They apply after a commit, like any parameter, and after the wiring is confirmed.

mod field_rotation;
pub mod friction_run;
mod hall_fit;
mod loss;
mod progress;
mod rotation_steps;

use crate::control::PERIOD_S;
use crate::control::parameters::DEAD_TIME_SHARE_MAX;
use crate::control::probe::{BLOCK_PERIODS, HALF_WAVE_PERIODS, ProbeCommand, ProbeReport};
use crate::control::transform::RAD_PER_UNIT;
use field_rotation::{FieldRatio, FieldRotation, RotationWindow};
use hall_fit::HallFit;
pub use hall_fit::HallPlacement;
use loss::Level;
pub use progress::{AbortReason, CommissioningStep};
use rotation_steps::SLOW_HZ;

/// Limits of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommissioningBounds {
    /// Current along the field, A.
    pub current_a: f32,
    /// Maximum travel of the joint to either side, rad.
    pub travel_rad: f32,
    /// Motor turns per joint turn.
    pub gear_ratio: f32,
    /// Bus voltage at the start, V.
    pub bus_v: f32,
}

/// Results of a run; 0 for a step that was not reached.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorMeasurement {
    /// Offsets subtracted from the currents of phases a and b, A.
    pub offset_a: [f32; 2],
    /// Resistance of a phase, ohm: winding, cable and switch.
    pub resistance_ohm: f32,
    /// Inductance along and across the magnet, H.
    pub inductance_h: [f32; 2],
    /// Pole pairs.
    pub pole_pairs: u8,
    /// 1, or -1 if the encoder counts down in the phase sequence a, b, c.
    pub encoder_direction: i8,
    /// Encoder angle at which the magnet lies along phase a, rad of the motor.
    pub encoder_offset_rad: f32,
    /// Angle by which friction holds the rotor behind a slow field, rad (electrical).
    pub lag_rad: f32,
    /// Flux of the magnet through a phase, Vs.
    pub flux_vs: f32,
    /// Time in each period in which a phase has the bus voltage against its current, s.
    pub dead_time_s: f32,
    /// Phase current at which half of this voltage is lost, A.
    pub dead_time_current_a: f32,
}

impl MotorMeasurement {
    /// Returns the torque of the motor per current, Nm/A.
    pub fn torque_constant_nm_per_a(&self) -> f32 {
        1.5 * f32::from(self.pole_pairs) * self.flux_vs
    }
}

/// Shares of the current in the first two of three resistance measurements. At the smallest one, the dead time takes
/// clearly less than at the others.
const LOW_CURRENT_SHARE: f32 = 0.06;
const HALF_CURRENT_SHARE: f32 = 0.5;
/// Initial voltage, V, and its growth per block: a factor of 20 in 0.75 s, and 1 % during the delay of a report.
const INITIAL_VOLTAGE_V: f32 = 0.02;
const VOLTAGE_GROWTH_PER_BLOCK: f32 = 1.004;
/// Maximum voltage as a share of the bus; the circle permits 0.58.
const MAX_VOLTAGE_SHARE: f32 = 0.23;
/// Blocks at a level: until the rotor is at rest, and for the mean.
const SETTLE_BLOCKS: u32 = 300;
const MEAN_BLOCKS: u32 = 300;
/// Current response of the square wave, as a share of the current. Phases b and c carry half the current, and
/// none may reach 0.
const SQUARE_RESPONSE_SHARE: f32 = 0.15;
/// Minimum response that is a valid measurement, if the bus voltage permits no more.
const MIN_SQUARE_RESPONSE_SHARE: f32 = 0.02;
const SQUARE_GROWTH_PER_BLOCK: f32 = 1.01;
/// Blocks in which the current is reduced to 0.
const RAMP_DOWN_BLOCKS: u32 = 100;
/// Maximum number of missing blocks. After its command the bridge needs this time for wake-up and offset trim.
const MAX_MISSING_BLOCKS: u32 = 400;
/// Maximum number of blocks of a run: one minute.
const MAX_RUN_BLOCKS: u32 = 60_000;

/// Sums over blocks.
#[derive(Clone, Copy, Debug, Default)]
struct BlockSums {
    blocks: u32,
    voltage_v: f32,
    along_a: f32,
    across_a: f32,
    response_a: f32,
}

impl BlockSums {
    #[inline(never)]
    fn add(&mut self, block: &ProbeReport, axis: usize) {
        self.blocks += 1;
        self.voltage_v += block.along_v;
        self.along_a += block.along_a;
        self.across_a += block.across_a;
        self.response_a += block.response_a.get(axis).copied().unwrap_or(0.0);
    }

    #[inline(never)]
    fn mean(&self) -> Self {
        let share = 1.0 / self.blocks.max(1) as f32;
        Self {
            blocks: self.blocks,
            voltage_v: self.voltage_v * share,
            along_a: self.along_a * share,
            across_a: self.across_a * share,
            response_a: self.response_a * share,
        }
    }
}

with_defaults! {
    /// A run, and the results of the last one.
    #[derive(Clone, Copy, Debug)]
    pub struct Commissioning {
        step: CommissioningStep = CommissioningStep::Idle,
        reason: AbortReason = AbortReason::None,
        bounds: CommissioningBounds =
            CommissioningBounds { current_a: 0.0, travel_rad: 0.0, gear_ratio: 1.0, bus_v: 0.0 },
        found: MotorMeasurement,
        command: ProbeCommand = ProbeCommand {
            run: 0,
            along_v: 0.0,
            square_v: [0.0; 2],
            turn_per_period: 0,
            dead_v: 0.0,
            dead_a: 1.0,
            trip_a: 0.0,
        },
        /// Number of the last block.
        last_block: u32,
        /// Blocks in the step, in the run, and missing in a row.
        blocks: u32,
        run_blocks: u32,
        missing: u32,
        /// The level is reached and held.
        is_holding: bool,
        sums: BlockSums,
        /// Results at the smallest and at half the current; no blocks if they are not measured.
        low: BlockSums,
        half: BlockSums,
        rotation: FieldRotation,
        gear: FieldRatio,
        /// Window of the slow forward rotation, and flux of the fast one, Vs.
        forward_window: RotationWindow,
        flux_forward_vs: f32,
        /// Levels of Hall sensors, and what they show.
        hall_levels: u8,
        hall: HallFit,
        /// Last encoder angle, and the rotation since the start of the run, 2^-32 turns.
        encoder: u32,
        turned: i64,
    }
    #[inline(never)]
}

impl Commissioning {
    /// Starts a run.
    pub fn begin(&mut self, bounds: CommissioningBounds) {
        let run = self.command.run.wrapping_add(1);
        *self = Self { step: CommissioningStep::Offsets, bounds, ..Self::default() };
        self.command.run = run;
        self.command.trip_a = 1.5 * bounds.current_a + 0.5;
    }

    /// Ends a run; has no effect after the end.
    pub fn end(&mut self, reason: AbortReason) {
        if self.is_running() {
            (self.step, self.reason) = (CommissioningStep::Aborted, reason);
        }
    }

    /// Returns true while the run needs the bridge.
    pub fn is_running(&self) -> bool {
        !matches!(
            self.step,
            CommissioningStep::Idle | CommissioningStep::Done | CommissioningStep::Aborted
        )
    }

    /// Returns the limits of the run.
    pub const fn bounds(&self) -> &CommissioningBounds {
        &self.bounds
    }

    /// Returns the present step.
    pub const fn step(&self) -> CommissioningStep {
        self.step
    }

    /// Returns the reason of the end.
    pub const fn reason(&self) -> AbortReason {
        self.reason
    }

    /// Takes the levels of Hall sensors, before a block; illegal ones if there are no sensors.
    pub fn take_hall(&mut self, levels: u8) {
        self.hall_levels = levels;
    }

    /// Returns the placement of the Hall sensors; `None` if they were not seen to turn with the rotor.
    pub fn found_hall(&self) -> Option<HallPlacement> {
        self.hall.found()
    }

    /// Returns the results.
    pub const fn found(&self) -> &MotorMeasurement {
        &self.found
    }

    /// Returns the command for the interrupt, while the run is active.
    pub fn probe_command(&self) -> Option<ProbeCommand> {
        self.is_running().then_some(self.command)
    }

    /// Processes the last block, once a millisecond. Returns true when the run has just completed.
    pub fn process_block(&mut self, block: &ProbeReport) -> bool {
        if !self.is_running() {
            return false;
        }
        self.run_blocks += 1;
        self.blocks += 1;
        if self.run_blocks > MAX_RUN_BLOCKS {
            self.end(AbortReason::Time);
            return false;
        }
        let fresh = block.run == self.command.run && block.number != self.last_block;
        if !fresh {
            self.missing += 1;
            if self.missing > MAX_MISSING_BLOCKS {
                self.end(AbortReason::NoAnswer);
            }
            return false;
        }
        (self.last_block, self.missing) = (block.number, 0);
        if block.tripped {
            self.end(AbortReason::Overcurrent);
            return false;
        }
        if self.step == CommissioningStep::Offsets {
            (self.encoder, self.turned) = (block.encoder, 0);
            self.found.offset_a = block.offset_a;
            self.command.along_v = INITIAL_VOLTAGE_V;
            self.enter(CommissioningStep::HalfCurrent);
            return false;
        }
        self.turned += i64::from(block.encoder.wrapping_sub(self.encoder) as i32);
        self.encoder = block.encoder;
        let joint_rad = self.turned as f32 * RAD_PER_UNIT / self.bounds.gear_ratio;
        if joint_rad.abs() > self.bounds.travel_rad {
            self.end(AbortReason::Travel);
            return false;
        }
        if let Err(reason) = self.run_step(block) {
            self.end(reason);
        }
        self.step == CommissioningStep::Done
    }

    #[inline(never)]
    fn enter(&mut self, step: CommissioningStep) {
        self.step = step;
        self.blocks = 0;
        self.is_holding = false;
        self.sums = BlockSums::default();
        self.command.square_v = [0.0; 2];
        let hz = match step {
            CommissioningStep::SlowForward => SLOW_HZ,
            CommissioningStep::SlowBack => -SLOW_HZ,
            CommissioningStep::FastForward => self.fast_hz(),
            CommissioningStep::FastBack => -self.fast_hz(),
            _ => return,
        };
        let CommissioningBounds { travel_rad, gear_ratio, .. } = self.bounds;
        self.rotation = FieldRotation::begin(hz, travel_rad * gear_ratio, self.gear);
    }

    fn run_step(&mut self, block: &ProbeReport) -> Result<(), AbortReason> {
        match self.step {
            CommissioningStep::HalfCurrent if self.low.blocks == 0 => {
                if let Some(mean) = self.step_level(block, LOW_CURRENT_SHARE)? {
                    self.low = mean;
                    self.enter(CommissioningStep::HalfCurrent);
                }
            }
            CommissioningStep::HalfCurrent => {
                if let Some(mean) = self.step_level(block, HALF_CURRENT_SHARE)? {
                    self.half = mean;
                    self.enter(CommissioningStep::FullCurrent);
                }
            }
            CommissioningStep::FullCurrent => {
                if let Some(mean) = self.step_level(block, 1.0)? {
                    self.compute_resistance(&mean)?;
                    self.enter(CommissioningStep::InductanceAlong);
                }
            }
            CommissioningStep::InductanceAlong => {
                self.step_inductance(block, 0, CommissioningStep::InductanceAcross)?
            }
            CommissioningStep::InductanceAcross => {
                self.step_inductance(block, 1, CommissioningStep::SlowForward)?
            }
            CommissioningStep::SlowForward
            | CommissioningStep::SlowBack
            | CommissioningStep::FastForward
            | CommissioningStep::FastBack => {
                self.run_rotation(block)?;
            }
            CommissioningStep::Down => {
                let left = (RAMP_DOWN_BLOCKS + 1).saturating_sub(self.blocks).max(1);
                self.command.along_v -= self.command.along_v / left as f32;
                if self.blocks >= RAMP_DOWN_BLOCKS {
                    self.step = CommissioningStep::Done;
                }
            }
            CommissioningStep::Idle
            | CommissioningStep::Offsets
            | CommissioningStep::Done
            | CommissioningStep::Aborted
            | CommissioningStep::Rubbing => {}
        }
        Ok(())
    }

    /// Computes resistance and dead time from the results at the three currents.
    fn compute_resistance(&mut self, full: &BlockSums) -> Result<(), AbortReason> {
        let level = |sums: &BlockSums| Level { current_a: sums.along_a, voltage_v: sums.voltage_v };
        let full = level(full);
        let found = loss::find([level(&self.low), level(&self.half), full]);
        let ohm = check_range(found.resistance_ohm, 1e-4, 1e3)?;
        let dead_time_s = found.lost_v / self.bounds.bus_v.max(1.0) * PERIOD_S;
        self.found.resistance_ohm = ohm;
        self.found.dead_time_s = check_range(dead_time_s, 0.0, DEAD_TIME_SHARE_MAX * PERIOD_S)?;
        self.found.dead_time_current_a = found.current_a;
        // From here on the probe adds what the phases lose.
        // `clamp` is avoided: with variable bounds, its panic message adds 15 KB of float formatting to the image.
        let taken_v = (full.voltage_v - ohm * full.current_a).max(0.0).min(full.voltage_v);
        self.command.dead_v = found.lost_v;
        self.command.dead_a = found.current_a;
        self.command.along_v -= taken_v;
        Ok(())
    }

    /// Raises the voltage until this share of the current flows; returns the mean after the hold time.
    fn step_level(
        &mut self,
        block: &ProbeReport,
        share: f32,
    ) -> Result<Option<BlockSums>, AbortReason> {
        if !self.is_holding {
            if block.along_a >= share * self.bounds.current_a {
                self.is_holding = true;
                self.blocks = 0;
            } else if self.command.along_v > MAX_VOLTAGE_SHARE * self.bounds.bus_v {
                return Err(AbortReason::NoCurrent);
            } else {
                self.command.along_v *= VOLTAGE_GROWTH_PER_BLOCK;
            }
            return Ok(None);
        }
        if self.blocks <= SETTLE_BLOCKS {
            return Ok(None);
        }
        self.sums.add(block, 0);
        if self.blocks < SETTLE_BLOCKS + MEAN_BLOCKS {
            return Ok(None);
        }
        let mean = self.sums.mean();
        // At the smallest current, the phases of a bridge may lose different voltages.
        if share >= HALF_CURRENT_SHARE && mean.across_a.abs() > 0.25 * mean.along_a {
            return Err(AbortReason::NotAlong);
        }
        Ok(Some(mean))
    }

    /// Raises the square wave until its response is large enough. L follows from the response `x = v/R tanh(R n
    /// T / 2L)`.
    fn step_inductance(
        &mut self,
        block: &ProbeReport,
        axis: usize,
        next: CommissioningStep,
    ) -> Result<(), AbortReason> {
        let Some(square_v) = self.command.square_v.get_mut(axis) else { return Ok(()) };
        let most_v = MAX_VOLTAGE_SHARE * self.bounds.bus_v;
        let response_a = block.response_a.get(axis).copied().unwrap_or(0.0);
        if !self.is_holding {
            if response_a >= SQUARE_RESPONSE_SHARE * self.bounds.current_a || *square_v > most_v {
                self.is_holding = true;
                self.blocks = 0;
            } else {
                *square_v = (*square_v * SQUARE_GROWTH_PER_BLOCK).max(INITIAL_VOLTAGE_V);
            }
            return Ok(());
        }
        if self.blocks <= SETTLE_BLOCKS / 3 {
            return Ok(());
        }
        self.sums.add(block, axis);
        if self.blocks < SETTLE_BLOCKS / 3 + MEAN_BLOCKS {
            return Ok(());
        }
        let square_v = *square_v;
        let mean = self.sums.mean();
        let ratio = mean.response_a * self.found.resistance_ohm / square_v;
        let is_valid =
            mean.response_a >= MIN_SQUARE_RESPONSE_SHARE * self.bounds.current_a && ratio < 0.95;
        if !is_valid {
            return Err(AbortReason::InductanceUnclear);
        }
        let doubled = libm::logf((1.0 + ratio) / (1.0 - ratio));
        let half_wave_s = HALF_WAVE_PERIODS as f32 * PERIOD_S;
        let henry = check_range(self.found.resistance_ohm * half_wave_s / doubled, 1e-7, 1.0)?;
        if let Some(place) = self.found.inductance_h.get_mut(axis) {
            *place = henry;
        }
        self.enter(next);
        Ok(())
    }
}

/// Returns a value if it is within the range of its parameter.
fn check_range(value: f32, least: f32, most: f32) -> Result<f32, AbortReason> {
    if value >= least && value <= most { Ok(value) } else { Err(AbortReason::OutOfRange) }
}

/// The loop reports once per block.
const _: () =
    assert!((BLOCK_PERIODS as f32 * PERIOD_S - super::loop_data::REPORT_PERIOD_S).abs() < 1e-9);
