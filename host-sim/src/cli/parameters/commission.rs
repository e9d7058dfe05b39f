//! `params commission`: shows, measures and confirms the wiring parameters of a joint.
//!
//! With `--measure`, the driver measures its motor. The run is supervised: this tool sends a keep-alive every 20 ms. If
//! the tool ends, fails or is stopped by Ctrl-C, the driver opens its bridge within 0.1 s. The results are written only
//! after they were shown and confirmed.

use super::measure::{KEEP_ALIVE_PERIOD, MeasureArguments, ORDER_CONTINUE, ORDER_STOP};
use super::{Driver, Result, print_result, print_text};
use crate::cli::error::Refusal;
use crate::cli::output::pretty;
use canopen_rs::Address;
use firmware::control::{MotorParameters, PERIOD_S};
use firmware::driver::commissioning::CommissioningStep;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::{CommissioningObject, CommissioningRunObject};
use firmware::parameter_set::ParameterSet;
use joint_bus::bus::Bus;
use joint_bus::parameters::{read_set, read_staged, write_set};
use joint_tuning::names::differences;
use serde_json::json;

/// Order that starts a measurement.
const ORDER_MEASURE: u8 = 1;

/// The driver computes the wiring in another way.
#[derive(Debug, thiserror::Error)]
#[error(
    "the driver reports the wiring crc {reported:08x}, but its parameters give {computed:08x}: the firmware version may differ from that of host-sim"
)]
struct OtherWiring {
    reported: u32,
    computed: u32,
}

/// Returns the wiring parameters of a set with their names below `motor`.
fn wiring_of(set: &ParameterSet) -> impl Iterator<Item = (&'static str, f32)> {
    let motor = MotorParameters::NAMES.into_iter().zip(set.motor.to_array());
    motor.filter(|(field, _)| ParameterSet::WIRING_PARAMETERS.contains(field))
}

/// Describes a step of the measurement for the user.
fn step_description(step: u32) -> &'static str {
    const DESCRIPTIONS: [&str; 11] = [
        "starting",
        "measuring the offsets of the current sensors",
        "measuring the resistance: half the current, standing field",
        "measuring the resistance: full current, standing field",
        "measuring the inductance of the d axis",
        "measuring the inductance of the q axis",
        "turning the field slowly: pole pairs, direction, electrical zero",
        "turning the field slowly, reverse",
        "turning the field faster: flux",
        "turning the field faster, reverse",
        "reducing the current to zero",
    ];
    DESCRIPTIONS.get(step as usize).copied().unwrap_or("finished")
}

impl Driver {
    /// Prints the wiring parameters and whether they are confirmed. With `confirm`, confirms them first.
    pub(super) fn commission(&mut self, confirm: bool, json: bool) -> Result {
        let set = read_set(&mut self.client)?;
        let wiring = self.number(index::COMMISSIONING, CommissioningObject::WIRING_CRC)?;
        if wiring != set.wiring_crc() {
            return Err(OtherWiring { reported: wiring, computed: set.wiring_crc() }.into());
        }
        if confirm {
            self.confirm(wiring)?;
        }
        let commissioned = self.number(index::COMMISSIONING, 1)? != 0;
        let mut out = String::new();
        let mut wired = serde_json::Map::new();
        for (field, value) in wiring_of(&set) {
            let name = format!("motor.{field}");
            out += &format!("{name:<32} {value:?}\n");
            wired.insert(name, json!(value));
        }
        let result = json!({"commissioned": commissioned, "wiring_crc": format!("{wiring:08x}"), "wiring": wired});
        out += if commissioned {
            "commissioned: the joint can be armed; `params save` keeps this over a reset\n"
        } else {
            "NOT commissioned: the joint cannot be armed. Measure the parameters above with `params commission --measure` (low\n\
             current), or set each (docs/src/how-to/bring-up.md) and run `params commission --confirm`\n"
        };
        print_result(json, &result, &out)
    }

    fn confirm(&mut self, wiring: u32) -> Result {
        let at = Address::new(index::COMMISSIONING, CommissioningObject::CONFIRM);
        Ok(self.client.write(at, &wiring.to_le_bytes())?)
    }

    /// Measures the motor and prints the results. Commits and confirms them if the user agrees.
    pub(super) fn measure_motor(
        &mut self,
        how: &MeasureArguments,
        name: &str,
        json: bool,
    ) -> Result {
        let before = read_set(&mut self.client)?;
        self.set_limits(how, how.travel)?;
        let current_a = self.float(CommissioningRunObject::CURRENT)?;
        let travel_rad = self.float(CommissioningRunObject::TRAVEL)?;
        let question = format!(
            "{name} will apply {current_a} A to its motor and move the joint by up to {travel_rad} rad to either side, for at \
             most half a minute. Keep the range clear and be ready to switch off the supply. Continue?"
        );
        if !how.is_confirmed(&question)? {
            return Err(Refusal::Declined.into());
        }
        self.order(ORDER_MEASURE)?;
        let step = self.watch_run(json);
        if step.is_err() {
            // Without keep-alive the driver stops after 0.1 s; the stop order acts sooner.
            let _ = self.order(ORDER_STOP);
        }
        if step? != CommissioningStep::Done as u32 {
            return Err(self.end_reason()?.into());
        }
        let found = read_staged(&mut self.client)?;
        let results = self.describe_results(&before, &found, json)?;
        print_text(&results)?;
        let done = if how.is_confirmed("Store these values and confirm the wiring?")? {
            let active = write_set(&mut self.client, &found)?;
            self.confirm(found.wiring_crc())?;
            format!(
                "{} values changed, wiring confirmed (crc {active:08x}, not saved: run `params save` to keep them over a reset)",
                differences(&before, &found).len()
            )
        } else {
            self.client.write(Address::new(index::COMMIT, 4), &[1])?;
            "nothing was changed".to_owned()
        };
        if json { Ok(()) } else { print_text(&format!("{name}: {done}\n")) }
    }

