//! The emulated board as the driver of a rig.

use crate::chip::bme280::HousingAir;
use crate::chip::clock::reset;
use crate::chip::comparators::BreakLevels;
use crate::chip::flash::StoreContent;
use crate::chip::ms5837::Water;
use crate::chip::timer20::Edges;
use crate::chip::wiring::{ESC1, Quantity, STANDARD, Wiring};
use crate::chip::{CORE_HZ, Chip};
use crate::costs::{Costs, LOOP_EXCEPTION};
use crate::error::EmulatorError;
use crate::world::{Bridge, World};
use crate::{Image, Machine, StopReason};
use compensator_core::can::{Frame, NodeId};
use embedded_storage::nor_flash::ReadNorFlash;
use firmware::background::BoardState;
use firmware::node::dictionary::index;
use firmware::panic_note::{PanicNote, Part};
use firmware::sensors::thermistor::Thermistor;
use firmware::supervisor::{CodeSet, ResetCause};
use joint_rig::{
    InterruptTiming, PERIOD_CYCLES, PowerUp, RigDriver, RigError, RigFaults, Stage,
    codes_from_bits, stored_flash,
};
use joint_trace::CanFrame;
use simulated_machines::joint_plant::{JointPlant, Load, Measured, Parameters};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::sync::atomic::{AtomicU32, Ordering};

/// Longest block of instructions between two looks at the events of the chip, cycles. A missed interrupt is held for as much
/// longer, so that the trigger of the next period can hold it too.
const BLOCK_CYCLES: u32 = 400;

const NODE: NodeId = NodeId::FIRST;
const MILLISECOND_CYCLES: u64 = CORE_HZ / 1000;
/// Sub-indices of the state object: state, faults, limits.
const STATE_ENTRY: u8 = 2;
const FAULTS_ENTRY: u8 = 3;
const LIMITS_ENTRY: u8 = 4;
const ARMED: u32 = 1;
/// Longest start of the image until its boot-up frame, ms.
const START_TIMEOUT_MS: usize = 200;
/// Symbol of the heat that a reset leaves (firmware/src/heat_memory.rs).
pub const HEAT_MEMORY: &str = "heat_memory4KEPT";
/// Counts of a full turn of the encoder.
const ENCODER_COUNTS: f64 = 16384.0;

/// Material constant B of all thermistors, K.
const THERMISTOR_BETA_K: f32 = 3435.0;
/// Pressure inside the joint, Pa (see the board's scales.rs).
const INSIDE_PA: f64 = 101_325.0;
/// Range of the strain gauge amplifier, N, around half of the converter's range.
const FORCE_RANGE_N: f64 = 2000.0;

/// The joint around the chip.
pub struct JointWorld {
    stage: Stage,
    sampled: Measured,
    sampled_turns: f64,
    /// Position of the joint's side at the last sample, rad.
    sampled_rad: f64,
    is_low_side_on: [bool; 2],
    state: BoardState,
    /// Counts of the thermistors of bridge and motor, and the temperatures that they stand for, deg C.
    thermistors: [(Option<f32>, u16); 2],
    has_pressure_sensor: bool,
    wiring: &'static Wiring,
}

impl JointWorld {
    fn new(mut stage: Stage, wiring: &'static Wiring) -> Self {
        if let Some(board) = &mut stage.board {
            board.set_scales(wiring.currents, wiring.volts_per_count);
        }
        let sampled = stage.plant.measure();
        Self {
            sampled_turns: stage.plant.motor_turns(),
            sampled_rad: stage.plant.position_rad(),
            stage,
            sampled,
            is_low_side_on: [true; 2],
            state: BoardState::default(),
            thermistors: [(None, 0); 2],
            has_pressure_sensor: false,
            wiring,
        }
    }

    /// Angle of the motor's shaft, turns, `seconds` after the last sample.
    fn shaft_turns(&self, seconds: f64) -> f64 {
        self.sampled_turns + self.stage.plant.motor_turns_in(seconds)
    }

