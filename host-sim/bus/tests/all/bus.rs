//! Tests of the bus in this process, the fault injector and the recorder.
//!
//! A replay is an equality check because the same calls give the same frames at the same nanoseconds, faults included.
//! Frame times are those of the wire, and arbitration is that of CAN. The rates of faults have limits on both sides, so a
//! random sampler that never injects a fault fails too.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::{Duration, Instant};

use joint_bus::bus::slcan::Options;
use joint_bus::bus::{
    BitRates, Bus, BusError, BusName, FaultCounters, FaultInjector, FaultPlan, Faults, Hub,
    Participant, Recorder,
};
use joint_trace::{CanFrame, Direction, Fraction, candump};

fn frame(identifier: u32, data: &[u8]) -> CanFrame {
    let mut bytes = [0; 8];
    bytes[..data.len()].copy_from_slice(data);
    CanFrame::Data { identifier, extended: false, length: data.len() as u8, bytes }
}

/// Answers each frame with the next identifier, and sends a frame every millisecond.
#[derive(Default)]
struct Joint {
    out: Vec<CanFrame>,
    ticks: Vec<u64>,
}

impl Participant for Joint {
    fn receive(&mut self, frame: &CanFrame, _: u64) {
        if let CanFrame::Data { identifier, .. } = frame {
            self.out.push(self::frame(identifier + 1, frame.data()));
        }
    }

    fn tick(&mut self, now_ns: u64) -> Option<u64> {
        self.ticks.push(now_ns);
        self.out.push(frame(0x701, &[5]));
        Some(now_ns + 1_000_000)
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        if self.out.is_empty() { None } else { Some(self.out.remove(0)) }
    }
}

#[test]
fn participant_receives_frames_and_ticks() {
    let hub = Hub::new();
    let joint = Rc::new(RefCell::new(Joint::default()));
    hub.attach(joint.clone());
    let mut port = hub.port();
    assert_eq!(port.receive(0).unwrap().unwrap().frame, frame(0x701, &[5]), "woken at once");
    port.send(&frame(0x201, &[1, 2])).unwrap();
    let answer = port.receive(0).unwrap().unwrap();
    assert_eq!((answer.time_ns, answer.frame), (0, frame(0x202, &[1, 2])));
    assert_eq!(port.receive(999_999).unwrap(), None);
    assert_eq!(port.now_ns(), 999_999);
    assert_eq!(port.receive(u64::MAX).unwrap().unwrap().time_ns, 1_000_000);
    hub.run_until(5_000_000).unwrap();
    assert_eq!(joint.borrow().ticks, [0, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 5_000_000]);
    let waiting: Vec<u64> =
        std::iter::from_fn(|| port.receive(0).unwrap()).map(|received| received.time_ns).collect();
    assert_eq!(waiting, [2_000_000, 3_000_000, 4_000_000, 5_000_000]);
    let counters = port.counters();
    assert_eq!((counters.sent, counters.received, counters.lost), (1, 7, 0));
}

#[test]
fn send_reaches_all_other_ports_but_not_the_sender() {
    let hub = Hub::new();
    let mut ports = [hub.port(), hub.port(), hub.port()];
    let error = CanFrame::Error { class: 4, length: 8, bytes: [1; 8] };
    let remote = CanFrame::Remote { identifier: 5, extended: true, length: 3 };
    let flexible =
        CanFrame::Flexible { identifier: 6, extended: false, flags: 1, length: 64, bytes: [7; 64] };
    for sent in [error, remote, flexible, frame(1, &[])] {
        ports[1].send(&sent).unwrap();
        for at in [0, 2] {
            assert_eq!(ports[at].receive(0).unwrap().map(|arrived| arrived.frame), Some(sent));
        }
        assert_eq!(ports[1].receive(0).unwrap(), None);
    }
    assert_eq!(ports[0].counters().errors, 1);
}

