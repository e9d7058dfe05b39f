//! The board as the background loop uses it, and the bodies of its tasks.

use super::can::{self, Controller};
use super::{microseconds, watchdog};
use compensator_core::can::{FdTelemetry, Frame};
use firmware::background::{Background, Board, BoardState, RoundOutcome};
use firmware::joint_node::{BoardOutput, Joint};
use firmware::loop_link::LoopLink;
use firmware::sensors::SensorParameters;
use firmware::{heat_memory, home_memory, stack_guard};
use heapless::spsc::{Consumer, Producer};

/// What a board has besides its bus and its current loop.
pub trait Periphery {
    /// Reads the sensors of the board: see [`Board::state`].
    fn state(&mut self, now_us: u64) -> BoardState;

    /// See [`Board::apply_sensors`].
    fn apply_sensors(&mut self, sensors: &SensorParameters);

    /// Sets the output of the holding brake: see [`BoardOutput::brake`].
    fn set_holding_brake(&mut self, _output: Option<bool>) {}

    /// Starts to read the encoder at the joint's side, if there is one. Returns true if it has started now.
    fn read_joint_encoder(&mut self) -> bool {
        false
    }

    /// See [`Board::send_fd`].
    fn send_fd(_controller: &mut Controller, _frame: &FdTelemetry) {}
}

/// The board.
pub struct JointBoard<P> {
    pub controller: Controller,
    pub frames: Consumer<'static, Frame>,
    pub link: LoopLink<'static>,
    pub periphery: P,
}

impl<P: Periphery> Board for JointBoard<P> {
    const RESTART_FLUSH_US: u64 = 20_000;

    fn now_us(&mut self) -> u64 {
        microseconds::now_us()
    }

    fn receive(&mut self) -> Option<Frame> {
        self.frames.dequeue()
    }

    fn has_room_for(&mut self, identifier: u16) -> bool {
        self.controller.has_room_for(identifier)
    }

    fn send(&mut self, frame: &Frame) {
        self.controller.send(frame);
    }

    fn send_fd(&mut self, frame: &FdTelemetry) {
        P::send_fd(&mut self.controller, frame);
    }

    fn is_idle(&mut self) -> bool {
        self.controller.is_idle()
    }

    fn apply_sensors(&mut self, sensors: &SensorParameters) {
        self.periphery.apply_sensors(sensors);
    }

    fn accept_identifiers(&mut self, identifiers: &[u16; 7]) {
        self.controller.accept(identifiers);
    }

    fn state(&mut self, now_us: u64) -> BoardState {
        BoardState {
            stack_intact: stack_guard::is_intact(),
            receiver_overrun: self.controller.take_overrun(),
            can: self.controller.state(),
            ..self.periphery.state(now_us)
        }
    }

    fn current_loop(&mut self) -> Option<&mut LoopLink<'static>> {
        Some(&mut self.link)
    }

    fn read_joint_encoder(&mut self) -> bool {
        self.link.has_report() && self.periphery.read_joint_encoder()
    }

    fn apply(&mut self, output: &BoardOutput) {
        self.periphery.set_holding_brake(output.brake);
        if let Some(rise_k) = output.winding_rise_k {
            heat_memory::keep(rise_k);
        }
        home_memory::keep(output.home);
    }

    fn refresh_watchdog(&mut self) {
        watchdog::refresh_if_loop_runs();
    }
}

/// Moves received frames from the controller to the queue. The interrupt calls it.
#[inline(always)]
pub fn receive_frames(queue: &mut Producer<'static, Frame>) {
    can::receive(|frame| {
        if queue.enqueue(frame).is_err() {
            can::record_lost();
        }
    });
}

/// Runs the background loop.
#[inline(always)]
pub fn run_background<J: Joint, P: Periphery>(
    background: &mut Background<J>,
    board: &mut JointBoard<P>,
) -> ! {
    loop {
        match background.round(board) {
            RoundOutcome::Sleep => cortex_m::asm::wfi(),
            RoundOutcome::Continue => {}
            // A reset opens the bridge.
            RoundOutcome::Restart => cortex_m::peripheral::SCB::sys_reset(),
        }
    }
}
