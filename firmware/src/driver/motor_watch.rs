//! Is the motor what the parameters say, and how hot is its copper? Once a millisecond, in the background.
//!
//! *Against its order.* Turning, a magnet induces `w psi` across itself: what the loop gives, less `R i`. Half a turn
//! (electrical) off it has the other sign, whatever flux and resistance are worth.
//! *Standing.* A quarter of a turn off, or with two phases swapped, there is no torque and nothing turns. Nothing tells that from a
//! joint that is held, until it has moved once since it was armed: then it is wired, and stalls.
//! *Copper.* A winding is warmer than the stator with its thermistor by what its loss and its own time make of it
//! (`rise' = (loss k - rise) / time`), which at stall in cold water is a hundred kelvin.

use super::LoopReport;
use super::device::REPORT_PERIOD_S;
use crate::control::MotorParameters;
use crate::supervisor::Thresholds;

/// Induced voltage from which its sign is believed, V: three times what the dead time may take.
const INDUCED_V: f32 = 1.5;
/// Share of the expected one, the other way, that is the other way.
const OTHER_WAY: f32 = 0.3;
/// What a joint has to move to be known to turn, rad: presliding of a seal is a tenth of it.
const MOVED_RAD: f32 = 0.02;
/// Slower than this a joint stands, rad/s.
const STANDS_RAD_S: f32 = 0.02;
/// Resistance of copper per kelvin, from 20 deg C.
const COPPER_PER_KELVIN: f32 = 0.0039;
/// Stator of a motor without thermistor, deg C: warm, and not hot.
const UNMEASURED_STATOR_C: f32 = 40.0;

/// What was seen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorSight {
    /// The induced voltage has the other sign than the speed.
    pub against: bool,
    /// Current flows and the joint stands, and has not moved since it was armed.
    pub stands: bool,
    /// The same of one that has moved.
    pub stalls: bool,
    /// Temperature of the copper, deg C, by the model; `None` where it is switched off.
    pub winding_c: Option<f32>,
}

/// What is remembered of the motor.
#[derive(Clone, Copy, Debug, Default)]
pub struct MotorWatch {
    moved_rad: f32,
    proven: bool,
    rise_k: f32,
}

impl MotorWatch {
    /// A report; `armed`, and not to measure the motor.
    pub fn step(
        &mut self,
        report: &LoopReport,
        motor: &MotorParameters,
        thresholds: &Thresholds,
        armed: bool,
    ) -> MotorSight {
        let winding_c = self.warm(report, motor, thresholds);
        if !armed {
            (self.moved_rad, self.proven) = (0.0, false);
            return MotorSight { winding_c, ..MotorSight::default() };
        }
        self.moved_rad += report.velocity_rad_s * REPORT_PERIOD_S;
        self.proven |= self.moved_rad.abs() > MOVED_RAD;
        let way = motor.joint_direction;
        let speed = report.velocity_rad_s * motor.gear_ratio * way;
        let expected_v = speed * motor.torque_constant_nm_per_a * (1.0 / 1.5);
        let induced_v = report.voltage_q_v - motor.resistance_ohm * report.current_a * way;
        let held = report.current_reference_a.abs() >= thresholds.stall_current_a
            && report.velocity_rad_s.abs() < STANDS_RAD_S;
        MotorSight {
            against: expected_v.abs() > INDUCED_V
                && induced_v * expected_v < -OTHER_WAY * expected_v * expected_v,
            stands: held && !self.proven,
            stalls: held && self.proven,
            winding_c,
        }
    }

    fn warm(
        &mut self,
        report: &LoopReport,
        motor: &MotorParameters,
        thresholds: &Thresholds,
    ) -> Option<f32> {
        let Thresholds { winding_k_per_w, winding_time_s, .. } = *thresholds;
        if winding_k_per_w == 0.0 {
            self.rise_k = 0.0;
            return None;
        }
        let measured = report.motor_temperature_c.unwrap_or(UNMEASURED_STATOR_C);
        let stator_c = if measured.is_finite() { measured } else { UNMEASURED_STATOR_C };
        let winding_c = stator_c + self.rise_k;
        let gain = (1.0 + COPPER_PER_KELVIN * (winding_c - 20.0)).max(1.0);
        let [a, b, c] = report.phase_currents_a.unwrap_or_default();
        let square = a * a + b * b + c * c;
        // A current that is no number is a fault of its own.
        let loss_w = if square.is_finite() { motor.resistance_ohm * gain * square } else { 0.0 };
        let share = REPORT_PERIOD_S / winding_time_s;
        self.rise_k += share * (loss_w * winding_k_per_w - self.rise_k);
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

    fn look(watch: &mut MotorWatch, report: &LoopReport, armed: bool) -> MotorSight {
        watch.step(report, &MotorParameters::default(), &Thresholds::default(), armed)
    }

    #[test]
    fn the_induced_voltage_of_a_motor_half_a_turn_off_has_the_other_sign() {
        let mut watch = MotorWatch::default();
        // 4 rad/s of the joint induce 2.67 V; 10 A take 1.2 V.
        for (voltage_v, against) in [(3.87, false), (1.2, false), (-1.47, true), (0.0, true)] {
            let seen = look(&mut watch, &report(10.0, 4.0, voltage_v), true);
            assert_eq!(seen.against, against, "{voltage_v}");
            let seen = look(&mut watch, &report(-10.0, -4.0, -voltage_v), true);
            assert_eq!(seen.against, against, "{voltage_v}");
        }
        // Slow, the dead time is larger than it; open, there is nothing.
        assert!(!look(&mut watch, &report(10.0, 2.0, -0.1), true).against);
        assert!(!look(&mut watch, &report(0.0, 9.0, 0.0), true).against);
        let mut turned = MotorParameters { joint_direction: -1.0, ..MotorParameters::default() };
        let seen = |motor: &MotorParameters, volts| {
            let thresholds = Thresholds::default();
            MotorWatch::default().step(&report(10.0, 4.0, volts), motor, &thresholds, true).against
        };
        assert!(!seen(&turned, -3.87) && seen(&turned, 1.47));
        turned.joint_direction = 1.0;
        assert!(!seen(&turned, 3.87));
    }

    #[test]
    fn a_joint_that_has_moved_since_it_was_armed_stalls_and_one_that_has_not_stands() {
        let mut watch = MotorWatch::default();
        let held = report(8.0, 0.0, 1.0);
        let seen = look(&mut watch, &held, true);
        assert!(seen.stands && !seen.stalls);
        assert!(!look(&mut watch, &report(2.0, 0.0, 0.2), true).stands, "a small current");
        for _ in 0..15 {
            look(&mut watch, &report(8.0, 2.0, 2.0), true);
        }
        let seen = look(&mut watch, &held, true);
        assert!(!seen.stands && seen.stalls);
        // Disarmed it may have been wired anew.
        look(&mut watch, &held, false);
        assert!(look(&mut watch, &held, true).stands);
    }

    #[test]
    fn copper_warms_to_its_loss_times_its_resistance_and_cools_in_its_time() {
        let mut watch = MotorWatch::default();
        let thresholds = Thresholds::default();
        let run = |watch: &mut MotorWatch, current_a: f32, seconds: f32| {
            let count = (seconds / REPORT_PERIOD_S) as u32;
            (0..count).fold(0.0, |_, _| {
                look(watch, &report(current_a, 0.0, 0.0), true).winding_c.expect("a model")
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
        assert_eq!(watch.step(&report(20.0, 0.0, 0.0), &motor, &off, true).winding_c, None);
    }
}
