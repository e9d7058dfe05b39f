//! Voltage of a bridge with real switches.
//!
//! For the dead time, twice a period, both switches of a phase are open and the current decides on the node's voltage:
//!
//! ```text
//! edge at which the current turns the node over:   the switches' capacitance is charged, dv/dt = i / C;
//!                                                  then the diode conducts until the other switch closes
//! edge at which it does not:                       the diode holds the node until the switch closes
//! ```
//! The second edge loses the whole dead time, and the first one regains what the charging takes. The body diode and the
//! closed switch also have a voltage. Phases differ a little in dead time and capacitance.

use super::parameters::Parameters;

/// Current of [`Parameters::diode_drop_v`], A, and current in the exponent of a silicon junction, A.
const DIODE_AT_A: f64 = 10.0;
const JUNCTION_A: f64 = 1e-3;

/// Returns the mean voltage that a switching phase loses against its current (A), V, at a bus voltage (V) and a period (s).
pub(super) fn lost_v(
    p: &Parameters,
    phase: usize,
    current_a: f64,
    bus_v: f64,
    period_s: f64,
) -> f64 {
    let deviation = [p.phase_spread, 0.0, -p.phase_spread][phase];
    let dead_s = p.dead_time_s * (1.0 + deviation);
    let magnitude_a = current_a.abs();
    let capacitance_f = p.switch_capacitance_f * (1.0 - deviation);
    let (area_vs, conducting_s) = if capacitance_f <= 0.0 || dead_s <= 0.0 {
        let share = (magnitude_a / p.dead_time_ramp_a).min(1.0);
        (bus_v * dead_s * share, 2.0 * dead_s * share)
    } else {
        // Time that the current needs to turn the node over.
        let turn_s = capacitance_f * bus_v / magnitude_a.max(1e-9);
        if turn_s < dead_s {
            (bus_v * (dead_s - 0.5 * turn_s), 2.0 * dead_s - turn_s)
        } else {
            (0.5 * magnitude_a * dead_s * dead_s / capacitance_f, dead_s * dead_s / turn_s)
        }
    };
    let junction = |a: f64| (1.0 + a / JUNCTION_A).ln();
    let diode_v = p.diode_drop_v * junction(magnitude_a) / junction(DIODE_AT_A);
    let in_dead_time_v = (area_vs + diode_v * conducting_s) / period_s;
    in_dead_time_v.copysign(current_a) + p.switch_resistance_ohm * current_a
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 50e-6;

    #[test]
    fn default_bridge_loses_a_ramp_of_the_dead_time() {
        let p = Parameters::default();
        for (current, volts) in
            [(0.0, 0.0), (0.05, 0.144), (0.1, 0.288), (8.0, 0.288), (-8.0, -0.288)]
        {
            let lost = lost_v(&p, 0, current, 48.0, PERIOD_S);
            assert!((lost - volts).abs() < 1e-12, "{current}: {lost}");
        }
    }

    #[test]
    fn charging_of_the_switches_softens_the_loss_and_phases_differ() {
        let p = Parameters {
            dead_time_s: 0.5e-6,
            switch_capacitance_f: 2e-9,
            phase_spread: 0.05,
            ..Parameters::default()
        };
        // The current turns the node over within the dead time from 0.192 A on: half of the loss.
        let lost = |phase, current| lost_v(&p, phase, current, 48.0, PERIOD_S);
        assert!((lost(1, 0.192) - 0.24).abs() < 1e-9, "{}", lost(1, 0.192));
        assert!((lost(1, 0.096) - 0.12).abs() < 1e-9);
        assert!((lost(1, 1.92) - 0.48 * 0.95).abs() < 1e-9);
        assert!(lost(0, 8.0) > 1.04 * lost(1, 8.0) && lost(2, 8.0) < 0.96 * lost(1, 8.0));
        let dropped = Parameters { diode_drop_v: 0.9, switch_resistance_ohm: 2e-3, ..p };
        let more = lost_v(&dropped, 1, -10.0, 48.0, PERIOD_S) - lost(1, -10.0);
        assert!((-0.04..-0.035).contains(&more), "{more}");
    }
}