    fn thermistor(&mut self, place: usize, temperature_c: Option<f32>) -> u16 {
        let (known, counts) = &mut self.thermistors[place];
        if *known != temperature_c || *counts == 0 {
            (*known, *counts) = (temperature_c, thermistor_counts(self.wiring, temperature_c));
        }
        *counts
    }
}

impl World for JointWorld {
    fn wiring(&self) -> &'static Wiring {
        self.wiring
    }

    fn advance(&mut self, seconds: f64, bridge: Bridge) {
        let duty = match bridge {
            Bridge::Driven(duty) if !self.stage.gate_fault => Some(duty),
            _ => None,
        };
        self.stage.run_driven(seconds, duty);
    }

    fn set_brake_output(&mut self, is_high: bool) {
        self.stage.plant.energise_brake(is_high);
    }

    fn sample(&mut self, is_low_side_on: [bool; 2]) {
        self.sampled = self.stage.plant.measure();
        self.sampled_turns = self.stage.plant.motor_turns();
        self.sampled_rad = self.stage.plant.position_rad();
        if self.stage.phases_swapped {
            self.sampled.currents_a.swap(1, 2);
        }
        self.is_low_side_on = is_low_side_on;
    }

    fn analog(&mut self, converter: usize, channel: u32) -> u16 {
        let Some(board) = &self.stage.board else { return 0 };
        let phases = board.phase_counts(self.sampled.currents_a, self.is_low_side_on);
        match self.wiring.quantity(converter, channel) {
            Some(Quantity::Phase(phase)) => phases[phase],
            Some(Quantity::Bus) => board.bus_counts(self.sampled.bus_v),
            Some(Quantity::Leak) => counts(self.state.enclosure.leak_share.unwrap_or(1.0).into()),
            Some(Quantity::Thermistor(place)) => {
                let state = &self.state;
                let shown = [state.bridge_temperature_c, state.motor_temperature_c];
                self.thermistor(place, shown[place])
            }
            Some(Quantity::Force) => {
                counts(0.5 + self.stage.plant.show().radial_force_n / FORCE_RANGE_N)
            }
            None => 0,
        }
    }

    fn shunts(&mut self) -> [u16; 3] {
        let Some(board) = &self.stage.board else { return [0; 3] };
        let inputs = &self.wiring.overcurrent;
        if let Some(chain) = inputs.chain {
            // The low side of phase c conducts, as at the top of the PWM.
            let is_on = [self.is_low_side_on[0], self.is_low_side_on[1], true];
            let currents_a = self.sampled.currents_a;
            return std::array::from_fn(|phase| {
                chain.counts(if is_on[phase] { currents_a[phase] } else { 0.0 })
            });
        }
        let phases = board.phase_counts(self.sampled.currents_a, self.is_low_side_on);
        let [first, second] = inputs.phases.map(|phase| phases[phase]);
        [first, second, first.midpoint(second)]
    }

    fn encoder(&mut self, word: u16, seconds: f64) -> u16 {
        let advance = self.stage.plant.motor_turns_in(seconds) * ENCODER_COUNTS;
        let angle = (f64::from(self.sampled.encoder) + advance).round() as i32 as u16;
        self.stage.board.as_ref().map_or(0xFFFF, |board| board.exchange_encoder_word(word, angle))
    }

    fn edges(&mut self, seconds: f64) -> Edges {
        let turns = self.shaft_turns(seconds);
        let Some(board) = &self.stage.board else { return Edges::default() };
        let (count, index) = board.edges(turns);
        Edges { count, index, has_double_edge: false }
    }

    fn biss_frame(&mut self, seconds: f64) -> Option<u64> {
        let turns = self.shaft_turns(seconds);
        self.stage.board.as_ref().and_then(|board| board.serial_frame(turns))
    }

    fn joint_frame(&mut self, seconds: f64) -> Option<u64> {
        let position_rad = self.sampled_rad + self.stage.plant.velocity_rad_s() * seconds;
        self.stage.board.as_ref().and_then(|board| board.output_frame(position_rad))
    }

    fn hall_levels(&mut self, seconds: f64) -> Option<u8> {
        let turns = self.shaft_turns(seconds);
        self.stage.board.as_ref().map(|board| board.hall_levels(turns))
    }

    fn water(&self) -> Option<Water> {
        let plant = &self.stage.plant;
        self.has_pressure_sensor.then(|| Water {
            pressure_pa: plant.around.pressure_diff_pa + INSIDE_PA,
            temperature_c: plant.seal.shown_temperature_c(),
        })
    }

    fn air(&self) -> Option<HousingAir> {
        let air = self.state.enclosure.air?;
        Some(HousingAir {
            pressure_pa: air.pressure_pa.into(),
            temperature_c: air.temperature_c.into(),
            humidity_percent: air.humidity_percent.into(),
        })
    }

    fn torque_allowed(&self) -> [bool; 2] {
        self.state.enclosure.torque_allowed.unwrap_or([true; 2])
    }

    fn is_touched(&self) -> bool {
        self.stage.has_touched()
    }

    fn has_gate_fault(&self) -> bool {
        self.stage.gate_fault
    }

    fn set_break_levels(&mut self, levels: BreakLevels) {
        let inputs = &self.wiring.overcurrent;
        let chain = inputs.chain.unwrap_or(self.wiring.currents);
        let levels_a = std::array::from_fn(|signal| {
            // A positive current lowers the counts. The mean of two phases shows half of their sum.
            let scale = if signal == 2 && inputs.has_mean { 2.0 } else { 1.0 };
            let at = inputs.phases.get(signal).copied().unwrap_or(signal);
            let [below, above] = levels[at].map(|level| level.map(|level| chain.current_a(level)));
            [
                above.map_or(f64::NEG_INFINITY, |level_a| scale * level_a),
                below.map_or(f64::INFINITY, |level_a| scale * level_a),
            ]
        });
        self.stage.plant.set_break_levels(levels_a);
    }

    fn is_overcurrent(&self) -> bool {
        self.stage.plant.is_tripped
    }

    fn clear_break(&mut self) {
        self.stage.plant.is_tripped = false;
    }

    fn interrupt_delay(&mut self) -> u32 {
        match self.stage.interrupts.pop_front().unwrap_or_default() {
            InterruptTiming::OnTime => 0,
            InterruptTiming::Late(cycles) => cycles,
            InterruptTiming::Missed => PERIOD_CYCLES + BLOCK_CYCLES,
        }
    }
}

