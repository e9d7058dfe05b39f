//! The chip: its peripherals on one bus, their events, and their interrupt lines.

pub mod adc;
pub mod biss;
pub mod bme280;
mod bus;
pub mod clock;
pub mod comparators;
pub mod dma;
mod encoder_buses;
pub mod fdcan;
pub mod flash;
pub mod gpio;
pub mod i2c;
pub mod ms5837;
pub mod random;
pub mod spi;
pub mod timer1;
pub mod timer20;
pub mod timer3;
pub mod timer5;
pub mod watchdog;
pub mod wiring;

use crate::cycles::{FlashAccess, FlashCaches};
use crate::nvic::{NMI, Nvic};
use crate::world::{Bridge, World};
use adc::{Adc, Signal};
use biss::BissLine;
use clock::Clock;
use comparators::BreakLevels;
use compensator_core::can::Frame;
use dma::{Dma, Memory, request};
use fdcan::Fdcan;
use flash::Flash;
use gpio::Gpio;
use i2c::I2c;
use random::Random;
use spi::Spi;
use std::collections::HashMap;
use timer1::{Timer1, TimerEvent};
use timer3::{SlaveEvent, Timer3};
use timer5::Timer5;
use timer20::Timer20;
use watchdog::Watchdog;
use wiring::Wiring;

/// Core clock, Hz.
pub const CORE_HZ: u64 = 170_000_000;

/// Regions of registers: start and length.
pub const REGISTER_REGIONS: [(u32, u32); 3] =
    [(0x1FFF_0000, 0x1_0000), (0x4000_0000, 0x2000_0000), (0xE000_0000, 0x10_0000)];

/// Interrupt numbers (RM0440, table 97).
mod interrupt {
    pub const ADC1_2: usize = 18;
    pub const FDCAN1_IT0: usize = 21;
    pub const FDCAN1_IT1: usize = 22;
}

/// Shorter times are simulated with what follows them: the trigger is one cycle before the update of the duties.
const MIN_WORLD_STEP_CYCLES: u64 = 10;

const AIRCR: u32 = 0xE000_ED0C;
const VTOR: u32 = 0xE000_ED08;
const DWT_CYCCNT: u32 = 0xE000_1004;
const SPI1_DR: u32 = 0x4001_300C;
const SPI3_DR: u32 = 0x4000_3C0C;
const FLASH_ACR: u32 = 0x4002_2000;
/// Flash size, and the 96 bits of the chip's identity.
const IDENTITY: [(u32, u32); 4] = [
    (0x1FFF_7590, 0x0032_0041),
    (0x1FFF_7594, 0x5833_5012),
    (0x1FFF_7598, 0x2036_3235),
    (0x1FFF_75E0, 512),
];

/// The chip and its surroundings.
pub struct Chip<W> {
    /// Time since the reset, core cycles.
    pub now: u64,
    /// Surroundings.
    pub world: W,
    /// Interrupt controller.
    pub nvic: Nvic,
    /// The bridge's timer.
    pub timer1: Timer1,
    /// The encoder's timer.
    pub timer3: Timer3,
    /// Counter of a quadrature encoder: TIM20, or TIM4.
    pub timer20: Timer20,
    /// Transfers without the core.
    pub dma: Dma,
    /// Clock of the software: TIM5, or TIM2.
    pub timer5: Timer5,
    /// Converters 1 to 5.
    pub adc: [Adc; 5],
    /// Encoder bus.
    pub spi: Spi,
    /// Line of an encoder with BiSS C.
    pub biss: BissLine,
    /// Bus and line of the encoder at the joint's side of the gear.
    pub joint_bus: Spi,
    /// See `joint_bus`.
    pub joint_line: BissLine,
    /// CAN controller.
    pub can: Fdcan,
    /// Flash controller and both banks.
    pub flash: Flash,
    /// Ports.
    pub gpio: Gpio,
    /// Connections of the board.
    pub wiring: &'static Wiring,
    /// Levels of the overcurrent comparators that act.
    pub break_levels: BreakLevels,
    /// Number of a comparator whose pin has no signal.
    pub unwired_comparator: Option<u32>,
    /// Watchdog.
    pub watchdog: Watchdog,
    /// Reset flags and oscillators.
    pub clock: Clock,
    /// Random number generator.
    pub random: Random,
    i2c: I2c,
    /// Flash caches, for the cost of instructions.
    pub caches: FlashCaches,
    /// Present settings of the flash access.
    pub flash_access: FlashAccess,
    /// Registers that are plain memory.
    memory: HashMap<u32, u32>,
    /// Last fault that led to a hard fault.
    pub last_fault: Option<String>,
    next_event: u64,
    ready: Option<usize>,
    reset_requested: bool,
    watchdog_reset: bool,
    /// Time up to which the world has run.
    world_until: u64,
    /// Time until which the loop's interrupt is held back.
    hold_until: u64,
    /// Number of PWM periods in which the bridge was closed.
    pub driven_periods: u64,
}

