//! The steps with a turning field: pole pairs, encoder direction, electrical zero and flux.
//!
//! ```text
//! slow forward -> slow back:  pole pairs, direction, zero, and the lag by friction;  a first estimate of the flux
//! fast forward -> fast back:  flux, the mean of both
//! ```
//! The field turns at a constant speed and pulls the rotor with it ([`super::field_rotation`] moves it). The encoder then
//! counts as many turns as the field has, divided by the pole pairs. Both directions are needed, because friction makes
//! the rotor lag behind the field in each. The flux is found from the voltage across the current. This voltage grows with
//! the speed, so the fast steps measure it, as fast as the bus voltage permits.

use super::field_rotation::{FieldRatio, Lag, RotationWindow};
use super::{AbortReason, BlockSums, Commissioning, CommissioningStep, check_range};
use crate::control::probe::ProbeReport;
use crate::control::transform::RAD_PER_UNIT;
use core::f32::consts::{PI, TAU};

/// Speeds of the field, electrical turns per second.
pub(super) const SLOW_HZ: f32 = 4.0;
const FAST_HZ: f32 = 24.0;
/// Share of the voltage that drives the current, up to which the faster field may induce a voltage; it is reduced beyond.
const MAX_EMF_SHARE: f32 = 0.35;
/// Limits of the current while the field turns, as shares: minimum along the field, maximum across it.
const MIN_ALONG_SHARE: f32 = 0.4;
const MAX_ACROSS_SHARE: f32 = 0.6;
/// Maximum deviation of the pole pair measurement from a whole number.
const POLE_PAIR_TOLERANCE: f32 = 0.15;
/// Maximum angle by which friction may hold the rotor back.
const LAG_MAX_RAD: f32 = PI / 3.0;

impl Commissioning {
    /// Runs a step of the rotation at constant speed over a whole motor turn.
    pub(super) fn run_rotation(&mut self, block: &ProbeReport) -> Result<(), AbortReason> {
        // If the rotor slips or a phase is open, the current leaves the direction of the voltage.
        let current_a = self.bounds.current_a;
        let along = block.along_a >= MIN_ALONG_SHARE * current_a;
        if !along || block.across_a.abs() > MAX_ACROSS_SHARE * current_a {
            return Err(AbortReason::NotAlong);
        }
        let had = self.rotation.window.blocks;
        self.rotation.step(block, self.turned, &mut self.command.turn_per_period)?;
        let window = self.rotation.window;
        if window.blocks > had {
            self.sums.add(block, 0);
            if self.gear.signed != 0 {
                let pole_pairs = u32::from(self.found.pole_pairs);
                self.hall.add(self.hall_levels, block.encoder.wrapping_mul(pole_pairs));
            }
        }
        if !self.rotation.is_over() {
            return Ok(());
        }
        match self.step {
            CommissioningStep::SlowForward => {
                self.forward_window = window;
                self.enter(CommissioningStep::SlowBack);
            }
            CommissioningStep::SlowBack => {
                self.compute_zero(&window)?;
                // An estimate: the lag of each block is not known yet.
                self.found.flux_vs = self.compute_flux(-SLOW_HZ, Lag::NONE);
                self.enter(CommissioningStep::FastForward);
            }
            CommissioningStep::FastForward => {
                self.flux_forward_vs = self.compute_flux(self.fast_hz(), window.lag());
                self.enter(CommissioningStep::FastBack);
            }
            _ => {
                let back_vs = self.compute_flux(-self.fast_hz(), window.lag());
                self.found.flux_vs =
                    check_range(0.5 * (self.flux_forward_vs + back_vs), 1e-7, 1e2)?;
                self.enter(CommissioningStep::Down);
            }
        }
        Ok(())
    }

    /// Computes pole pairs, direction and electrical zero from both rotations.
    fn compute_zero(&mut self, back: &RotationWindow) -> Result<(), AbortReason> {
        let turns = [self.forward_window.turns_of_field(), back.turns_of_field()];
        let pole_pairs = (turns[0].abs() + 0.5) as u8 as f32;
        let is_whole = |turns: f32| (turns.abs() - pole_pairs).abs() < POLE_PAIR_TOLERANCE;
        let has_same_sign = (turns[0] > 0.0) == (turns[1] > 0.0);
        if !(1.0..=64.0).contains(&pole_pairs) || !has_same_sign || !turns.into_iter().all(is_whole)
        {
            return Err(AbortReason::PolePairsUnclear);
        }
        let direction = if turns[0] > 0.0 { 1 } else { -1 };
        let signed = direction * pole_pairs as i64;
        let (there, back) = (self.forward_window.apart(signed), back.apart(signed));
        let lag = there.wrapping_sub(back) as i32 / 2;
        let zero = back.wrapping_add(lag as u32);
        self.found.lag_rad = lag as f32 * RAD_PER_UNIT;
        if self.found.lag_rad.abs() > LAG_MAX_RAD {
            return Err(AbortReason::LagTooGreat);
        }
        self.gear = FieldRatio { zero, signed };
        self.found.pole_pairs = pole_pairs as u8;
        self.found.encoder_direction = direction as i8;
        self.found.encoder_offset_rad = -(zero as i32 as f32) * RAD_PER_UNIT / signed as f32;
        Ok(())
    }

    /// Returns the faster speed, electrical turns per second, limited by the flux from the slow rotation.
    #[inline(never)]
    pub(super) fn fast_hz(&self) -> f32 {
        let driving_v = self.found.resistance_ohm * self.bounds.current_a;
        let bound_hz = MAX_EMF_SHARE * driving_v / (TAU * self.found.flux_vs.max(1e-7));
        bound_hz.clamp(SLOW_HZ, FAST_HZ)
    }

    /// Computes the flux from the mean current of the step at a speed, with the rotor's lag.
    fn compute_flux(&self, hz: f32, lag: Lag) -> f32 {
        let BlockSums { voltage_v, along_a, across_a, .. } = self.sums.mean();
        let speed = TAU * hz;
        let [inductance_h, _] = self.found.inductance_h;
        let stored = speed * inductance_h * (along_a * along_a + across_a * across_a);
        (-voltage_v * across_a - stored) / (speed * (along_a * lag.cosine - across_a * lag.sine))
    }
}