/// Returns the content of the parameter store of the driver's board with the set of this start.
///
/// # Errors
/// Returns one line if the set is rejected.
pub fn store_content(start: &PowerUp) -> Result<StoreContent, EmulatorError> {
    pages_of::<4>(start)
}

fn pages_of<const PAGES: usize>(start: &PowerUp) -> Result<StoreContent, EmulatorError> {
    let mut flash = stored_flash::<PAGES>(start, start.scales.traits)
        .map_err(|refused| EmulatorError::Set(refused.to_string()))?;
    let mut bytes = vec![0; flash.capacity()];
    flash.read(0, &mut bytes).map_err(EmulatorError::Store)?;
    Ok(StoreContent { bytes, torn: Vec::new() })
}

/// Returns the converter's counts for a share of its range.
fn counts(share: f64) -> u16 {
    (share * 4096.0).round().clamp(0.0, 4095.0) as u16
}

/// Returns the converter's counts for a temperature, deg C; 25 if it is not given.
fn thermistor_counts(wiring: &Wiring, temperature_c: Option<f32>) -> u16 {
    let wanted = temperature_c.unwrap_or(25.0);
    let thermistor =
        Thermistor { ratio_at_25: wiring.thermistor_ratio_at_25, beta_k: THERMISTOR_BETA_K };
    let is_colder = |counts: u16| thermistor.temperature_c(f32::from(counts) / 4096.0) < wanted;
    // The temperature changes in one direction with the counts.
    let (mut low, mut high) = (1u16, 4094u16);
    let falls = thermistor.temperature_c(0.9) < thermistor.temperature_c(0.1);
    while low < high {
        let middle = low.midpoint(high);
        if is_colder(middle) == falls { high = middle } else { low = middle + 1 }
    }
    if wiring.is_thermistor_above { 4096 - low } else { low }
}