impl<W: World> Chip<W> {
    /// Returns a chip after power-on.
    pub fn new(mut world: W) -> Self {
        world.set_break_levels(BreakLevels::default());
        let wiring = world.wiring();
        let mut memory: HashMap<u32, u32> = IDENTITY.into_iter().collect();
        memory.insert(FLASH_ACR, 0x0004_0600);
        memory.insert(VTOR, 0x0800_0000);
        Self {
            now: 0,
            world,
            nvic: Nvic::default(),
            timer1: Timer1::default(),
            timer3: Timer3::default(),
            timer20: Timer20::default(),
            dma: Dma::default(),
            timer5: Timer5::default(),
            adc: std::array::from_fn(|at| Adc::new(at + 1)),
            spi: Spi::default(),
            biss: BissLine::default(),
            joint_bus: Spi::default(),
            joint_line: BissLine::default(),
            can: Fdcan::default(),
            flash: Flash::of(wiring.chip),
            gpio: Gpio::wired(wiring),
            wiring,
            break_levels: BreakLevels::default(),
            unwired_comparator: None,
            watchdog: Watchdog::default(),
            clock: Clock::default(),
            random: Random::default(),
            i2c: I2c::default(),
            caches: FlashCaches::default(),
            flash_access: FlashAccess::from_register(0x600),
            memory,
            last_fault: None,
            next_event: 0,
            ready: None,
            reset_requested: false,
            watchdog_reset: false,
            world_until: 0,
            hold_until: 0,
            driven_periods: 0,
        }
    }

    /// Time of the next event, cycles.
    pub fn next_event(&self) -> u64 {
        self.next_event
    }

    /// The exception that could preempt, apart from masks.
    pub fn ready_exception(&self) -> Option<usize> {
        self.ready
    }

    /// Returns true after a request of a reset by software or by the watchdog.
    pub fn is_reset_requested(&self) -> bool {
        self.reset_requested
    }

    /// Returns true if the watchdog requested the reset.
    pub fn is_watchdog_reset(&self) -> bool {
        self.watchdog_reset
    }

    /// Starts with another vector table than that at the start of the flash, as a boot program does.
    pub fn set_vector_table(&mut self, address: u32) {
        self.write(VTOR, 4, address);
    }

    /// Start of the vector table.
    pub fn vector_table(&self) -> u32 {
        self.memory[&VTOR]
    }

    /// Holds back the loop's interrupt for this time, cycles.
    pub fn hold_loop_interrupt(&mut self, cycles: u64) {
        self.hold_until = self.now + cycles;
        self.schedule();
    }

    /// Returns the content of a register that is plain memory.
    pub fn plain(&self, address: u32) -> u32 {
        self.memory.get(&address).copied().unwrap_or(0)
    }

    /// Sends a frame to the node.
    pub fn deliver(&mut self, frame: Frame) {
        self.can.deliver(frame, self.now);
        self.schedule();
    }

    /// Sends a remote frame to the node.
    pub fn deliver_remote(&mut self, frame: Frame) {
        self.can.deliver_remote(frame, self.now);
        self.schedule();
    }

    fn schedule(&mut self) {
        let hold = if self.hold_until > self.now { self.hold_until } else { u64::MAX };
        let converters = self.adc.iter().map(Adc::next_event).min().unwrap_or(u64::MAX);
        self.next_event = [
            self.timer1.next_event(),
            self.timer3.next_event(),
            self.spi.next_event(),
            self.joint_bus.next_event(),
            self.timer5.next_event(),
            converters,
            self.can.next_event(),
            self.flash.next_event(),
            self.watchdog.next_event(),
            hold,
        ]
        .into_iter()
        .min()
        .unwrap_or(u64::MAX);
    }

    /// Updates the interrupt lines, and which exception is ready.
    pub fn update_lines(&mut self) {
        let converts = self.adc[..2].iter().any(Adc::line) && self.hold_until <= self.now;
        self.nvic.set_line(interrupt::ADC1_2, converts);
        self.nvic.set_line(interrupt::FDCAN1_IT0, self.can.line(0));
        self.nvic.set_line(interrupt::FDCAN1_IT1, self.can.line(1));
        self.nvic.set_line(self.wiring.chip.clock_interrupt, self.timer5.line());
        if self.flash.take_ecc_error() {
            self.nvic.pend(NMI);
        }
        self.ready = self.nvic.candidate();
    }

    /// Processes all events that are due.
    pub fn process_events(&mut self, memory: &mut dyn Memory) {
        let now = self.now;
        // In the order of their times, because the surroundings are simulated up to each.
        loop {
            let frame_ends = self.spi.next_event();
            let is_slave_first = self.timer3.next_event() < self.timer1.next_event();
            if frame_ends <= now
                && frame_ends <= self.timer1.next_event().min(self.timer3.next_event())
            {
                self.finish_frame(frame_ends, memory);
            } else if is_slave_first && let Some((at, event)) = self.timer3.take_event(now) {
                self.slave_event(at, event, memory);
            } else if let Some((at, event)) = self.timer1.take_event(now) {
                self.timer_event(at, event);
            } else if self.timer3.next_event() > now && self.spi.next_event() > now {
                break;
            }
        }
        while self.joint_bus.next_event() <= now {
            self.finish_joint_word(self.joint_bus.next_event(), memory);
        }
        self.timer5.process(now);
        for adc in &mut self.adc {
            adc.process(now);
        }
        self.can.process(now);
        self.flash.process(now);
        if self.watchdog.is_expired(now) {
            self.request_reset();
            self.watchdog_reset = true;
        }
        self.schedule();
        self.update_lines();
    }

