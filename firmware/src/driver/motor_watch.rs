//! Background checks of the motor against its parameters, and a thermal model of its winding. Runs once a
//! millisecond.
//!
//! *Reversed EMF.* A turning magnet induces `w psi`: the applied voltage less `R i`. If the electrical zero is
//! wrong by half an electrical turn, the EMF has the opposite sign, for any flux and resistance. A current along
//! the magnet, which burns braking power, adds a voltage of its own, which is subtracted.
//!
//! *Blocked or stalled.* If the zero is wrong by a quarter turn, or two phases are swapped, there is no torque
//! and nothing turns. This looks like a joint that is held, until the joint has moved once since it was armed.
//! After that the wiring is known to be correct, and the joint counts as stalled.
//!
//! *Proof.* A joint that has travelled in the direction of its current, with an EMF of the right sign, is wired as
//! its parameters say. The driver keeps this proof with the CRC of these parameters, over disarming and resets. A
//! proven joint may be armed with a load that its motor must hold.
//!
//! *Turning unseen.* The encoder stands, and the current shows that the rotor turns ([`super::unseen_turning`]).
//!
//! *Winding.* A winding is warmer than the stator with its thermistor. The difference follows the copper loss
//! with its own time constant (`rise' = (loss k - rise) / time`). At stall in cold water it reaches 100 K. It survives a
//! reset ([`crate::driver::Boot::winding_rise_k`]). If it is lost, the winding is assumed to be so hot that half of the
//! current is left.

use super::loop_data::{LoopReport, REPORT_PERIOD_S};
use super::unseen_turning::UnseenTurning;
use crate::control::MotorParameters;
use crate::supervisor::Thresholds;

/// Minimum expected EMF for a decision on its sign, V: three times the possible effect of the dead time.
const MIN_EMF_V: f32 = 1.5;
/// Minimum EMF of the opposite sign, as a share of the expected EMF.
const REVERSED_EMF_SHARE: f32 = 0.3;
/// Minimum travel after which a joint is known to turn, rad: ten times the presliding of a seal.
const MIN_TRAVEL_RAD: f32 = 0.02;
/// Minimum travel in the direction of the current that proves the wiring, rad: ten times the step of a motor that
/// only aligns to a wrong field.
const PROOF_TRAVEL_RAD: f32 = 0.1;
/// Minimum current of that travel, A: five times the error of the sensors.
const PROOF_CURRENT_A: f32 = 0.5;
/// Speed below which a joint counts as standing, rad/s.
const STANDSTILL_RAD_S: f32 = 0.02;
/// Temperature coefficient of copper, 1/K, from 20 deg C.
const COPPER_PER_KELVIN: f32 = 0.0039;
/// Largest rise of a winding above its stator, K: beyond it, every insulation fails.
const MAX_RISE_K: f32 = 300.0;
/// Assumed stator temperature of a motor without thermistor, deg C.
const UNMEASURED_STATOR_C: f32 = 40.0;

/// State of the motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorState {
    /// The EMF has the opposite sign of the speed.
    pub is_emf_reversed: bool,
    /// The rotor turns, and its encoder stands.
    pub is_turning_unseen: bool,
    /// Current flows, the joint stands, it has not moved since it was armed, and its wiring is not proven.
    pub is_blocked: bool,
    /// The joint has travelled in the direction of its current since it was armed: its wiring is proven.
    pub is_proven: bool,
    /// Current flows and the joint stands, after it has moved or with proven wiring.
    pub is_stalled: bool,
    /// Winding temperature of the model, deg C; `None` if the model is off.
    pub winding_c: Option<f32>,
}

/// Memory of the motor checks.
#[derive(Clone, Copy, Debug, Default)]
pub struct MotorWatch {
    moved_rad: f32,
    has_moved: bool,
    /// Travel in the direction of the current since the joint was armed, rad.
    driven_rad: f32,
    unseen: UnseenTurning,
    /// Rise of the winding above the stator, K; `None` until the first report after a start that lost it.
    rise_k: Option<f32>,
}

impl MotorWatch {
    /// Starts with this rise of the winding above the stator, K. A rise that no winding has counts as unknown, as `None`.
    pub fn with_rise(rise_k: Option<f32>) -> Self {
        let is_plausible = |rise_k: &f32| (0.0..=MAX_RISE_K).contains(rise_k);
        Self { rise_k: rise_k.filter(is_plausible), ..Self::default() }
    }

