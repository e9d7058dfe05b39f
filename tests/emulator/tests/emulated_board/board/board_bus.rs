//! The emulated board with its boot program on a bus in emulated time, which restarts it after a reset.

use super::start::Constant;
use crate::common::{boot_program, image};
use canopen_rs::Address;
use compensator_core::can::{Frame, NodeId};
use emulated_board::chip::clock::reset;
use emulated_board::chip::flash::{Content, Flash};
use emulated_board::chip::wiring::STM32G474;
use emulated_board::chip::{CORE_HZ, Chip};
use emulated_board::{Machine, StopReason};
use firmware::node::dictionary::index;
use joint_bus::bus::{Bus, BusError, Counters, Received};
use joint_bus::canopen::Client;
use joint_trace::CanFrame;

pub const NODE: NodeId = NodeId::FIRST;
const MICROSECOND: u64 = CORE_HZ / 1_000_000;
pub const MILLISECOND: u64 = CORE_HZ / 1000;
/// Time of a frame of eight bytes at 1 Mbit/s, with stuffing.
const FRAME_US: u64 = 130;
/// Most quarters of a frame for which a sender waits until its last frame is on the bus.
const LONGEST_WAIT_FRAMES: u32 = 100;
/// Longest start of an image, with the check of its signature, ms.
const START_MS: usize = 3000;

/// Returns a flash as a debugger leaves it: boot program and image A.
pub fn new_board() -> Content {
    let mut content = blank_board();
    image().load(&mut content);
    content
}

/// Returns a flash with the boot program only.
pub fn blank_board() -> Content {
    let mut content = Content::default();
    boot_program().load(&mut content);
    content
}

/// A disturbance: it receives the number of the frame that is sent, and may change it or add others.
pub type Disturbance = Box<dyn FnMut(u32, &mut Vec<Frame>)>;

/// The board on its bus.
pub struct BoardBus {
    machine: Machine<Constant>,
    /// Time before the last restart, cycles.
    before: u64,
    /// Number of resets by the board.
    pub resets: u32,
    frames: u32,
    /// Acts on the frames to the board.
    pub disturbance: Option<Disturbance>,
    /// Time at which the power is cut, cycles. Then the bus is silent.
    pub cut_at: Option<u64>,
}

fn machine(content: Flash, flags: u32) -> Machine<Constant> {
    let mut chip = Chip::new(Constant::default());
    chip.flash = content;
    chip.clock.set_reset_flags(flags);
    Machine::power_up(chip).expect("a machine")
}

impl BoardBus {
    pub fn power_up(content: Content) -> Self {
        let flash = Flash::of(&STM32G474).with(content);
        Self::of_machine(machine(flash, reset::POWER | reset::PIN))
    }

    fn of_machine(machine: Machine<Constant>) -> Self {
        Self { machine, before: 0, resets: 0, frames: 0, disturbance: None, cut_at: None }
    }

    pub fn machine(&mut self) -> &mut Machine<Constant> {
        &mut self.machine
    }

    pub fn flash(&mut self) -> &mut Flash {
        &mut self.machine.chip_mut().flash
    }

    pub fn now(&self) -> u64 {
        self.before + self.machine.now()
    }

    pub fn has_power(&self) -> bool {
        self.cut_at.is_none_or(|at| self.now() < at)
    }

    pub fn run(&mut self, cycles: u64) {
        if !self.has_power() {
            self.before += cycles;
            return;
        }
        match self.machine.run(cycles) {
            StopReason::Time => {}
            StopReason::Reset => self.restart(),
            StopReason::Lockup(why) => {
                let fault = &self.machine.chip().last_fault;
                panic!("lockup at {:#x}: {why}, after {fault:?}", self.machine.pc())
            }
        }
    }

    fn restart(&mut self) {
        self.before += self.machine.now();
        self.resets += 1;
        let is_watchdog = self.machine.chip().is_watchdog_reset();
        let cause = if is_watchdog { reset::WATCHDOG } else { reset::SOFTWARE };
        self.start_again(cause | reset::PIN, true);
    }

    /// Cuts the power and restores it: the flash keeps its content, and RAM has any.
    pub fn cut_power(&mut self) {
        self.before += self.machine.now();
        self.start_again(reset::POWER | reset::PIN, false);
    }

    fn start_again(&mut self, flags: u32, has_memory: bool) {
        let mut chip = Chip::new(Constant::default());
        chip.clock.set_reset_flags(flags);
        self.machine = self.machine.restarted(chip, has_memory).expect("a machine");
    }

    /// Runs until the node sends its boot-up frame.
    pub fn await_boot_up(&mut self) {
        for _ in 0..START_MS {
            self.run(MILLISECOND);
            let is_boot_up = |frame: &Frame| frame.identifier() == 0x701 && frame.data() == [0];
            if self.machine.chip().can.sent.iter().any(|(_, frame)| is_boot_up(frame)) {
                return self.machine.chip_mut().can.sent.clear();
            }
        }
        let fault = &self.machine.chip().last_fault;
        panic!("no boot-up frame, at {:#x}, {fault:?}", self.machine.pc());
    }
}

impl Bus for BoardBus {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        self.run(FRAME_US * MICROSECOND);
        // A sender sends its frames in order, though a later one may have a lower identifier.
        for _ in 0..LONGEST_WAIT_FRAMES {
            if self.machine.chip().can.waiting_frames() == 0 {
                break;
            }
            self.run(FRAME_US * MICROSECOND / 4);
        }
        self.frames += 1;
        let mut frames: Vec<Frame> = frame.to_joint().into_iter().collect();
        if let Some(disturb) = &mut self.disturbance {
            disturb(self.frames, &mut frames);
        }
        for frame in frames {
            self.machine.chip_mut().deliver(frame);
        }
        Ok(())
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError> {
        loop {
            if self.has_power()
                && let Some((_, frame)) = self.machine.chip_mut().can.sent.pop_front()
            {
                return Ok(Some(Received { time_ns: self.now_ns(), frame: frame.into() }));
            }
            if self.now_ns() >= until_ns {
                return Ok(None);
            }
            self.run(50 * MICROSECOND);
        }
    }

    fn now_ns(&self) -> u64 {
        self.now() * 1000 / MICROSECOND
    }

    fn counters(&self) -> Counters {
        Counters::default()
    }
}

/// Powers a board up and waits for its boot-up frame.
pub fn started(content: Content) -> Client<BoardBus> {
    let mut bus = BoardBus::power_up(content);
    bus.await_boot_up();
    Client::new(bus, NODE)
}

/// Starts the image without the boot program, as a debugger does, and waits for its boot-up frame.
pub fn started_image() -> Client<BoardBus> {
    let machine = Machine::new(image(), Chip::new(Constant::default())).expect("a machine");
    let mut bus = BoardBus::of_machine(machine);
    bus.await_boot_up();
    Client::new(bus, NODE)
}

/// Reads an entry of the object of the program.
pub fn entry(client: &mut Client<BoardBus>, sub_index: u8) -> u32 {
    client.read_number(Address::new(index::PROGRAM, sub_index)).expect("an answer")
}
