//! The background loop of a board: everything a joint driver does that is in no hurry.
//!
//! ```text
//! received frames -> Driver -> frames to send            every round
//! sensors, report of the current loop -> Driver -> orders, parts -> the current loop
//!                                                         once a millisecond
//! ```
//! A [`Board`] gives its wires (frames, time, sensors, watchdog) and calls [`Background::round`] whenever
//! it wakes; everything that can be decided without a register is decided here. Who owns frames and
//! time already, as a simulated bus does, calls [`Background::receive`], [`Background::tick`] and
//! [`Background::transmit`] itself. The current loop runs above all this, in an interrupt; what goes
//! between the two is in [`crate::loop_link`].

use crate::driver::{Driver, LoopReport};
use crate::loop_link::LoopLink;
use crate::sensors::Local;
use crate::supervisor::CanState;
use compensator_core::can::Frame;
use embedded_storage::nor_flash::NorFlash;

/// Time between two ticks of the driver, us.
pub const TICK_US: u64 = 1000;

/// What a board has found out about itself and its surroundings.
#[derive(Clone, Copy, Debug)]
pub struct BoardState {
    /// Temperature of the bridge, deg C; `None` where it is not measured.
    pub bridge_temperature_c: Option<f32>,
    /// Temperature of the motor, deg C; `None` where it is not measured.
    pub motor_temperature_c: Option<f32>,
    /// The guard below the stack is whole.
    pub stack_intact: bool,
    /// The CAN controller lost received frames since this was last asked.
    pub receiver_overrun: bool,
    /// How the CAN controller stands to its bus.
    pub can: CanState,
    /// What the board's own slow sensors last gave.
    pub sensors: Local,
}

impl Default for BoardState {
    /// Nothing measured, nothing wrong.
    fn default() -> Self {
        Self {
            bridge_temperature_c: None,
            motor_temperature_c: None,
            stack_intact: true,
            receiver_overrun: false,
            can: CanState::Active,
            sensors: Local::default(),
        }
    }
}

/// What a board gives its background loop.
pub trait Board {
    /// How long the last frames before a restart may take to be sent, us.
    const FAREWELL_US: u64;

    /// Time since the start, us; never runs backwards.
    fn now_us(&mut self) -> u64;

    /// The next frame received, if there is one.
    fn receive(&mut self) -> Option<Frame>;

    /// Whether a frame to send finds a place.
    fn has_room(&mut self) -> bool;

    /// Sends a frame; called only where there is room.
    fn send(&mut self, frame: &Frame);

    /// Whether every frame given to [`Board::send`] has left.
    fn is_idle(&mut self) -> bool;

    /// Looks at sensors, controller and stack: once a tick.
    fn state(&mut self, now_us: u64) -> BoardState;

    /// The current loop; a board without a bridge has none.
    fn current_loop(&mut self) -> Option<&mut LoopLink<'static>> {
        None
    }

    /// Keeps the watchdog quiet: once a tick, as long as the current loop reports.
    fn feed_watchdog(&mut self) {}
}

/// What a board does after a round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum Next {
    /// Sleep until something is to be done.
    Sleep,
    /// Restart: the network asked for it, and the last frames are sent.
    Restart,
}

/// The background loop's state: the driver, and when it ticks next.
#[derive(Debug)]
pub struct Background<F> {
    driver: Driver<F>,
    due_us: u64,
}

impl<F: NorFlash> Background<F> {
    /// A loop that ticks for the first time now.
    pub const fn new(driver: Driver<F>, now_us: u64) -> Self {
        Self { driver, due_us: now_us }
    }

    /// Does everything there is to do at the moment.
    pub fn round<B: Board>(&mut self, board: &mut B) -> Next {
        while !self.driver.reset_wanted()
            && let Some(frame) = board.receive()
        {
            let now_us = board.now_us();
            self.driver.receive(&frame, now_us);
            // Answers leave before the next frame is looked at, or they would pile up.
            self.send(board);
        }
        let now_us = board.now_us();
        if now_us >= self.due_us {
            self.due_us += TICK_US;
            if self.due_us <= now_us {
                // Whole ticks missed are not made up for.
                self.due_us = now_us + TICK_US;
            }
            let state = board.state(now_us);
            if self.tick(&state, board.current_loop(), now_us) {
                board.feed_watchdog();
            }
        }
        self.send(board);
        if !self.driver.reset_wanted() {
            return Next::Sleep;
        }
        let until_us = board.now_us() + B::FAREWELL_US;
        while !board.is_idle() && board.now_us() < until_us {
            self.send(board);
        }
        Next::Restart
    }

    // Called in several places: kept out of line for the size of the image.
    #[inline(never)]
    fn send(&mut self, board: &mut impl Board) {
        while board.has_room()
            && let Some(frame) = self.driver.transmit()
        {
            board.send(&frame);
        }
    }

    /// Takes in a frame.
    pub fn receive(&mut self, frame: &Frame, now_us: u64) {
        self.driver.receive(frame, now_us);
    }

    /// The next frame to send.
    pub fn transmit(&mut self) -> Option<Frame> {
        self.driver.transmit()
    }

    /// Does what is due every [`TICK_US`]; gives whether the current loop is alive, where there is one.
    pub fn tick(
        &mut self,
        state: &BoardState,
        current_loop: Option<&mut LoopLink>,
        now_us: u64,
    ) -> bool {
        let Some(link) = current_loop else {
            self.report(state, &LoopReport::default());
            self.observe(state, now_us);
            return true;
        };
        link.reports(now_us, |report| self.report(state, &report));
        self.observe(state, now_us);
        let mut orders = self.driver.orders(now_us);
        state.sensors.complete(&mut orders.covariates, now_us);
        self.driver.watch_seal(&mut orders.covariates, now_us);
        orders.factors = self.driver.supply(&orders.covariates, now_us);
        link.order(orders, self.driver.set());
        link.is_alive(now_us)
    }

    // As `send`.
    #[inline(never)]
    fn report(&mut self, state: &BoardState, report: &LoopReport) {
        self.driver.report(&LoopReport {
            bridge_temperature_c: state.bridge_temperature_c,
            motor_temperature_c: state.motor_temperature_c,
            stack_intact: state.stack_intact,
            ..*report
        });
    }

    fn observe(&mut self, state: &BoardState, now_us: u64) {
        self.driver.bus_state(state.receiver_overrun, state.can);
        self.driver.tick(now_us);
    }

    /// The driver, to look at.
    pub const fn driver(&self) -> &Driver<F> {
        &self.driver
    }

    /// Gives the flash back: for the next life, or to be closed before a restart.
    pub fn into_flash(self) -> F {
        self.driver.into_flash()
    }
}