    /// Returns the rise of the winding above the stator, K, once it is known.
    pub const fn rise_k(&self) -> Option<f32> {
        self.rise_k
    }

    /// Forgets everything but the heat.
    pub(crate) fn forget_travel(&mut self) {
        *self = Self { rise_k: self.rise_k, ..Self::default() };
    }

    /// Processes a report. `armed` must be false while the motor is measured. `proven`: the wiring is proven.
    // Not inlined: from its own part, it reaches the fields by short offsets.
    #[inline(never)]
    pub fn step(
        &mut self,
        report: &LoopReport,
        motor: &MotorParameters,
        thresholds: &Thresholds,
        armed: bool,
        proven: bool,
    ) -> MotorState {
        let winding_c = self.winding_temperature(report, motor, thresholds);
        if !armed {
            self.forget_travel();
            return MotorState { winding_c, ..MotorState::default() };
        }
        let travel_rad = report.velocity_rad_s * REPORT_PERIOD_S;
        self.moved_rad += travel_rad;
        self.has_moved |= self.moved_rad.abs() > MIN_TRAVEL_RAD;
        let way = motor.joint_direction;
        let speed = report.velocity_rad_s * motor.gear_ratio * way;
        let expected_v = speed * motor.torque_constant_nm_per_a * (1.0 / 1.5);
        // A current along the magnet induces a voltage along q, too.
        let coupled_v = speed * motor.pole_pairs * motor.inductance_d_h * report.current_d_a;
        let induced_v =
            report.voltage_q_v - motor.resistance_ohm * report.current_a * way - coupled_v;
        let held = report.current_reference_a.abs() >= thresholds.stall_current_a
            && report.velocity_rad_s.abs() < STANDSTILL_RAD_S;
        let is_fast = expected_v.abs() > MIN_EMF_V;
        let agreement = induced_v * expected_v;
        let square = REVERSED_EMF_SHARE * expected_v * expected_v;
        if is_fast && agreement < square {
            self.driven_rad = 0.0;
        } else if report.current_a.abs() >= PROOF_CURRENT_A {
            self.driven_rad = (self.driven_rad + travel_rad * report.current_a.signum()).max(0.0);
        }
        let is_known = self.has_moved || proven;
        MotorState {
            is_emf_reversed: is_fast && agreement < -square,
            is_turning_unseen: self.unseen.step(report, motor, expected_v),
            is_blocked: held && !is_known,
            is_stalled: held && is_known,
            is_proven: self.driven_rad > PROOF_TRAVEL_RAD,
            winding_c,
        }
    }