/// Largest use of the stack by any driver of this process, bytes.
static LARGEST_STACK_BYTES: AtomicU32 = AtomicU32::new(0);

/// Returns the largest use of the stack by the drivers that this process has ended, bytes.
pub fn largest_stack_bytes() -> u32 {
    LARGEST_STACK_BYTES.load(Ordering::Relaxed)
}

impl Drop for BoardDriver {
    fn drop(&mut self) {
        if let Some(costs) = &self.costs {
            costs.borrow_mut().blocks = self.machine.worst_blocks();
        }
        LARGEST_STACK_BYTES.fetch_max(self.machine.stack_used(), Ordering::Relaxed);
    }
}

/// The shipped image on the emulated board, as driver of a rig.
pub struct BoardDriver {
    machine: Machine<JointWorld>,
    is_reset: bool,
    /// Flags of the last reset.
    reset_flags: u32,
    /// It did not answer the last request of its state.
    is_silent: bool,
    /// Time by which the machine is ahead of the rig, cycles: reading the state takes some.
    ahead: u64,
    frames: VecDeque<Frame>,
    last_state: [u32; 3],
    costs: Option<Rc<RefCell<Costs>>>,
}

impl BoardDriver {
    /// Starts the image on this stage, whose sensors must be those of the board, until its boot-up frame.
    ///
    /// # Errors
    /// Returns one line if the image does not start or the parameter set is rejected.
    pub fn start(image: &Image, start: &PowerUp, stage: Stage) -> Result<Self, EmulatorError> {
        Self::start_with_store(image, start, &store_content(start)?, stage)
    }

    /// Starts the image as [`BoardDriver::start`], with this content of the parameter store.
    ///
    /// # Errors
    /// Returns one line if the image does not start.
    pub fn start_with_store(
        image: &Image,
        start: &PowerUp,
        store: &StoreContent,
        stage: Stage,
    ) -> Result<Self, EmulatorError> {
        Self::start_wired(image, start, store, stage, &STANDARD)
    }

    /// Starts the image of the compact node on its board, the B-G431B-ESC1, as [`BoardDriver::start`].
    ///
    /// # Errors
    /// Returns one line if the image does not start or the parameter set is rejected.
    pub fn start_compact(
        image: &Image,
        start: &PowerUp,
        stage: Stage,
    ) -> Result<Self, EmulatorError> {
        Self::start_wired(image, start, &pages_of::<2>(start)?, stage, &ESC1)
    }

    /// Starts the image of a board with this wiring, as [`BoardDriver::start_with_store`].
    ///
    /// # Errors
    /// Returns one line if the image does not start.
    pub fn start_wired(
        image: &Image,
        start: &PowerUp,
        store: &StoreContent,
        stage: Stage,
        wiring: &'static Wiring,
    ) -> Result<Self, EmulatorError> {
        if stage.board.is_none() {
            return Err(EmulatorError::NoSensors);
        }
        let mut chip = Chip::new(JointWorld::new(stage, wiring));
        chip.flash.set_store(store);
        chip.clock.set_reset_flags(match start.boot.cause {
            ResetCause::Watchdog => reset::WATCHDOG | reset::PIN,
            ResetCause::Software => reset::SOFTWARE | reset::PIN,
            ResetCause::Pin => reset::PIN,
            _ => reset::POWER | reset::PIN,
        });
        let mut machine = Machine::new(image, chip)?;
        if let Some(rise_k) = start.boot.winding_rise_k {
            let kept = image.find(HEAT_MEMORY).ok_or(EmulatorError::NoHeatMemory)?.address;
            machine.write_memory(kept, &kept_heat(rise_k));
        }
        if let Some(text) = start.boot.panic {
            write_panic_note(image, &mut machine, text)?;
        }
        let mut driver = Self {
            machine,
            is_reset: false,
            reset_flags: reset::PIN,
            is_silent: false,
            ahead: 0,
            frames: VecDeque::new(),
            last_state: [0; 3],
            costs: None,
        };
        for _ in 0..START_TIMEOUT_MS {
            driver.run(MILLISECOND_CYCLES);
            if driver.is_reset {
                return Err(EmulatorError::ResetAtStart);
            }
            if driver.stage().applied_duty().is_some() {
                return Err(EmulatorError::ClosedBridgeAtStart);
            }
            if !driver.frames.is_empty() {
                driver.frames.clear();
                return Ok(driver);
            }
        }
        Err(EmulatorError::NoBootUp { within_ms: START_TIMEOUT_MS, at: driver.machine.pc() })
    }

