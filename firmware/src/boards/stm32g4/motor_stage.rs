//! The motor hardware that the current loop uses: bridge, shunts and encoder.
//!
//! The library's `LoopTask` runs in the interrupt; this module provides its [`PowerStage`]. Counts are
//! converted to SI units with the offsets that were measured at the start.

use super::encoder::Encoder;
use super::power_stage::{Counts, Stage};
use super::{scales, watchdog};
use cortex_m::peripheral::DWT;
use embassy_stm32::gpio::Input;
use firmware::control::{BridgeFault, PowerStage, StageSample, ValidChannels};
use firmware::loop_link::LoopPort;
use firmware::loop_task::LoopTask;
use firmware::sensors::encoder::MotorEncoder;
use firmware::sensors::shunt::{OFFSET_SAMPLES, OffsetFinder, Shunt};

/// Periods until the amplifiers of the gate driver are awake, 5 ms.
const WAKE_PERIODS: u32 = 100;

/// Bridge, shunts and encoder.
pub struct MotorStage {
    pub stage: Stage,
    pub encoder: MotorEncoder,
    pub inputs: Encoder,
    /// Scaling of phases a and b; `None` if its offset was refused.
    pub shunts: [Option<Shunt>; 2],
    /// Input of the touch probe, if the board has one.
    pub touch: Option<Input<'static>>,
}

impl PowerStage for MotorStage {
    #[inline(always)]
    fn sample(&mut self) -> StageSample {
        let counts = self.stage.counts();
        let angle = self.encoder.angle(&mut self.inputs);
        sample(counts, &self.shunts, angle)
    }

    #[inline(always)]
    fn bridge_fault(&mut self) -> Option<BridgeFault> {
        self.stage.bridge_fault()
    }

    #[inline(always)]
    fn has_magnet_fault(&self) -> bool {
        self.encoder.has_warning()
    }

    #[inline(always)]
    fn is_touched(&self) -> bool {
        self.touch.as_ref().is_some_and(Input::is_high)
    }

    #[inline(always)]
    fn set_awake(&mut self, awake: bool) {
        self.stage.set_awake(awake);
    }

    #[inline(always)]
    fn drive(&mut self, duty: [f32; 3]) {
        self.stage.drive(duty);
    }

    #[inline(always)]
    fn brake(&mut self) {
        self.stage.brake();
    }

    #[inline(always)]
    fn off(&mut self) {
        self.stage.off();
    }

    #[inline(always)]
    fn cycles(&self) -> u32 {
        DWT::cycle_count()
    }
}

/// Converts the counts of one period to SI units.
#[inline(always)]
fn sample(counts: Counts, shunts: &[Option<Shunt>; 2], encoder: Option<u32>) -> StageSample {
    let [a, b] = shunts;
    let a = a.as_ref().and_then(|shunt| shunt.current_a(counts.phase_a));
    let b = b.as_ref().and_then(|shunt| shunt.current_a(counts.phase_b));
    let mut valid = ValidChannels::BUS;
    valid.set(ValidChannels::CURRENT_A, a.is_some());
    valid.set(ValidChannels::CURRENT_B, b.is_some());
    valid.set(ValidChannels::ENCODER, encoder.is_some());
    StageSample {
        currents_a: [a.unwrap_or(0.0), b.unwrap_or(0.0), 0.0],
        // Half a count is added, so that an unpowered bus reads as a low voltage and not as a missing one.
        bus_v: (f32::from(counts.bus) + 0.5) * scales::VOLTS_PER_COUNT,
        encoder: encoder.unwrap_or(0),
        valid,
    }
}

/// Runs one period of the current loop. The interrupt of the converters calls it.
#[inline(always)]
pub fn run_period(task: &mut LoopTask, stage: &mut MotorStage, port: &mut LoopPort<'static>) {
    let now = DWT::cycle_count();
    let triggered = now.wrapping_sub(stage.stage.since_trigger());
    if !stage.stage.is_due() {
        return;
    }
    watchdog::count_period();
    task.interrupt(stage, port, triggered, now);
}

/// Measures the offsets of the amplifiers. The bridge is off, so no current flows.
pub fn measure_offsets(stage: &mut Stage) -> [Option<Shunt>; 2] {
    let mut finders = [OffsetFinder::default(); 2];
    for _ in 0..WAKE_PERIODS {
        stage.wait();
    }
    for _ in 0..OFFSET_SAMPLES {
        let counts = stage.wait();
        for (finder, counts) in finders.iter_mut().zip([counts.phase_a, counts.phase_b]) {
            finder.add_sample(counts);
        }
    }
    // Clears the fault that a gate driver reports while it wakes.
    stage.off();
    finders.map(|finder| finder.shunt(scales::OFFSETS, scales::AMPERES_PER_COUNT))
}
