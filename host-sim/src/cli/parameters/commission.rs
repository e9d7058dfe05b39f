//! `params commission`: how the joint is wired, found out by the driver itself where that is asked, and confirmed.
//!
//! A run is supervised: this tool says every 20 ms that it goes on, and where it ends, breaks or is ended by Ctrl-C the
//! driver opens its bridge within 0.1 s. Nothing is written before what was found has been shown and taken.

use super::friction_run::trace_path;
use super::names::{differences, numbers};
use super::{Driver, words};
use crate::cli::output::say;
use canopen_rs::Address;
use clap::Args;
use firmware::driver::commissioning::{Reason, Step};
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::{Commissioning, CommissioningRun};
use firmware::parameter_set::ParameterSet;
use serde_json::json;
use std::io::{BufRead, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Time between two signs of life.
pub(super) const ALIVE: Duration = Duration::from_millis(20);

/// Orders of a run.
pub(super) const STOP: u8 = 0;
const BEGIN: u8 = 1;
pub(super) const GO_ON: u8 = 2;

/// What a run is told.
#[derive(Args)]
pub(super) struct Measure {
    /// Let the driver find out by itself what motor it drives, at low current: THE JOINT MOVES. What is found is shown,
    /// and taken and confirmed when that is answered with yes
    #[arg(long)]
    measure: bool,
    /// Let the joint move by itself through its range, both ways at falling speeds, and write a trace of it for `identify`:
    /// THE JOINT MOVES. It has to be commissioned; with --measure it is that first. Nothing is changed
    #[arg(long)]
    friction_run: bool,
    /// Largest current of a run, A; without, three tenths of the motor's current limit
    #[arg(long, value_name = "A")]
    current: Option<f32>,
    /// How far the joint may go to either side in the measurement, rad; without, 0.5
    #[arg(long, value_name = "RAD", requires = "measure")]
    travel: Option<f32>,
    /// How far the joint may go to either side of where it stands in the friction run, rad; without, 0.5
    #[arg(long, value_name = "RAD", requires = "friction_run")]
    pub(super) range: Option<f32>,
    /// Speed of the friction run's first passes, rad/s; without, 2
    #[arg(long, value_name = "RAD/S", requires = "friction_run")]
    speed: Option<f32>,
    /// Folder for the friction run's trace.log, made if it is not there; without, out
    #[arg(long, value_name = "DIR", requires = "friction_run")]
    out: Option<PathBuf>,
    /// Ask nothing: move, take, confirm
    #[arg(long)]
    yes: bool,
}

impl Measure {
    /// Whether the motor is to be measured.
    pub(super) fn is_asked(&self) -> bool {
        self.measure
    }

    /// Where the trace of a friction run goes, where one is asked for.
    pub(super) fn friction_trace(&self) -> Result<Option<PathBuf>, String> {
        if !self.friction_run {
            return Ok(None);
        }
        trace_path(self.out.as_deref().unwrap_or(Path::new("out"))).map(Some)
    }

    /// What only a run takes, given without one.
    pub(super) fn check(&self) -> Result<(), String> {
        let given = self.current.is_some() || self.yes;
        if given && !self.measure && !self.friction_run {
            return Err("--current, --yes: go with --measure or --friction-run".into());
        }
        Ok(())
    }

    /// Asks what was not answered beforehand.
    pub(super) fn agreed(&self, question: &str) -> Result<bool, String> {
        if self.yes {
            return Ok(true);
        }
        if !std::io::stdin().is_terminal() {
            return Err(format!("{question} Nobody is there to answer: --yes says so beforehand"));
        }
        eprint!("{question} [y/N] ");
        let _ = std::io::stderr().flush();
        let mut answer = String::new();
        std::io::stdin().lock().read_line(&mut answer).map_err(|error| error.to_string())?;
        Ok(matches!(answer.trim(), "y" | "Y" | "yes"))
    }
}

/// What a step does, for whoever stands beside the joint.
fn doing(step: u32) -> &'static str {
    const WORDS: [&str; 11] = [
        "begins",
        "offsets of the current sensors",
        "resistance: half the current along a field that stands",
        "resistance: all of it",
        "inductance along the field",
        "inductance across it",
        "the field turns slowly: pole pairs, direction, electrical zero",
        "and back",
        "the field turns faster: flux",
        "and back",
        "the current goes down",
    ];
    WORDS.get(step as usize).copied().unwrap_or("ended")
}