    /// The machine, for measurements.
    pub fn machine_mut(&mut self) -> &mut Machine<JointWorld> {
        &mut self.machine
    }

    /// Connects the pressure sensor, which is absent at the start.
    pub fn connect_pressure_sensor(&mut self) {
        self.machine.chip_mut().world.has_pressure_sensor = true;
    }

    /// Records what a power cut leaves of the parameter store, from now on.
    pub fn record_cuts(&mut self) -> Rc<RefCell<Vec<StoreContent>>> {
        self.machine.chip_mut().flash.record_cuts()
    }

    /// Records the costs from now on.
    pub fn record_costs(&mut self) -> Rc<RefCell<Costs>> {
        self.machine.records_runs = true;
        self.machine.take_runs();
        self.machine.take_thread_cost();
        self.machine.profile(Some(LOOP_EXCEPTION));
        Rc::clone(self.costs.insert(Rc::default()))
    }

    fn run(&mut self, cycles: u64) {
        match self.machine.run(cycles) {
            StopReason::Time => {}
            StopReason::Reset if self.machine.chip().is_watchdog_reset() => {
                self.end_run(reset::WATCHDOG | reset::PIN);
            }
            StopReason::Reset => self.end_run(reset::SOFTWARE | reset::PIN),
            // The watchdog or the lockup's own break follow; the rig shows an open bridge.
            StopReason::Lockup(_) => self.end_run(reset::WATCHDOG | reset::PIN),
        }
        let sent = &mut self.machine.chip_mut().can.sent;
        self.frames.extend(sent.drain(..).map(|(_, frame)| frame));
    }

    fn end_run(&mut self, reset_flags: u32) {
        (self.is_reset, self.reset_flags) = (true, reset_flags);
    }

    /// Reads an entry of the state object over the bus; the last value if there is no answer.
    fn read_state(&mut self, entry: u8) -> u32 {
        const SLICE_CYCLES: u64 = MILLISECOND_CYCLES / 50;
        let place = usize::from(entry - STATE_ENTRY);
        if self.is_reset {
            return self.last_state[place];
        }
        let [low, high] = index::STATE.to_le_bytes();
        let number = u16::from(NODE.number());
        let request = Frame::new(0x600 + number, &[0x40, low, high, entry, 0, 0, 0, 0]);
        let before = self.frames.len();
        if let Some(request) = request {
            self.receive(&request);
        }
        // A node that is stopped or bus off does not answer. Each wait for it would run the image ahead of the joint.
        let slices = if self.is_silent { 1 } else { 100 };
        let mut is_answered = false;
        for _ in 0..slices {
            self.run(SLICE_CYCLES);
            self.ahead += SLICE_CYCLES;
            let answer = self.frames.iter().skip(before).position(|frame| {
                frame.identifier() == 0x580 + number && frame.data()[1..4] == [low, high, entry]
            });
            if let Some(frame) = answer.and_then(|at| self.frames.remove(before + at)) {
                let [.., a, b, c, d] = *frame.data() else { break };
                let unused = 8 * u32::from(frame.data()[0] >> 2 & 3);
                self.last_state[place] = u32::from_le_bytes([a, b, c, d]) & u32::MAX >> unused;
                is_answered = true;
                break;
            }
            if self.is_reset {
                break;
            }
        }
        self.is_silent = !is_answered;
        self.last_state[place]
    }
}

