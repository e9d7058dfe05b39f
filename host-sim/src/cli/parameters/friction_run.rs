//! `params commission --friction-run`: the joint moves by itself through its range, and a trace of it is written.
//!
//! The driver moves and bounds; this tool says every 20 ms that it goes on, and asks with a SYNC every 2 ms what the joint
//! measures, which is what [`identify`](crate::cli::identify) reads. Nothing of the driver's parameters is changed here: a model
//! counts when somebody has looked at it and set it.

use super::commission::{ALIVE, GO_ON, Measure, STOP};
use super::{Driver, words};
use crate::cli::output::say;
use canopen_rs::{Address, NmtCommand};
use compensator_core::can::{Message, Sync};
use firmware::driver::commissioning::Step;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::CommissioningRun;
use joint_trace::CanFrame;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Order of a friction run.
const RUB: u8 = 3;

/// Time between two samples of the trace: a reversal's presliding takes some 20 ms.
const SAMPLE: Duration = Duration::from_millis(2);

/// An encoder whose direction was just committed is believed after 0.15 s.
const SETTLE: Duration = Duration::from_millis(300);

/// Name of the trace in its folder.
const TRACE: &str = "trace.log";

/// Where the trace of a run goes; makes the folder.
pub(super) fn trace_path(out: &Path) -> Result<PathBuf, String> {
    std::fs::create_dir_all(out).map_err(|error| format!("{}: {error}", out.display()))?;
    Ok(out.join(TRACE))
}

impl Driver {
    /// Lets the joint move; the bus writes the trace, to this file.
    pub(super) fn friction_run(
        &mut self,
        how: &Measure,
        name: &str,
        trace: &Path,
        json: bool,
    ) -> Result<(), String> {
        if self.number(index::COMMISSIONING, 1)? == 0 {
            return Err(format!(
                "{name} is not commissioned: `params commission --measure` first, or both in one, --measure --friction-run"
            ));
        }
        self.bound(how, how.range)?;
        let [current_a, travel_rad, speed_rad_s] =
            [CommissioningRun::CURRENT, CommissioningRun::TRAVEL, CommissioningRun::SPEED]
                .map(|place| self.float(place));
        let (current_a, travel_rad, speed_rad_s) = (current_a?, travel_rad?, speed_rad_s?);
        let question = format!(
            "{name} will move the joint by itself, {travel_rad} rad to either side at most, at up to {speed_rad_s} rad/s and \
             {current_a} A, for about a minute. Is its range free, and a hand at the supply's switch?"
        );
        if !how.agreed(&question)? {
            return Err("nothing was done".into());
        }
        let start = self.client.command(NmtCommand::StartRemoteNode);
        start.map_err(|error| error.to_string())?;
        let bus = self.client.bus();
        let began_ns = bus.now_ns() + SETTLE.as_nanos() as u64;
        while bus.receive(began_ns).map_err(|error| error.to_string())?.is_some() {}
        let step = self.order(RUB).and_then(|()| self.follow_run(json));
        if step.is_err() {
            // The driver stops by itself where nobody says that it goes on; this is sooner.
            let _ = self.order(STOP);
        }
        let seconds = (self.client.bus().now_ns() - began_ns) as f64 * 1e-9;
        let left = self.client.command(NmtCommand::EnterPreOperational);
        if step? != Step::Done as u32 {
            return Err(self.why_ended()?);
        }
        left.map_err(|error| error.to_string())?;
        let trace = trace.display();
        if json {
            let result = json!({"trace": trace.to_string(), "seconds": seconds});
            return say(&(result.to_string() + "\n"));
        }
        say(&format!(
            "{name}: moved for {seconds:.0} s, {trace} holds what it measured; nothing was changed. What friction that is, and into the joint:\n\
             \x20 host-sim identify {trace} --model lugre --rigid-body inertia,offset --out DIR\n\
             \x20 host-sim params set DIR/params.toml --bus BUS\n"
        ))
    }

    /// SYNCs and signs of life until it has ended; gives the step it ended in.
    fn follow_run(&mut self, json: bool) -> Result<u32, String> {
        if !json {
            eprintln!("  the joint moves to and fro, from its fastest down");
        }
        let [sample_ns, alive_ns] = [SAMPLE, ALIVE].map(|time| time.as_nanos() as u64);
        let order = Address::new(index::COMMISSIONING_RUN, CommissioningRun::ORDER);
        let mut due_ns = self.client.bus().now_ns();
        let (mut said_ns, mut count) = (due_ns, 0);
        loop {
            count += 1;
            let bus = self.client.bus();
            let sync = CanFrame::from(Message::Sync(Sync::of(count)).emit());
            bus.send(&sync).map_err(|error| error.to_string())?;
            if due_ns >= said_ns + alive_ns {
                said_ns = due_ns;
                self.client.write(order, &[GO_ON]).map_err(words)?;
                let step = self.number(index::COMMISSIONING_RUN, CommissioningRun::STEP)?;
                if step != Step::Rubbing as u32 {
                    return Ok(step);
                }
            }
            let bus = self.client.bus();
            // A wait that was too long is not made up for.
            due_ns = (due_ns + sample_ns).max(bus.now_ns());
            while bus.receive(due_ns).map_err(|error| error.to_string())?.is_some() {}
        }
    }
}