#[test]
fn hub_with_bit_rates_sends_lowest_identifier_first() {
    let rates = BitRates { nominal: 1_000_000, data: 1_000_000 };
    let hub = Hub::with_bit_rates(rates);
    let (mut first, mut second, mut third) = (hub.port(), hub.port(), hub.port());
    let eight = [0x55; 8];
    // The first sender gets the bus; then arbitration decides.
    first.send(&frame(0x300, &eight)).unwrap();
    first.send(&frame(0x100, &eight)).unwrap();
    second.send(&frame(0x200, &eight)).unwrap();
    second.send(&CanFrame::Remote { identifier: 0x100, extended: false, length: 0 }).unwrap();
    third.send(&frame(0x081, &eight)).unwrap();
    let mut listener = hub.port();
    let mut arrived = Vec::new();
    while let Some(received) = listener.receive(10_000_000).unwrap() {
        let (identifier, remote) = match received.frame {
            CanFrame::Data { identifier, .. } => (identifier, false),
            CanFrame::Remote { identifier, .. } => (identifier, true),
            other => panic!("{other:?}"),
        };
        arrived.push((identifier, remote, received.time_ns));
    }
    let order: Vec<(u32, bool)> = arrived.iter().map(|(at, remote, _)| (*at, *remote)).collect();
    // All waited before any transmission, so the lowest first frame of a queue wins; each queue keeps its order.
    assert_eq!(
        order,
        [(0x081, false), (0x200, false), (0x100, true), (0x300, false), (0x100, false)]
    );
    let mut last = 0;
    for (_, remote, time_ns) in &arrived {
        let bits = (time_ns - last) / 1000;
        let expected = if *remote { 44..=56 } else { 111..=135 };
        assert!(expected.contains(&bits), "{bits} bits in {arrived:?}");
        last = *time_ns;
    }
    let load = hub.load();
    assert!((load - last as f64 / 10e6).abs() < 1e-9, "{load}");
}

#[test]
fn send_with_full_queue_waits_in_virtual_time() {
    let hub = Hub::with_bit_rates(BitRates { nominal: 125_000, data: 125_000 });
    let (mut port, mut other) = (hub.port(), hub.port());
    for count in 0..100u8 {
        port.send(&frame(0x10, &[count; 8])).unwrap();
    }
    assert!(port.counters().waits > 0 && hub.now_ns() > 70_000_000, "{}", hub.now_ns());
    let data: Vec<u8> = std::iter::from_fn(|| other.receive(1_000_000_000).unwrap())
        .map(|received| received.frame.data()[0])
        .collect();
    assert_eq!(data, (0..100).collect::<Vec<u8>>());
    assert!(hub.load() > 0.07 && hub.load() < 0.12, "{}", hub.load());
}

#[test]
fn hub_with_endless_answers_returns_storm() {
    let hub = Hub::new();
    let answering = || {
        let mut joint = Joint::default();
        joint.ticks.push(0);
        joint
    };
    hub.attach(answering());
    hub.attach(answering());
    let error = hub.run_until(1_000_000).expect_err("each answers the other");
    assert!(matches!(error, BusError::Storm { .. }), "{error}");
}

#[test]
fn hub_with_limited_pace_gives_the_same_events() {
    let arrived = |pace: Option<f64>| {
        let hub = Hub::new();
        hub.attach(Joint::default());
        let mut port = hub.port();
        pace.inspect(|rate| hub.keep_pace(*rate));
        let begin = Instant::now();
        let arrived: Vec<_> = std::iter::from_fn(|| port.receive(50_000_000).unwrap()).collect();
        (arrived, begin.elapsed())
    };
    let (fast, _) = arrived(None);
    let (slow, took) = arrived(Some(0.5));
    assert_eq!(fast, slow);
    assert!(took >= Duration::from_millis(95), "{took:?}");
}

/// Runs a minute of traffic at 100 Hz through fault injector and recorder. Returns the log, the faults and the duration.
fn minute(seed: u64) -> (Vec<u8>, [FaultCounters; 2], Duration) {
    let begin = Instant::now();
    let hub = Hub::with_bit_rates(BitRates::FASTEST);
    hub.attach(Joint::default());
    let faults = Faults {
        drop: 0.05,
        duplicate: 0.1,
        corrupt: 0.03,
        delay: 0.2,
        reorder: 0.08,
        longest_delay_ns: 3_000_000,
    };
    let plan = FaultPlan { sent: faults, received: Faults { drop: 0.3, ..faults } };
    let injector = FaultInjector::new(hub.port(), plan, seed);
    let mut log = Vec::new();
    let mut bus = Recorder::new(injector, &mut log, "loop", Fraction::Nanoseconds);
    for sample in 0..6000u64 {
        let time_ns = sample * 10_000_000;
        while bus.receive(time_ns).unwrap().is_some() {}
        bus.send(&frame(0x201, &sample.to_le_bytes())).unwrap();
    }
    let (sent, received) = bus.bus().fault_counters();
    bus.flush().unwrap();
    drop(bus);
    (log, [sent, received], begin.elapsed())
}