impl Driver {
    /// The wiring in use, by name, and whether somebody confirmed it; confirms it where that is asked.
    pub(super) fn commission(&mut self, confirm: bool, json: bool) -> Result<(), String> {
        let set = self.read_set()?;
        let wiring = self.number(index::COMMISSIONING, Commissioning::WIRING_CRC)?;
        if wiring != set.wiring_crc() {
            let meant = set.wiring_crc();
            return Err(format!(
                "the driver's wiring has the crc {wiring:08x}, its numbers {meant:08x}: is it of another version?"
            ));
        }
        if confirm {
            self.confirm(wiring)?;
        }
        let commissioned = self.number(index::COMMISSIONING, 1)? != 0;
        let wired: Vec<(String, f32)> = numbers(&set)
            .into_iter()
            .filter(|(name, _)| {
                name.strip_prefix("motor.")
                    .is_some_and(|field| ParameterSet::WIRING.contains(&field))
            })
            .collect();
        if json {
            let wired: serde_json::Map<_, _> =
                wired.into_iter().map(|(name, value)| (name, json!(value))).collect();
            let result = json!({"commissioned": commissioned, "wiring_crc": format!("{wiring:08x}"), "wiring": wired});
            let text = serde_json::to_string_pretty(&result).map_err(|e| e.to_string())?;
            return say(&(text + "\n"));
        }
        let mut out = String::new();
        for (name, value) in wired {
            out += &format!("{name:<32} {value:?}\n");
        }
        out += if commissioned {
            "commissioned: the joint may be armed; `params save` keeps that over a reset\n"
        } else {
            "NOT commissioned: the joint does not arm. `params commission --measure` lets the driver find the numbers above by\n\
             itself, at low current; or find and set each (docs/bring-up.md), then `params commission --confirm`\n"
        };
        say(&out)
    }

    fn confirm(&mut self, wiring: u32) -> Result<(), String> {
        let at = Address::new(index::COMMISSIONING, Commissioning::CONFIRM);
        self.client.write(at, &wiring.to_le_bytes()).map_err(words)
    }

    /// Lets the driver measure its motor; shows what came of it, and takes it where that is agreed to.
    pub(super) fn measure_motor(
        &mut self,
        how: &Measure,
        name: &str,
        json: bool,
    ) -> Result<(), String> {
        let before = self.read_set()?;
        self.bound(how, how.travel)?;
        let current_a = self.float(CommissioningRun::CURRENT)?;
        let travel_rad = self.float(CommissioningRun::TRAVEL)?;
        let question = format!(
            "{name} will put {current_a} A on its motor and move the joint, {travel_rad} rad to either side at most, for half a \
             minute or less. Is it free to move, and a hand at the supply's switch?"
        );
        if !how.agreed(&question)? {
            return Err("nothing was done".into());
        }
        self.order(BEGIN)?;
        let step = self.watch_run(json);
        if step.is_err() {
            // The driver stops by itself where nobody says that it goes on; this is sooner.
            let _ = self.order(STOP);
        }
        if step? != Step::Done as u32 {
            return Err(self.why_ended()?);
        }
        let found = self.read_staged()?;
        let changes = differences(&before, &found);
        let told = self.found(&before, &found, json)?;
        say(&told)?;
        let taken = how.agreed("Take these, and confirm the wiring?")?;
        if !taken {
            self.discard()?;
            return say(&if json {
                String::new()
            } else {
                format!("{name}: nothing was changed\n")
            });
        }
        let active = self.commit(&found)?;
        self.confirm(found.wiring_crc())?;
        if json {
            return Ok(());
        }
        say(&format!(
            "{name}: {} values taken, the wiring confirmed (crc {active:08x}, until a reset: `params save` keeps it)\n",
            changes.len()
        ))
    }

    /// Tells the driver what bounds a run.
    pub(super) fn bound(&mut self, how: &Measure, travel: Option<f32>) -> Result<(), String> {
        use CommissioningRun as R;
        for (place, value) in
            [(R::CURRENT, how.current), (R::TRAVEL, travel), (R::SPEED, how.speed)]
        {
            if let Some(value) = value {
                let at = Address::new(index::COMMISSIONING_RUN, place);
                self.client.write(at, &value.to_le_bytes()).map_err(words)?;
            }
        }
        Ok(())
    }

