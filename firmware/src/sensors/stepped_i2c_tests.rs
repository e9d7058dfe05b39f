//! Tests of the stepped bus with a simulated controller and devices.

use super::*;

/// A device with an address, whose answer counts up from its last command.
#[derive(Default)]
struct Simulated {
    present: Vec<u8>,
    /// A device holds the clock.
    is_held: bool,
    events: Events,
    address: u8,
    to_send: u8,
    to_receive: u8,
    stops: bool,
    commands: Vec<(u8, u8)>,
    next: u8,
    accesses: usize,
    starts: usize,
    lines: Released,
    is_manual: bool,
    resets: usize,
}

/// Lines that no device holds.
#[derive(Default)]
struct Released;

impl BusWires for Released {
    fn clock(&mut self, _: bool) {}

    fn data(&mut self, _: bool) {}

    fn clock_is_high(&mut self) -> bool {
        true
    }

    fn data_is_high(&mut self) -> bool {
        true
    }
}

impl Controller for Simulated {
    type Wires = Released;

    fn events(&mut self) -> Events {
        if self.is_held { Events::default() } else { self.events }
    }

    fn start(&mut self, address: u8, count: u8, segment: Segment) {
        assert!(!self.is_manual, "the lines are under manual control");
        self.starts += 1;
        self.accesses += 1;
        let reads = segment == Segment::Read;
        (self.address, self.stops) = (address, segment != Segment::WriteBeforeRead);
        let is_present = self.present.contains(&address);
        self.events = Events {
            not_acknowledged: !is_present,
            has_stopped: !is_present,
            can_send: is_present && !reads,
            has_byte: is_present && reads,
            ..Events::default()
        };
        if reads { self.to_receive = count } else { self.to_send = count }
    }

    fn send(&mut self, byte: u8) {
        self.accesses += 1;
        self.commands.push((self.address, byte));
        self.next = byte;
        self.to_send -= 1;
        let is_last = self.to_send == 0;
        self.events = Events {
            can_send: !is_last,
            is_complete: is_last && !self.stops,
            has_stopped: is_last && self.stops,
            ..Events::default()
        };
    }

    fn receive(&mut self) -> u8 {
        self.accesses += 1;
        self.next = self.next.wrapping_add(1);
        self.to_receive -= 1;
        self.events.has_byte = self.to_receive > 0;
        self.next
    }

    fn reset(&mut self) {
        self.resets += 1;
        self.events = Events::default();
    }

    fn control_lines(&mut self, manually: bool) {
        self.is_manual = manually;
    }

    fn wires(&mut self) -> &mut Released {
        &mut self.lines
    }
}

fn bus(present: &[u8]) -> SteppedI2c<Simulated> {
    SteppedI2c::new(Simulated { present: present.to_vec(), ..Simulated::default() })
}

/// Repeats a call once a step until it has a result; returns it with the number of steps.
fn finish<R>(
    bus: &mut SteppedI2c<Simulated>,
    mut call: impl FnMut(&mut SteppedI2c<Simulated>) -> Result<R, BusFault>,
) -> (Result<R, BusFault>, usize) {
    for steps in 0..100 {
        let before = bus.controller.accesses;
        bus.step();
        let result = call(bus);
        assert!(bus.controller.accesses <= before + 1, "one access of the bus a step");
        if result.as_ref().err() != Some(&BusFault::Pending) {
            return (result, steps);
        }
    }
    panic!("no result within 100 steps");
}

#[test]
fn transfer_in_steps_sends_command_and_returns_answer() {
    let mut bus = bus(&[0x76]);
    let (found, steps) = finish(&mut bus, |bus| {
        let mut into = [0; 3];
        bus.write_read(0x76, &[0xA0], &mut into).map(|()| into)
    });
    assert_eq!(
        (found, bus.controller.commands.as_slice()),
        (Ok([0xA1, 0xA2, 0xA3]), &[(0x76, 0xA0)][..])
    );
    // Command, read, three bytes.
    assert_eq!(steps, 5);
    let (found, _) = finish(&mut bus, |bus| bus.write(0x76, &[1, 2]));
    assert_eq!(found, Ok(()));
    assert_eq!(bus.controller.commands[1..], [(0x76, 1), (0x76, 2)]);
}

#[test]
fn transfer_to_absent_device_fails_at_the_next_step() {
    let mut bus = bus(&[0x77]);
    assert_eq!(finish(&mut bus, |bus| bus.write(0x76, &[1])), (Err(BusFault::NotAcknowledged), 1));
    assert_eq!(bus.controller.resets, 1);
}

#[test]
fn transfers_of_two_drivers_follow_each_other() {
    let mut bus = bus(&[0x76, 0x77]);
    let (mut found, mut into) = ([None; 2], [[0; 2]; 2]);
    for _ in 0..30 {
        bus.step();
        for (place, address) in [0x76, 0x77].into_iter().enumerate() {
            if found[place].is_none() {
                let result = bus.write_read(address, &[address], &mut into[place]);
                found[place] = Some(result).filter(|result| *result != Err(BusFault::Pending));
            }
        }
    }
    assert_eq!(found, [Some(Ok(())); 2]);
    assert_eq!(into, [[0x77, 0x78], [0x78, 0x79]]);
}

#[test]
fn result_that_its_driver_does_not_fetch_blocks_no_other() {
    let mut bus = bus(&[0x76, 0x77]);
    assert_eq!(bus.write(0x77, &[1]), Err(BusFault::Pending));
    assert_eq!(finish(&mut bus, |bus| bus.write(0x76, &[1])).0, Ok(()));
}

#[test]
fn held_clock_ends_in_timeout_and_recovery_delays_the_next_transfer() {
    let mut bus = bus(&[0x76]);
    bus.controller.is_held = true;
    let (found, steps) = finish(&mut bus, |bus| bus.write(0x76, &[1]));
    assert_eq!(found, Err(BusFault::Timeout));
    assert!(steps <= 25, "{steps}");
    bus.controller.is_held = false;
    bus.recover();
    assert!(bus.controller.is_manual);
    let starts = bus.controller.starts;
    let (found, steps) = finish(&mut bus, |bus| bus.write(0x76, &[1]));
    assert_eq!((found, bus.controller.starts), (Ok(()), starts + 1));
    assert!((6..12).contains(&steps), "{steps}");
}

#[test]
fn transfer_that_is_too_long_is_refused() {
    let mut bus = bus(&[0x76]);
    assert_eq!(bus.write(0x76, &[0; 3]), Err(BusFault::Unsupported));
    assert_eq!(bus.write_read(0x76, &[0], &mut [0; 27]), Err(BusFault::Unsupported));
    assert_eq!(bus.controller.starts, 0);
}