    fn winding_temperature(
        &mut self,
        report: &LoopReport,
        motor: &MotorParameters,
        thresholds: &Thresholds,
    ) -> Option<f32> {
        let Thresholds { winding_k_per_w, winding_time_s, .. } = *thresholds;
        if winding_k_per_w == 0.0 {
            self.rise_k = None;
            return None;
        }
        let measured = report.motor_temperature_c.unwrap_or(UNMEASURED_STATOR_C);
        let stator_c = if measured.is_finite() { measured } else { UNMEASURED_STATOR_C };
        // Half of the current is left there: with resets at any rate, a stall then stays within the winding's class.
        let hot_c = 0.5 * (thresholds.winding_derate_c + thresholds.winding_max_c);
        let rise_k = self.rise_k.unwrap_or_else(|| (hot_c - stator_c).max(0.0));
        let winding_c = stator_c + rise_k;
        let gain = (1.0 + COPPER_PER_KELVIN * (winding_c - 20.0)).max(1.0);
        let [a, b, c] = report.phase_currents_a.unwrap_or_default();
        let square = a * a + b * b + c * c;
        // A current that is not finite is a fault of its own.
        let loss_w = if square.is_finite() { motor.resistance_ohm * gain * square } else { 0.0 };
        let share = REPORT_PERIOD_S / winding_time_s;
        self.rise_k = Some(rise_k + share * (loss_w * winding_k_per_w - rise_k));
        Some(winding_c)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(current_a: f32, velocity_rad_s: f32, voltage_q_v: f32) -> LoopReport {
        LoopReport {
            current_a,
            current_reference_a: current_a,
            velocity_rad_s,
            voltage_q_v,
            phase_currents_a: Some([current_a, -0.5 * current_a, -0.5 * current_a]),
            motor_temperature_c: Some(20.0),
            ..LoopReport::default()
        }
    }

    fn check(watch: &mut MotorWatch, report: &LoopReport, armed: bool) -> MotorState {
        watch.step(report, &MotorParameters::default(), &Thresholds::default(), armed, false)
    }

    #[test]
    fn motor_with_zero_off_by_half_a_turn_reports_reversed_emf() {
        let mut watch = MotorWatch::default();
        // 4 rad/s of the joint induce 2.67 V; 10 A take 1.2 V.
        for (voltage_v, is_emf_reversed) in
            [(3.87, false), (1.2, false), (-1.47, true), (0.0, true)]
        {
            let state = check(&mut watch, &report(10.0, 4.0, voltage_v), true);
            assert_eq!(state.is_emf_reversed, is_emf_reversed, "{voltage_v}");
            let state = check(&mut watch, &report(-10.0, -4.0, -voltage_v), true);
            assert_eq!(state.is_emf_reversed, is_emf_reversed, "{voltage_v}");
        }
        // At low speed the effect of the dead time is larger than the EMF; with an open bridge no voltage is applied.
        assert!(!check(&mut watch, &report(10.0, 2.0, -0.1), true).is_emf_reversed);
        assert!(!check(&mut watch, &report(0.0, 9.0, 0.0), true).is_emf_reversed);
        let mut turned = MotorParameters { joint_direction: -1.0, ..MotorParameters::default() };
        let state = |motor: &MotorParameters, volts| {
            let thresholds = Thresholds::default();
            MotorWatch::default()
                .step(&report(10.0, 4.0, volts), motor, &thresholds, true, false)
                .is_emf_reversed
        };
        assert!(!state(&turned, -3.87) && state(&turned, 1.47));
        turned.joint_direction = 1.0;
        assert!(!state(&turned, 3.87));
    }

    #[test]
    fn emf_of_a_motor_with_current_along_its_magnet_keeps_its_sign() {
        // At 8 rad/s, -26 A along the magnet induce -6.7 V, more than the magnet (5.3 V).
        let burning = LoopReport { current_d_a: -26.0, ..report(-2.0, 8.0, 5.33 - 0.24 - 6.68) };
        assert!(!check(&mut MotorWatch::default(), &burning, true).is_emf_reversed);
        let reversed = LoopReport { voltage_q_v: -5.33 - 0.24 - 6.68, ..burning };
        assert!(check(&mut MotorWatch::default(), &reversed, true).is_emf_reversed);
    }

    #[test]
    fn joint_held_before_any_motion_is_blocked_and_after_motion_is_stalled() {
        let mut watch = MotorWatch::default();
        let held = report(8.0, 0.0, 1.0);
        let state = check(&mut watch, &held, true);
        assert!(state.is_blocked && !state.is_stalled);
        assert!(!check(&mut watch, &report(2.0, 0.0, 0.2), true).is_blocked, "a small current");
        for _ in 0..15 {
            check(&mut watch, &report(8.0, 2.0, 2.0), true);
        }
        let state = check(&mut watch, &held, true);
        assert!(!state.is_blocked && state.is_stalled);
        // While disarmed, the wiring may have changed.
        check(&mut watch, &held, false);
        assert!(check(&mut watch, &held, true).is_blocked);
    }

    #[test]
    fn joint_held_with_proven_wiring_is_stalled_and_not_blocked() {
        let (motor, thresholds) = (MotorParameters::default(), Thresholds::default());
        let mut watch = MotorWatch::default();
        let state = watch.step(&report(8.0, 0.0, 1.0), &motor, &thresholds, true, true);
        assert!(!state.is_blocked && state.is_stalled);
    }

    #[test]
    fn wiring_is_proven_by_travel_along_the_current_only() {
        let proven = |current_a: f32, velocity_rad_s: f32, voltage_v: f32| {
            let mut watch = MotorWatch::default();
            let report = report(current_a, velocity_rad_s, voltage_v);
            (0..200).any(|_| check(&mut watch, &report, true).is_proven)
        };
        // 4 rad/s induce 2.67 V, and 2 A take 0.24 V.
        assert!(proven(2.0, 4.0, 2.91) && proven(-2.0, -4.0, -2.91) && proven(2.0, 1.0, 0.9));
        assert!(!proven(8.0, -1.0, 0.3), "a load that sinks");
        assert!(!proven(0.2, 1.0, 0.7), "moved by hand");
        assert!(!proven(2.0, 4.0, 0.24), "no EMF along q: the zero is off by a quarter turn");
        assert!(!proven(2.0, 0.0, 0.2), "at rest");
    }

    /// Stalls a motor at the current that its driver permits, with a reset at this interval, s; returns the highest
    /// temperature of the copper, deg C.
    fn hottest_copper_c(every_s: usize, after_reset: fn(Option<f32>) -> Option<f32>) -> f32 {
        let thresholds = Thresholds::default();
        let (mut watch, mut copper) =
            (MotorWatch::with_rise(Some(0.0)), MotorWatch::with_rise(Some(0.0)));
        let (mut allowed_a, mut hottest_c) = (26.0, 0.0f32);
        for step in 0..200_000 {
            if step % (1000 * every_s) == 0 {
                watch = MotorWatch::with_rise(after_reset(watch.rise_k()));
            }
            let stalled = report(allowed_a, 0.0, 0.0);
            let known_c = check(&mut watch, &stalled, true).winding_c.expect("a model");
            hottest_c =
                hottest_c.max(check(&mut copper, &stalled, true).winding_c.expect("a model"));
            let range_k = thresholds.winding_max_c - thresholds.winding_derate_c;
            allowed_a = 26.0 * ((thresholds.winding_max_c - known_c) / range_k).clamp(0.0, 1.0);
        }
        hottest_c
    }

    #[test]
    fn winding_of_a_stalled_motor_with_resets_stays_within_its_class() {
        let class_c = Thresholds::default().winding_max_c;
        for every_s in [1, 4, 30] {
            let kept_c = hottest_copper_c(every_s, |rise_k| rise_k);
            let lost_c = hottest_copper_c(every_s, |_| None);
            let cold_c = hottest_copper_c(every_s, |_| Some(0.0));
            println!("measured: {kept_c:.0} deg C kept, {lost_c:.0} assumed hot, {cold_c:.0} cold");
            assert!(kept_c < class_c && lost_c < class_c, "{kept_c}, {lost_c} of {class_c}");
            assert!(every_s == 30 || cold_c > class_c, "a cold start has no effect: {cold_c}");
        }
        let unknown = [None, Some(f32::NAN), Some(-1.0), Some(1e9)].map(MotorWatch::with_rise);
        assert!(unknown.iter().all(|watch| watch.rise_k().is_none()));
    }

    #[test]
    fn winding_model_settles_at_the_loss_and_cools_with_its_time_constant() {
        let mut watch = MotorWatch::default();
        let thresholds = Thresholds::default();
        let run = |watch: &mut MotorWatch, current_a: f32, seconds: f32| {
            let count = (seconds / REPORT_PERIOD_S) as u32;
            (0..count).fold(0.0, |_, _| {
                check(watch, &report(current_a, 0.0, 0.0), true).winding_c.expect("a model")
            })
        };
        let warm_c = run(&mut watch, 20.0, 10.0 * thresholds.winding_time_s);
        // T = 20 + k 1.5 R (1 + 0.0039 (T - 20)) i^2
        let cold_k = thresholds.winding_k_per_w * 1.5 * 0.12 * 400.0;
        let settled_c = 20.0 + cold_k / (1.0 - COPPER_PER_KELVIN * cold_k);
        assert!((warm_c - settled_c).abs() < 1.0, "{warm_c} for {settled_c}");
        let cooled_c = run(&mut watch, 0.0, thresholds.winding_time_s);
        let share = (cooled_c - 20.0) / (warm_c - 20.0);
        assert!((share - (-1.0f32).exp()).abs() < 0.01, "{share}");
        let off = Thresholds { winding_k_per_w: 0.0, ..thresholds };
        let motor = MotorParameters::default();
        assert_eq!(watch.step(&report(20.0, 0.0, 0.0), &motor, &off, true, false).winding_c, None);
    }
}