/// Returns the memory with this rise of the winding above the stator, K.
pub fn kept_heat(rise_k: f32) -> [u8; 8] {
    let word = rise_k.to_bits();
    let words = u64::from(word) | u64::from(word ^ u32::from_le_bytes(*b"HEAT")) << 32;
    words.to_le_bytes()
}

fn write_panic_note(
    image: &Image,
    machine: &mut Machine<JointWorld>,
    text: &str,
) -> Result<(), EmulatorError> {
    let kept = image.find("panic4KEPT").ok_or(EmulatorError::NoPanicNote)?.address;
    let mut note = PanicNote::default();
    note.write(&[Part::Text(text)]);
    machine.write_memory(kept, &note.to_bytes());
    Ok(())
}

impl RigDriver for BoardDriver {
    fn stage(&self) -> &Stage {
        &self.machine.chip().world.stage
    }

    fn stage_mut(&mut self) -> &mut Stage {
        &mut self.machine.chip_mut().world.stage
    }

    fn receive(&mut self, frame: &Frame) {
        self.machine.chip_mut().deliver(*frame);
    }

    fn step(&mut self, state: &BoardState, sync: Option<Frame>, sent: &mut dyn FnMut(CanFrame)) {
        let chip = self.machine.chip_mut();
        chip.world.state = *state;
        let can = state.can;
        use firmware::supervisor::CanState;
        if can != CanState::Active {
            chip.can.count_errors(can == CanState::Off);
        }
        if let Some(sync) = sync {
            self.receive(&sync);
        }
        let cycles = MILLISECOND_CYCLES.saturating_sub(self.ahead);
        self.ahead -= MILLISECOND_CYCLES - cycles;
        if !self.is_reset {
            self.run(cycles);
        }
        if let Some(costs) = &self.costs {
            costs.borrow_mut().add(&mut self.machine, u64::from(PERIOD_CYCLES));
        }
        if self.is_reset {
            self.stage_mut().run_driven(cycles as f64 / CORE_HZ as f64, None);
        }
        // A late answer ends the silence.
        let answer = 0x580 + u16::from(NODE.number());
        self.is_silent &= self.frames.iter().all(|frame| frame.identifier() != answer);
        self.frames.drain(..).map(CanFrame::from).for_each(sent);
    }

    fn stall_background(&mut self, milliseconds: u32) {
        self.machine.stall_thread(u64::from(milliseconds) * MILLISECOND_CYCLES);
    }

    fn is_reset(&self) -> bool {
        self.is_reset
    }

    fn reset(&mut self) {
        self.machine.chip_mut().request_reset();
        self.end_run(reset::PIN);
    }

    fn cut_power(&mut self) {
        self.machine.chip_mut().request_reset();
        self.end_run(reset::POWER | reset::PIN);
    }

    fn restart(&mut self) -> Result<(), RigError> {
        let old = self.machine.chip_mut();
        // The joint goes on with the new chip, so that the old one needs another.
        let unused = JointPlant::new(&Parameters::default(), Load::Free, 0);
        let unused = JointWorld::new(Stage::new(unused, &RigFaults::default()), &STANDARD);
        let mut chip = Chip::new(std::mem::replace(&mut old.world, unused));
        chip.clock.set_reset_flags(self.reset_flags);
        let has_memory = self.reset_flags & reset::POWER == 0;
        let restarted = self.machine.restarted(chip, has_memory);
        self.machine = restarted.map_err(|why| RigError::Restart(why.into()))?;
        self.frames.clear();
        (self.is_reset, self.is_silent, self.ahead) = (false, false, 0);
        self.run(MILLISECOND_CYCLES);
        Ok(())
    }

    fn is_armed(&mut self) -> bool {
        let is_armed = self.read_state(STATE_ENTRY) == ARMED && !self.is_reset;
        // What a silent node does is seen at its bridge.
        is_armed && (!self.is_silent || self.machine.chip().timer1.is_main_output_enabled())
    }

    fn faults(&mut self) -> CodeSet {
        codes_from_bits(self.read_state(FAULTS_ENTRY), 1)
    }

    fn limits(&mut self) -> CodeSet {
        codes_from_bits(self.read_state(LIMITS_ENTRY), 33)
    }
}