#[test]
fn fault_injector_with_equal_seeds_gives_equal_logs() {
    let (first, faults, took) = minute(7);
    let (again, same, _) = minute(7);
    assert!(first == again && faults == same, "the same seed");
    assert!(first != minute(8).0, "another seed");
    assert!(first.len() > 1_000_000, "{} bytes", first.len());
    println!("a minute of traffic in {took:?}: {} lines", first.split(|b| *b == b'\n').count());
    // The recording can be parsed and is ordered by time.
    let mut last = 0;
    for line in first.split(|byte| *byte == b'\n').filter(|line| !line.is_empty()) {
        let line = candump::parse(line).expect("a line");
        assert!(line.time_ns >= last && line.direction.is_some());
        last = line.time_ns;
    }
}

#[test]
fn fault_injector_injects_faults_at_their_rates() {
    let (_, [sent, received], _) = minute(3);
    assert_eq!(sent.frames, 6000);
    // A heartbeat every millisecond, and an answer to each received frame.
    assert!(received.frames > 60_000, "{received:?}");
    let near = |count: u64, of: u64, rate: f64| {
        let (of, count) = (of as f64, count as f64);
        // Four standard deviations of a binomial distribution.
        let band = 4.0 * (of * rate * (1.0 - rate)).sqrt();
        assert!((count - of * rate).abs() <= band, "{count} of {of}, expected {rate}");
        assert!(band < 0.5 * of * rate, "a band that says something");
    };
    for (way, drop) in [(sent, 0.05), (received, 0.3)] {
        near(way.dropped, way.frames, drop);
        let left = way.frames - way.dropped;
        near(way.duplicated, left, 0.1);
        near(way.corrupted, left, 0.03);
        near(way.delayed, left, 0.2);
        near(way.reordered, left - way.delayed, 0.08);
    }
}

/// Returns the frames that a listener receives of `frames`, sent through a fault injector every millisecond.
fn through(faults: Faults, frames: u64) -> (Vec<(u64, CanFrame)>, FaultCounters) {
    let hub = Hub::new();
    let plan = FaultPlan { sent: faults, received: Faults::default() };
    let mut bus = FaultInjector::new(hub.port(), plan, 1);
    let mut listener = hub.port();
    for count in 0..frames {
        assert_eq!(bus.receive(count * 1_000_000).unwrap(), None);
        bus.send(&frame(0x100, &count.to_le_bytes())).unwrap();
    }
    assert_eq!(bus.receive(frames * 1_000_000 + faults.longest_delay_ns).unwrap(), None);
    let arrived = std::iter::from_fn(|| listener.receive(0).unwrap());
    let arrived = arrived.map(|received| (received.time_ns, received.frame)).collect();
    (arrived, bus.fault_counters().0)
}

fn number(frame: &CanFrame) -> u64 {
    frame.data().try_into().map(u64::from_le_bytes).expect("eight bytes")
}

#[test]
fn fault_injector_with_one_fault_injects_only_that() {
    let (arrived, _) = through(Faults::default(), 100);
    let expected: Vec<_> =
        (0..100u64).map(|at| (at * 1_000_000, frame(0x100, &at.to_le_bytes()))).collect();
    assert_eq!(arrived, expected, "none");

    let (arrived, faults) = through(Faults { drop: 1.0, ..Faults::default() }, 10);
    assert_eq!((arrived.len(), faults.dropped), (0, 10));

    let (arrived, _) = through(Faults { duplicate: 1.0, ..Faults::default() }, 10);
    let numbers: Vec<u64> = arrived.iter().map(|(_, frame)| number(frame)).collect();
    assert_eq!(numbers, (0..10).flat_map(|at| [at, at]).collect::<Vec<u64>>());

    let (arrived, _) = through(Faults { corrupt: 1.0, ..Faults::default() }, 50);
    let flipped = |(at, (_, frame)): (u64, &(u64, CanFrame))| (number(frame) ^ at).count_ones();
    assert!((0..50).zip(&arrived).map(flipped).all(|bits| bits == 1));

    let (arrived, faults) =
        through(Faults { delay: 1.0, longest_delay_ns: 700_000, ..Faults::default() }, 200);
    assert_eq!((arrived.len(), faults.delayed), (200, 200));
    let late: Vec<u64> =
        arrived.iter().zip(0..).map(|((time, _), at)| time - at * 1_000_000).collect();
    assert!(late.iter().all(|late| *late <= 700_000), "{late:?}");
    let mean = late.iter().sum::<u64>() / 200;
    assert!((300_000..400_000).contains(&mean), "{mean}");

    let (arrived, faults) =
        through(Faults { reorder: 0.3, longest_delay_ns: 10_000_000, ..Faults::default() }, 300);
    assert_eq!(arrived.len(), 300);
    let numbers: Vec<u64> = arrived.iter().map(|(_, frame)| number(frame)).collect();
    let backwards = numbers.windows(2).filter(|pair| pair[1] < pair[0]).count() as u64;
    assert!(faults.reordered > 60 && faults.reordered < 120, "{faults:?}");
    assert!(backwards > 40 && backwards <= faults.reordered, "{backwards}");
    let mut sorted = numbers.clone();
    sorted.sort_unstable();
    assert_eq!(sorted, (0..300).collect::<Vec<u64>>(), "none is lost");

    // The last frame has no next frame and is sent at its time limit.
    let (arrived, _) =
        through(Faults { reorder: 1.0, longest_delay_ns: 5_000_000, ..Faults::default() }, 1);
    assert_eq!(arrived, [(5_000_000, frame(0x100, &[0; 8]))]);
}

