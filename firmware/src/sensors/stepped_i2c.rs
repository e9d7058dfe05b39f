//! I2C transfers in steps, so that the background waits for no byte.
//!
//! A transfer of four bytes takes 130 us at 400 kHz, and the attempt to reach an absent sensor with the recovery of its bus
//! as much. If the background waited for them, received frames would wait too. [`SteppedI2c::step`] does what the
//! controller is ready for, once a millisecond: at most one byte, or half a clock of a recovery. In between, the controller
//! holds the clock low, which the bus permits for any time (I2C-bus specification UM10204, 3.1.9).
//!
//! ```text
//! driver -> write, write_read -> Err(Pending), until the transfer has ended -> result
//! tick   -> step              -> controller
//! ```
//! A driver calls again with the same arguments until the result is not [`BusFault::Pending`]. Several drivers share the
//! bus: the transfer of one is pending until that of another has ended.

use super::bus_recovery::{BusWires, Recovery};
use super::ms5837::SensorBus;
use embedded_hal::i2c::{Error, ErrorKind, ErrorType, I2c, NoAcknowledgeSource, Operation};

/// Longest command that is written, and longest answer, bytes.
const COMMAND_BYTES: usize = 2;
const ANSWER_BYTES: usize = 26;

/// Steps without progress after which a transfer has failed: a device holds the clock.
const TIMEOUT_STEPS: u8 = 20;

/// Steps for which a result is kept for its driver. One that is turned off does not fetch it.
const KEPT_STEPS: u8 = 50;

/// State of a controller. Reading it clears nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Events {
    /// An address or a byte was not acknowledged.
    pub not_acknowledged: bool,
    /// A start or stop condition at a wrong place, or arbitration lost.
    pub bus_error: bool,
    /// A byte can be sent.
    pub can_send: bool,
    /// A byte was received.
    pub has_byte: bool,
    /// The bytes of a write without stop condition are sent.
    pub is_complete: bool,
    /// A stop condition was sent.
    pub has_stopped: bool,
}

/// What a controller does by itself after a start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Segment {
    /// A write, and a stop condition.
    Write,
    /// A write that a read follows.
    WriteBeforeRead,
    /// A read, and a stop condition.
    Read,
}

/// An I2C controller with manual control of its lines.
pub trait Controller {
    /// The lines under manual control.
    type Wires: BusWires;

    /// Returns what has happened since the last start.
    fn events(&mut self) -> Events;

    /// Clears the events and begins a segment of `count` bytes.
    fn start(&mut self, address: u8, count: u8, segment: Segment);

    /// Sends a byte.
    fn send(&mut self, byte: u8);

    /// Returns the received byte.
    fn receive(&mut self) -> u8;

    /// Ends what the controller does, and releases the lines.
    fn reset(&mut self);

    /// Takes the lines under manual control, or returns them to the controller.
    fn control_lines(&mut self, manually: bool);

    /// Returns the lines.
    fn wires(&mut self) -> &mut Self::Wires;
}

/// Reason why there is no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusFault {
    /// The transfer has not ended: call again with the same arguments.
    Pending,
    /// No device acknowledged.
    NotAcknowledged,
    /// A start or stop condition at a wrong place, or arbitration lost.
    Disturbed,
    /// A device holds the clock.
    Timeout,
    /// The transfer is not a write or a write with a read, or it is too long.
    Unsupported,
}

impl Error for BusFault {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::NotAcknowledged => ErrorKind::NoAcknowledge(NoAcknowledgeSource::Unknown),
            Self::Disturbed => ErrorKind::Bus,
            _ => ErrorKind::Other,
        }
    }
}

/// A write, and the read that follows it.
#[derive(Clone, Copy, Debug)]
struct Transfer {
    address: u8,
    command: [u8; COMMAND_BYTES],
    to_send: u8,
    sent: u8,
    answer: [u8; ANSWER_BYTES],
    to_receive: u8,
    received: u8,
    /// Steps without progress.
    waited: u8,
}

/// What the bus does.
#[derive(Clone, Copy, Debug)]
enum Work {
    Idle,
    Transfer(Transfer),
    /// A result that its driver has not fetched.
    Ended {
        transfer: Transfer,
        result: Result<(), BusFault>,
        age_steps: u8,
    },
    Recovery(Recovery),
}

/// A bus whose transfers run in steps.
#[derive(Debug)]
pub struct SteppedI2c<C> {
    controller: C,
    work: Work,
}

impl<C: Controller> SteppedI2c<C> {
    /// Creates the bus of a controller that is set up.
    pub const fn new(controller: C) -> Self {
        Self { controller, work: Work::Idle }
    }