    /// Sends keep-alive orders until the run ends. Returns the step in which it ended.
    fn watch_run(&mut self, json: bool) -> Result<u32> {
        let mut last_step = 0;
        loop {
            self.order(ORDER_CONTINUE)?;
            let step = self.number(index::COMMISSIONING_RUN, CommissioningRunObject::STEP)?;
            if step >= CommissioningStep::Done as u32 {
                return Ok(step);
            }
            if step != last_step && !json {
                eprintln!("  {}", step_description(step));
            }
            last_step = step;
            self.client.bus().discard_within(KEEP_ALIVE_PERIOD)?;
        }
    }

    /// Returns the measured values as text or JSON.
    fn describe_results(
        &mut self,
        before: &ParameterSet,
        found: &ParameterSet,
        json: bool,
    ) -> Result<String> {
        use CommissioningRunObject as R;
        let [offset_a, offset_b] = [self.float(R::OFFSET_A)?, self.float(R::OFFSET_B)?];
        let lag_rad = self.float(R::LAG)?;
        let friction_nm = self.float(R::FRICTION_TORQUE)?;
        let phase_margin_deg = self.float(R::PHASE_MARGIN)?.to_degrees();
        let gain_margin_db = 20.0 * self.float(R::GAIN_MARGIN)?.log10();
        let (was, is) = (&before.motor, &found.motor);
        if json {
            let wiring: serde_json::Map<_, _> =
                wiring_of(found).map(|(field, value)| (field.to_owned(), json!(value))).collect();
            let result = json!({
                "offset_a": [offset_a, offset_b], "lag_rad": lag_rad, "friction_torque_nm": friction_nm, "wiring": wiring,
                "dead_time_s": is.dead_time_s, "dead_time_current_a": is.dead_time_current_a,
                "current_bandwidth_hz": is.current_bandwidth_hz, "phase_margin_deg": phase_margin_deg,
                "gain_margin_db": gain_margin_db,
            });
            return pretty(&result);
        }
        let direction = |sign: f32| if sign > 0.0 { "with" } else { "against" };
        let turned = is.encoder_direction != was.encoder_direction;
        let mut out = format!(
            "measured:\n\
             current sensor offsets     {offset_a:+.3} A and {offset_b:+.3} A, corrected\n\
             phase resistance           {:.4} ohm (was {:.4}): winding, cable and switch at their current temperature\n\
             inductance of d, q axis    {:.1} uH and {:.1} uH (was {:.1} and {:.1})\n\
             pole pairs                 {} (was {})\n\
             encoder                    counts {} the order of phases a, b, c (was {}); reads {:+.4} rad with the magnet aligned to phase a (was {:+.4})\n\
             torque constant            {:.5} Nm/A at the motor (was {:.5}), {:.3} Nm/A at the joint (was {:.3}), with unchanged gear efficiency\n\
             friction at low speed      {:.2} Nm at the joint: the rotor lags the field by {:.0} electrical degrees\n\
             dead time of the bridge    {:.0} ns: {:.2} % of the bus voltage, half of it lost at {:.2} A (was {:.0} ns); compensated\n\
             current loop               {:.0} Hz (was {:.0}): phase margin {phase_margin_deg:.0} degrees, gain margin {gain_margin_db:.1} dB with 5 % less inductance\n",
            is.resistance_ohm,
            was.resistance_ohm,
            1e6 * is.inductance_d_h,
            1e6 * is.inductance_q_h,
            1e6 * was.inductance_d_h,
            1e6 * was.inductance_q_h,
            is.pole_pairs,
            was.pole_pairs,
            direction(is.encoder_direction),
            direction(was.encoder_direction),
            is.encoder_offset_rad,
            was.encoder_offset_rad,
            is.torque_constant_nm_per_a,
            was.torque_constant_nm_per_a,
            found.friction.compensator.torque_constant_nm_per_a,
            before.friction.compensator.torque_constant_nm_per_a,
            friction_nm,
            lag_rad.to_degrees(),
            1e9 * is.dead_time_s,
            100.0 * is.dead_time_s / PERIOD_S,
            is.dead_time_current_a,
            1e9 * was.dead_time_s,
            is.current_bandwidth_hz,
            was.current_bandwidth_hz,
        );
        if turned {
            out += "joint_direction was reversed together with encoder_direction, so that the sign of the position is unchanged.\n\
                    If this sign is wrong: `params set motor.joint_direction=";
            out += &format!("{}`\n", -is.joint_direction);
        }
        Ok(out)
    }
}
