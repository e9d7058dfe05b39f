//! `params commission --friction-run`: moves the joint through its range and writes a CAN trace of the motion.
//!
//! The driver controls and limits the motion. This tool sends a keep-alive every 20 ms and a SYNC every 2 ms; the driver
//! answers each SYNC with its measurements. [`identify`](crate::cli::identify) reads the trace. The driver's parameters
//! stay unchanged: the user fits a model, checks it, and sets it with `params set`.

use super::measure::{KEEP_ALIVE_PERIOD, MeasureArguments, ORDER_CONTINUE, ORDER_STOP};
use super::{Driver, Result, print_text};
use crate::cli::error::{Refusal, unfit};
use crate::cli::progress::spinner;
use canopen_rs::{Address, NmtCommand};
use compensator_core::can::{Message, SyncFrame};
use firmware::driver::commissioning::CommissioningStep;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::CommissioningRunObject;
use joint_bus::bus::Bus;
use joint_trace::CanFrame;
use serde_json::json;
use std::path::Path;
use std::time::Duration;

/// Order that starts a friction run.
const ORDER_FRICTION_RUN: u8 = 3;

/// Sample period of the trace. Presliding after a reversal takes about 20 ms, so it has about ten samples.
const SAMPLE_PERIOD: Duration = Duration::from_millis(2);

/// Wait before the run. The driver accepts a newly committed encoder direction after 0.15 s.
const SETTLING_TIME: Duration = Duration::from_millis(300);

/// Sub-index of a PDO's transmission type, and the type of a PDO that is sent at each SYNC.
const TRANSMISSION_TYPE: u8 = 2;
const EVERY_SYNC: u8 = 1;

impl Driver {
    /// Runs the friction run. The bus recorder writes `trace`.
    pub(super) fn friction_run(
        &mut self,
        how: &MeasureArguments,
        name: &str,
        trace: &Path,
        json: bool,
    ) -> Result {
        if self.number(index::COMMISSIONING, 1)? == 0 {
            return Err(unfit(
                format!("{name} is not commissioned"),
                "run `params commission --measure` first, or use --measure --friction-run together",
            ));
        }
        self.set_limits(how, how.range)?;
        let current_a = self.float(CommissioningRunObject::CURRENT)?;
        let travel_rad = self.float(CommissioningRunObject::TRAVEL)?;
        let speed_rad_s = self.float(CommissioningRunObject::SPEED)?;
        let question = format!(
            "{name} will move the joint by up to {travel_rad} rad to either side, at up to {speed_rad_s} rad/s and \
             {current_a} A, for about one minute. Keep the range clear and be ready to switch off the supply. Continue?"
        );
        if !how.is_confirmed(&question)? {
            return Err(Refusal::Declined.into());
        }
        // A torque at each tenth SYNC shows too few points of a reversal: the fit would find a tenth too much inertia.
        let torque_type = Address::new(index::TRANSMIT_TORQUE, TRANSMISSION_TYPE);
        let kept_type = self.number(torque_type.index, torque_type.subindex)? as u8;
        self.client.write(torque_type, &[EVERY_SYNC])?;
        self.client.command(NmtCommand::StartRemoteNode)?;
        self.client.bus().discard_within(SETTLING_TIME)?;
        let began_ns = self.client.bus().now_ns();
        let bar = spinner("friction run, about one minute".into());
        let step = self.order(ORDER_FRICTION_RUN).and_then(|()| self.follow_run(json));
        if step.is_err() {
            // Without keep-alive the driver stops after 0.1 s; the stop order acts sooner.
            let _ = self.order(ORDER_STOP);
        }
        bar.finish_and_clear();
        let seconds = (self.client.bus().now_ns() - began_ns) as f64 * 1e-9;
        let left = self.client.command(NmtCommand::EnterPreOperational);
        let restored = self.client.write(torque_type, &[kept_type]);
        if step? != CommissioningStep::Done as u32 {
            return Err(self.end_reason()?.into());
        }
        left?;
        restored?;
        let trace = trace.display();
        if json {
            let result = json!({"trace": trace.to_string(), "seconds": seconds});
            return print_text(&(result.to_string() + "\n"));
        }
        print_text(&format!(
            "{name}: moved for {seconds:.0} s; the measurements are in {trace}; no parameter was changed. To fit a model and write it to the driver:\n\
             \x20 host-sim identify {trace} --model lugre --rigid-body inertia,offset --out DIR\n\
             \x20 host-sim params set DIR/params.toml --bus BUS\n"
        ))
    }

    /// Sends SYNC and keep-alive frames until the run ends. Returns the step in which it ended.
    fn follow_run(&mut self, json: bool) -> Result<u32> {
        if !json {
            eprintln!("  the joint moves back and forth at decreasing speeds");
        }
        let [sample_ns, keep_alive_ns] =
            [SAMPLE_PERIOD, KEEP_ALIVE_PERIOD].map(|time| time.as_nanos() as u64);
        let order = Address::new(index::COMMISSIONING_RUN, CommissioningRunObject::ORDER);
        let mut due_ns = self.client.bus().now_ns();
        let (mut sent_ns, mut count) = (due_ns, 0);
        loop {
            count += 1;
            let bus = self.client.bus();
            let sync = CanFrame::from(Message::Sync(SyncFrame::of(count)).emit());
            bus.send(&sync)?;
            if due_ns >= sent_ns + keep_alive_ns {
                sent_ns = due_ns;
                self.client.write(order, &[ORDER_CONTINUE])?;
                let step = self.number(index::COMMISSIONING_RUN, CommissioningRunObject::STEP)?;
                if step != CommissioningStep::Rubbing as u32 {
                    return Ok(step);
                }
            }
            let bus = self.client.bus();
            // After a delay, missed samples are skipped.
            due_ns = (due_ns + sample_ns).max(bus.now_ns());
            while bus.receive(due_ns)?.is_some() {}
        }
    }
}