    /// Does what the controller is ready for. Call it once a millisecond.
    pub fn step(&mut self) {
        match &mut self.work {
            Work::Idle => {}
            Work::Transfer(transfer) => {
                if let Some(result) = transfer.step(&mut self.controller) {
                    self.work = Work::Ended { transfer: *transfer, result, age_steps: 0 };
                }
            }
            Work::Ended { age_steps, .. } => {
                *age_steps += 1;
                if *age_steps == KEPT_STEPS {
                    self.work = Work::Idle;
                }
            }
            Work::Recovery(recovery) => {
                if recovery.step(self.controller.wires()).is_some() {
                    // A bus that stays held shows as a sensor without answers.
                    self.controller.control_lines(false);
                    self.work = Work::Idle;
                }
            }
        }
    }

    /// Begins a transfer, or fetches its result.
    fn transfer(&mut self, address: u8, command: &[u8], into: &mut [u8]) -> Result<(), BusFault> {
        if let Work::Ended { transfer, result, .. } = self.work
            && transfer.address == address
        {
            self.work = Work::Idle;
            if transfer.is_of(command, into.len()) {
                let answer = transfer.answer.get(..into.len());
                answer.into_iter().for_each(|answer| into.copy_from_slice(answer));
                return result;
            }
        }
        if matches!(self.work, Work::Idle) {
            let transfer = Transfer::new(address, command, into.len())?;
            let segment = if into.is_empty() { Segment::Write } else { Segment::WriteBeforeRead };
            self.controller.start(address, transfer.to_send, segment);
            self.work = Work::Transfer(transfer);
        }
        Err(BusFault::Pending)
    }
}

impl Transfer {
    fn new(address: u8, from: &[u8], to_receive: usize) -> Result<Self, BusFault> {
        let mut command = [0; COMMAND_BYTES];
        let place = command.get_mut(..from.len()).ok_or(BusFault::Unsupported)?;
        place.copy_from_slice(from);
        if to_receive > ANSWER_BYTES {
            return Err(BusFault::Unsupported);
        }
        let (to_send, to_receive) = (from.len() as u8, to_receive as u8);
        let answer = [0; ANSWER_BYTES];
        Ok(Self { address, command, to_send, sent: 0, answer, to_receive, received: 0, waited: 0 })
    }

    fn is_of(&self, command: &[u8], to_receive: usize) -> bool {
        self.command.get(..usize::from(self.to_send)) == Some(command)
            && usize::from(self.to_receive) == to_receive
    }

    /// Does a step. Returns the result at the end.
    fn step(&mut self, controller: &mut impl Controller) -> Option<Result<(), BusFault>> {
        let events = controller.events();
        let fault = if events.not_acknowledged {
            Some(BusFault::NotAcknowledged)
        } else if events.bus_error {
            Some(BusFault::Disturbed)
        } else if self.waited == TIMEOUT_STEPS {
            Some(BusFault::Timeout)
        } else {
            None
        };
        if let Some(fault) = fault {
            controller.reset();
            return Some(Err(fault));
        }
        self.waited += 1;
        if events.has_byte {
            self.waited = 0;
            let byte = controller.receive();
            if let Some(place) = self.answer.get_mut(usize::from(self.received)) {
                *place = byte;
            }
            self.received += 1;
            return (self.received >= self.to_receive).then_some(Ok(()));
        }
        if events.can_send && self.sent < self.to_send {
            self.waited = 0;
            controller.send(self.command.get(usize::from(self.sent)).copied().unwrap_or(0));
            self.sent += 1;
        } else if events.is_complete && self.to_receive > 0 {
            self.waited = 0;
            controller.start(self.address, self.to_receive, Segment::Read);
        } else if events.has_stopped && self.to_receive == 0 {
            return Some(Ok(()));
        }
        None
    }
}

impl<C: Controller> ErrorType for SteppedI2c<C> {
    type Error = BusFault;
}

impl<C: Controller> I2c for SteppedI2c<C> {
    fn transaction(&mut self, address: u8, steps: &mut [Operation<'_>]) -> Result<(), BusFault> {
        match steps {
            [Operation::Write(command)] => self.transfer(address, command, &mut []),
            [Operation::Write(command), Operation::Read(into)] => {
                self.transfer(address, command, into)
            }
            _ => Err(BusFault::Unsupported),
        }
    }
}

impl<C: Controller> SensorBus for SteppedI2c<C> {
    fn recover(&mut self) {
        if !matches!(self.work, Work::Recovery(_)) {
            // A transfer of another driver is repeated.
            self.controller.reset();
            self.controller.control_lines(true);
            self.work = Work::Recovery(Recovery::default());
        }
    }

    fn is_pending(fault: &BusFault) -> bool {
        *fault == BusFault::Pending
    }
}

#[cfg(test)]
#[path = "stepped_i2c_tests.rs"]
mod tests;