    fn timer_event(&mut self, at: u64, event: TimerEvent) {
        match event {
            TimerEvent::Trigger { is_rising } => {
                self.advance_world(at);
                // Once a period, which has an edge of each direction.
                let delay = if is_rising { self.world.interrupt_delay() } else { 0 };
                if delay > 0 {
                    self.hold_until = at + u64::from(delay);
                }
                self.trigger_converters(at, Signal::Timer1, is_rising);
            }
            // The duties in effect change, so what was before them is simulated first.
            TimerEvent::Turn => {
                if self.timer1.is_update_due() {
                    self.advance_world(at);
                }
                self.timer1.turn();
            }
        }
    }

    fn slave_event(&mut self, at: u64, event: SlaveEvent, memory: &mut dyn Memory) {
        match event {
            SlaveEvent::Trigger { is_rising } => {
                self.trigger_converters(at, Signal::Timer3, is_rising)
            }
            SlaveEvent::OuterRequest => self.send_word(request::TIM3_CH1, at, at, memory),
            SlaveEvent::Request { release_in } => {
                self.send_word(request::TIM3_CH3, at, at + release_in, memory);
            }
        }
    }

    /// Time since the last sample of the surroundings, s.
    fn since_sample(&self) -> f64 {
        (self.now as f64 - self.timer1.last_trigger() as f64) / CORE_HZ as f64
    }

    /// Shows the counter the edges up to now.
    fn follow_edges(&mut self) {
        let edges = self.world.edges(self.since_sample());
        self.timer20.follow(edges, self.gpio.connects(self.wiring.quadrature));
    }

    fn trigger_converters(&mut self, at: u64, signal: Signal, is_rising: bool) {
        if !self.adc.iter().any(|adc| adc.is_triggered_by(signal, is_rising)) {
            return;
        }
        if signal == Signal::Timer1 {
            self.world.sample(self.timer1.low_sides(at));
        }
        let world = &mut self.world;
        for adc in &mut self.adc {
            adc.trigger(at, signal, is_rising, &mut |converter, channel| {
                world.analog(converter, channel)
            });
        }
    }

    /// Simulates the surroundings up to this time with the present state of the bridge.
    fn advance_world(&mut self, until: u64) {
        if until < self.world_until + MIN_WORLD_STEP_CYCLES {
            return;
        }
        let cycles = until - self.world_until;
        self.world_until = until;
        let is_ready = self.gpio.is_gate_driver_awake() && self.gpio.is_bridge_connected();
        let duties = self.timer1.duties().filter(|_| is_ready);
        let bridge = duties.map_or(Bridge::Open, Bridge::Driven);
        self.driven_periods += u64::from(duties.is_some() && cycles > 4000);
        self.world.set_brake_output(self.gpio.is_brake_output_high());
        self.world.advance(cycles as f64 / CORE_HZ as f64, bridge);
        if self.world.is_overcurrent() {
            self.timer1.set_break(false);
        }
        self.gpio.set_torque_allowed(self.world.torque_allowed());
        self.gpio.set_gate_fault(self.world.has_gate_fault());
        self.gpio.set_touched(self.world.is_touched());
        self.break_by_pin();
    }

    /// Activates the break if its pin demands it. A signal without a pin is at rest.
    fn break_by_pin(&mut self) {
        let is_connected = self.gpio.connects(self.wiring.break_input);
        if is_connected && self.timer1.breaks_at(!self.world.has_gate_fault()) {
            self.timer1.set_break(false);
        }
    }

    /// Takes the levels of the comparators from their registers.
    fn update_break_levels(&mut self) {
        let af1 = self.timer1.read(comparators::AF1, self.now);
        let comparators = self.wiring.overcurrent.comparators;
        let levels = comparators::break_levels(comparators, &|address| self.plain(address), af1);
        if levels != self.break_levels {
            self.advance_world(self.now);
            self.break_levels = levels;
            self.world.set_break_levels(levels);
            self.break_by_shunts();
        }
    }

    /// Activates the break if an amplifier is beyond a level, whatever the bridge does.
    fn break_by_shunts(&mut self) {
        if comparators::is_active(&self.break_levels, self.world.shunts()) {
            self.timer1.set_break(false);
        }
    }

    /// Resets the processor, as its pin does: [`Chip::is_reset_requested`].
    pub fn request_reset(&mut self) {
        // A reset returns the timer's outputs to their idle level.
        self.advance_world(self.now);
        self.timer1.open();
        self.reset_requested = true;
    }
}