    pub(super) fn order(&mut self, order: u8) -> Result<(), String> {
        let at = Address::new(index::COMMISSIONING_RUN, CommissioningRun::ORDER);
        self.client.write(at, &[order]).map_err(words)
    }

    pub(super) fn float(&mut self, place: u8) -> Result<f32, String> {
        self.number(index::COMMISSIONING_RUN, place).map(f32::from_bits)
    }

    /// Says that it goes on until it has ended; gives the step it ended in.
    fn watch_run(&mut self, json: bool) -> Result<u32, String> {
        let mut said = 0;
        loop {
            self.order(GO_ON)?;
            let step = self.number(index::COMMISSIONING_RUN, CommissioningRun::STEP)?;
            if step >= Step::Done as u32 {
                return Ok(step);
            }
            if step != said && !json {
                eprintln!("  {}", doing(step));
            }
            said = step;
            let bus = self.client.bus();
            let until_ns = bus.now_ns() + ALIVE.as_nanos() as u64;
            // What the joint says meanwhile is of no interest here.
            while bus.receive(until_ns).map_err(|error| error.to_string())?.is_some() {}
        }
    }

    pub(super) fn why_ended(&mut self) -> Result<String, String> {
        let number = self.number(index::COMMISSIONING_RUN, CommissioningRun::REASON)? as u8;
        let (name, meaning) = Reason::describe(number).unwrap_or(("unknown", "of another version"));
        let faults = super::status::codes(self.number(index::STATE, 3)?, 1);
        let faults =
            if faults.is_empty() { String::new() } else { format!(" ({})", faults.join(", ")) };
        Ok(format!("ended: {name}: {meaning}{faults}; the bridge is open, nothing was changed"))
    }

    /// What was found, in words and figures.
    fn found(
        &mut self,
        before: &ParameterSet,
        found: &ParameterSet,
        json: bool,
    ) -> Result<String, String> {
        use CommissioningRun as R;
        let offsets = [self.float(R::OFFSET_A)?, self.float(R::OFFSET_B)?];
        let lag_rad = self.float(R::LAG)?;
        let friction_nm = self.float(R::FRICTION_TORQUE)?;
        let (was, is) = (&before.motor, &found.motor);
        if json {
            let wiring: serde_json::Map<_, _> = numbers(found)
                .into_iter()
                .filter_map(|(name, value)| {
                    let field = name.strip_prefix("motor.")?;
                    ParameterSet::WIRING.contains(&field).then(|| (field.to_owned(), json!(value)))
                })
                .collect();
            let result = json!({
                "offset_a": offsets, "lag_rad": lag_rad, "friction_torque_nm": friction_nm, "wiring": wiring,
            });
            let text = serde_json::to_string_pretty(&result).map_err(|e| e.to_string())?;
            return Ok(text + "\n");
        }
        let direction = |sign: f32| if sign > 0.0 { "with" } else { "against" };
        let turned = is.encoder_direction != was.encoder_direction;
        let mut out = format!(
            "found:\n\
             current sensors' offsets   {:+.3} A and {:+.3} A, taken off\n\
             resistance of a phase      {:.4} ohm (was {:.4}): winding, cable and switch as warm as they are\n\
             inductance along, across   {:.1} uH and {:.1} uH (was {:.1} and {:.1})\n\
             pole pairs                 {} (was {})\n\
             encoder                    counts {} the order of phases a, b, c (was {}), {:+.4} rad where the magnet lies along a (was {:+.4})\n\
             torque constant            {:.5} Nm/A at the motor (was {:.5}), {:.3} Nm/A at the joint (was {:.3}): its gear loses what it did\n\
             friction, creeping         {:.2} Nm at the joint: the rotor is {:.0} degrees (electrical) behind the field\n",
            offsets[0],
            offsets[1],
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
        );
        if turned {
            out += "joint_direction is turned with the encoder's: positive position stays where the encoder counted up before.\n\
                    Where that is the wrong way round: `params set motor.joint_direction=";
            out += &format!("{}`\n", -is.joint_direction);
        }
        Ok(out)
    }
}
