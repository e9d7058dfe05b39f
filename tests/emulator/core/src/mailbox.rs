//! Requests and answers in RAM.
//!
//! The first request builds a joint: its count states the number type, and whether it is the reference network or the model of
//! the record that follows. Each further one has the frames of some samples; the answer has the words of each sample.
#![allow(unsafe_code)] // A static that the emulator writes.

use compensator_core::can::{Frame, Message, NodeId, SampleAssembler, SyncOutcome};
use compensator_core::{Fixed, record};
use core::hint::black_box;
use core_image::{CompensatedJoint, Joint, NetworkJoint, Number, WORDS};

/// Largest number of frames in a request, and of samples in its answer.
const FRAMES: usize = 1024;
const SAMPLES: usize = 512;

/// States of the mailbox.
const REQUESTED: u32 = 1;
const ANSWERED: u32 = 2;
const FAILED: u32 = 3;

/// A frame: identifier, length, data.
#[repr(C)]
#[derive(Clone, Copy)]
struct Slot {
    identifier: u16,
    length: u16,
    data: [u8; 8],
}

#[repr(C)]
struct Mailbox {
    state: u32,
    /// Number of frames of the request, then of samples of the answer.
    count: u32,
    frames: [Slot; FRAMES],
    answers: [[u32; WORDS]; SAMPLES],
}

#[unsafe(no_mangle)]
static mut MAILBOX: Mailbox = Mailbox {
    state: 0,
    count: 0,
    frames: [Slot { identifier: 0, length: 0, data: [0; 8] }; FRAMES],
    answers: [[0; WORDS]; SAMPLES],
};

fn set_state(state: u32) {
    cortex_m::asm::dmb();
    // SAFETY: a word that only the emulator writes besides.
    unsafe { (&raw mut MAILBOX.state).write_volatile(state) }
}

/// Waits for a request.
fn mailbox() -> &'static mut Mailbox {
    // SAFETY: as above; the emulator leaves the mailbox alone while it is requested.
    unsafe {
        while (&raw const MAILBOX.state).read_volatile() != REQUESTED {}
        // What the emulator has written is read again.
        cortex_m::asm::dmb();
        black_box(&mut *(&raw mut MAILBOX))
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    set_state(FAILED);
    loop {
        cortex_m::asm::nop();
    }
}

/// Builds a joint, and answers for ever; returns if a request is wrong.
fn serve<T: Number>(record: &[u8], is_network: bool) -> Option<()> {
    if is_network {
        return answer(NetworkJoint::<T>::build()?);
    }
    let friction = record::parse(record.get(..record::LENGTH)?).ok()?;
    answer(CompensatedJoint::<T>::build(&friction)?)
}

fn answer(mut joint: impl Joint) -> Option<()> {
    let mut inbox = SampleAssembler::new(NodeId::FIRST);
    set_state(ANSWERED);
    loop {
        let mailbox = mailbox();
        let mut samples = 0;
        for slot in mailbox.frames.get(..mailbox.count as usize)? {
            let data = slot.data.get(..usize::from(slot.length))?;
            match Message::parse(&Frame::new(slot.identifier, data)?).ok()? {
                Message::Sync(sync) => {
                    if let SyncOutcome::Sample { .. } = inbox.sync(sync) {
                        *mailbox.answers.get_mut(samples)? = joint.step(&inbox);
                        inbox.end_sample();
                        samples += 1;
                    }
                }
                message => {
                    inbox.take(&message);
                }
            }
        }
        mailbox.count = samples as u32;
        set_state(ANSWERED);
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let mailbox = mailbox();
    let (is_fixed, is_network) = (mailbox.count & 1 == 1, mailbox.count & 2 == 2);
    // SAFETY: bytes of the frames, which are plain data and are not written before the joint is built.
    let record = unsafe {
        let first = mailbox.frames.as_ptr().cast::<u8>();
        core::slice::from_raw_parts(first, size_of_val(&mailbox.frames))
    };
    let _ = if is_fixed {
        serve::<Fixed>(record, is_network)
    } else {
        serve::<f32>(record, is_network)
    };
    panic!("a wrong request")
}
