//! The emulated board as the driver of a rig.
//!
//! [`BoardDriver`] executes the shipped image for each millisecond of the rig, and shows the rig its frames. States and faults are
//! read over the bus as a master reads them. A reset or a power cut starts another chip with the flash of the old one.

use crate::chip::clock::reset;
use crate::chip::fdcan::BusFailure;
use crate::chip::flash::StoreContent;
use crate::chip::wiring::{ESC1, STANDARD, Wiring};
use crate::chip::{CORE_HZ, Chip};
use crate::costs::{Costs, LOOP_EXCEPTION};
use crate::error::EmulatorError;
use crate::joint_world::JointWorld;
use crate::{Image, Machine, StopReason};
use compensator_core::can::{Frame, NodeId};
use embedded_storage::nor_flash::ReadNorFlash;
use firmware::background::BoardState;
use firmware::node::dictionary::index;
use firmware::panic_note::{PanicNote, Part};
use firmware::supervisor::{CanState, CodeSet, ResetCause};
use joint_rig::{
    PERIOD_CYCLES, PowerUp, RigDriver, RigError, RigFaults, Stage, codes_from_bits, stored_flash,
};
use joint_trace::CanFrame;
use simulated_machines::joint_plant::{JointPlant, Load, Parameters};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::sync::atomic::{AtomicU32, Ordering};

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

/// Returns the content of the parameter store of the driver's board with the set of this start.
///
/// # Errors
/// Returns one line if the set is rejected.
pub fn store_content(start: &PowerUp) -> Result<StoreContent, EmulatorError> {
    pages_of::<4>(start)
}

fn pages_of<const PAGES: usize>(start: &PowerUp) -> Result<StoreContent, EmulatorError> {
    let mut flash =
        stored_flash::<PAGES>(start, start.scales.traits).map_err(EmulatorError::Set)?;
    let mut bytes = vec![0; flash.capacity()];
    flash.read(0, &mut bytes).map_err(EmulatorError::Store)?;
    Ok(StoreContent { bytes, torn: Vec::new() })
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
            ResetCause::PowerOn | ResetCause::BrownOut | ResetCause::Unknown => {
                reset::POWER | reset::PIN
            }
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
        driver.await_boot_up()?;
        Ok(driver)
    }

    /// Runs the image until its boot-up frame.
    fn await_boot_up(&mut self) -> Result<(), EmulatorError> {
        for _ in 0..START_TIMEOUT_MS {
            self.run(MILLISECOND_CYCLES);
            if self.is_reset {
                return Err(EmulatorError::ResetAtStart);
            }
            if self.stage().applied_duty().is_some() {
                return Err(EmulatorError::ClosedBridgeAtStart);
            }
            if !self.frames.is_empty() {
                self.frames.clear();
                return Ok(());
            }
        }
        Err(EmulatorError::NoBootUp { within_ms: START_TIMEOUT_MS, at: self.machine.pc() })
    }

    /// Returns the machine, for measurements.
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
        match state.can {
            CanState::Active => {}
            CanState::Passive => chip.can.count_errors(BusFailure::Passive),
            CanState::Off => chip.can.count_errors(BusFailure::Off),
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
