//! A log of the same run with classic telemetry and with telemetry in CAN FD frames, read as `diagnose` reads it.

use canopen_rs::Address;
use compensator_core::can::{CommandFrame, Frame, Message, NodeId, SyncFrame};
use firmware::node::dictionary::index;
use joint_bus::bus::{Bus, Hub};
use joint_bus::canopen::Client;
use joint_rig::MotorNode;
use joint_trace::{Assembler, CanFrame, Fraction, Line, TraceSample, candump};

const NODE: NodeId = NodeId::FIRST;
const MILLISECOND_NS: u64 = 1_000_000;
const FD_TELEMETRY: u8 = 9;

/// A bus whose frames are logged, with its log.
struct LoggedBus<B> {
    bus: B,
    log: Vec<u8>,
}

impl<B: Bus> LoggedBus<B> {
    fn write(&mut self, time_ns: u64, frame: CanFrame) {
        let line = Line { time_ns, interface: b"can0", frame, direction: None };
        candump::emit(&line, Fraction::Nanoseconds, &mut self.log);
    }

    fn send(&mut self, frame: impl Into<CanFrame>) {
        let frame = frame.into();
        self.bus.send(&frame).expect("a bus");
        self.write(self.bus.now_ns(), frame);
    }

    fn receive_until(&mut self, until_ns: u64) {
        while let Some(received) = self.bus.receive(until_ns).expect("a bus") {
            self.write(received.time_ns, received.frame);
        }
    }
}

/// Drives a commissioned joint for 400 ms. Returns the log of the bus.
fn log_of_run(fd_telemetry: bool) -> String {
    let hub = Hub::new();
    hub.attach(MotorNode::commissioned().expect("a joint"));
    let mut client = Client::new(hub.port(), NODE);
    client
        .write(Address::new(index::OPERATION, FD_TELEMETRY), &[fd_telemetry.into()])
        .expect("a setting");
    // Classic telemetry of every sample, as in frames of CAN FD.
    for at_index in index::TRANSMIT_ANSWER..=index::TRANSMIT_TORQUE {
        client.write(Address::new(at_index, 2), &[1]).expect("a type");
    }
    let mut bus = LoggedBus { bus: client.into_bus(), log: Vec::new() };
    let start_ns = bus.bus.now_ns();
    let frame = |identifier, data: &[u8]| Frame::new(identifier, data).expect("legal");
    let request = |state| frame(0x601, &[0x2F, 0x02, 0x20, 1, state, 0, 0, 0]);
    for step in 0..400u32 {
        match step {
            0 => bus.send(frame(0x000, &[1, 1])),
            50 => bus.send(request(2)),
            60 => bus.send(request(1)),
            _ => {}
        }
        let current_a = if step < 100 { 0.0 } else { 6.0 };
        let command = CommandFrame::new(current_a, 0.0, step as u8);
        bus.send(Message::Command(NODE, command).emit());
        bus.send(Message::Sync(SyncFrame::of(step)).emit());
        bus.receive_until(start_ns + u64::from(step + 1) * MILLISECOND_NS);
    }
    String::from_utf8(bus.log).expect("text")
}

/// Returns the samples of a log, without the numbers of their lines.
fn samples(log: &str) -> Vec<TraceSample> {
    let mut assembler = Assembler::default();
    let mut samples: Vec<TraceSample> = log
        .lines()
        .filter_map(|line| assembler.push(0, &candump::parse(line.as_bytes()).expect("a line")))
        .collect();
    samples.extend(assembler.finish().0);
    samples
}

#[test]
fn run_with_fd_telemetry_gives_the_samples_of_classic_telemetry() {
    let [classic, fd] = [false, true].map(log_of_run);
    let frames = |log: &str, text: &str| log.lines().filter(|line| line.contains(text)).count();
    assert_eq!((frames(&classic, "381#"), frames(&classic, "##")), (400, 0));
    // One frame instead of five.
    assert_eq!((frames(&fd, "381##1"), frames(&fd, "181#"), frames(&fd, "481#")), (400, 0, 0));
    let [classic, fd] = [samples(&classic), samples(&fd)];
    assert_eq!(format!("{fd:?}"), format!("{classic:?}"));
    assert!(classic.len() >= 398, "{}", classic.len());
    let fastest = classic.iter().map(|sample| sample.motion.velocity_rad_s).fold(0.0, f32::max);
    assert!(fastest > 0.5, "the joint moves: {fastest} rad/s");
}