#[test]
fn recorder_writes_all_frames() {
    let hub = Hub::new();
    hub.attach(Joint::default());
    let mut log = Vec::new();
    let mut bus = Recorder::new(hub.port(), &mut log, "my bus", Fraction::Microseconds);
    let sent = [
        frame(0x123, &[1, 2, 3]),
        CanFrame::Remote { identifier: 0x1234_5678, extended: true, length: 2 },
        CanFrame::Flexible {
            identifier: 0x10,
            extended: false,
            flags: 1,
            length: 12,
            bytes: std::array::from_fn(|at| if at < 12 { at as u8 } else { 0 }),
        },
    ];
    let mut expected = Vec::new();
    for (at, one) in (0..).zip(&sent) {
        while let Some(arrived) = bus.receive(at * 250_000).unwrap() {
            expected.push((arrived.time_ns, arrived.frame, Direction::Received));
        }
        bus.send(one).unwrap();
        expected.push((at * 250_000, *one, Direction::Sent));
    }
    while let Some(arrived) = bus.receive(2_000_000).unwrap() {
        expected.push((arrived.time_ns, arrived.frame, Direction::Received));
    }
    expected.sort_by_key(|(time_ns, ..)| *time_ns);
    bus.flush().unwrap();
    drop(bus);
    let read: Vec<_> = log
        .split(|byte| *byte == b'\n')
        .filter(|line| !line.is_empty())
        .map(|line| candump::parse(line).expect("a line"))
        .inspect(|line| assert_eq!(line.interface, b"my_bus"))
        .map(|line| (line.time_ns, line.frame, line.direction.expect("a way")))
        .collect();
    assert_eq!(read, expected);
    assert_eq!(read.len(), 3 + 4, "three sent; three heartbeats and an answer");
}

/// A writer that fails.
struct Broken;

impl std::io::Write for Broken {
    fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
        Err(std::io::ErrorKind::StorageFull.into())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn recorder_with_failing_writer_returns_error() {
    let hub = Hub::new();
    let mut bus = Recorder::new(hub.port(), Broken, "loop", Fraction::Microseconds);
    bus.send(&frame(1, &[])).unwrap();
    let error = bus.flush().expect_err("full");
    assert!(matches!(error, BusError::Record(_)) && error.to_string().lines().count() == 1);
}

#[test]
fn open_by_name_returns_bus_or_remedy() {
    let hub = Hub::new();
    let mut by_name = "loop".parse::<BusName>().unwrap().open(&hub, Options::default()).unwrap();
    by_name.send(&frame(1, &[9])).unwrap();
    let mut other = hub.port();
    assert_eq!(other.receive(0).unwrap().map(|arrived| arrived.frame), Some(frame(1, &[9])));

    for (name, advice) in [
        ("vcan99", "ip link add dev vcan99 type vcan"),
        ("can99", "ip link"),
        ("lo", "not a CAN interface"),
        ("slcan:/dev/no-such-device", "check that it is connected"),
        ("slcan:/etc/passwd", "neither a serial device nor a socket"),
        ("slcan:/dev/null", "not a serial device"),
        ("slcan:127.0.0.1:1", "refused"),
    ] {
        let bus: BusName = name.parse().unwrap();
        let Err(error) = bus.open(&hub, Options::default()) else {
            panic!("{name} is no bus here")
        };
        let text = error.to_string();
        assert!(matches!(error, BusError::Open { .. }), "{text}");
        assert!(text.starts_with(&format!("bus {name}: ")) && text.lines().count() == 1, "{text}");
        // A kernel without CAN reports that for every interface.
        assert!(text.contains(advice) || text.contains("no CAN; modprobe"), "{text}");
    }
}
