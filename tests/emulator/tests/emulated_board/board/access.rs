//! The image's access challenges: they follow the chip's random numbers.

use super::bus::exchange;
use super::start::{Constant, started_with};
use emulated_board::Machine;
use emulated_board::chip::random::Random;
use firmware::access::Key;

const CHALLENGE: [u8; 8] = [0x40, 0x41, 0x20, 2, 0, 0, 0, 0];
const RESPONSE: [u8; 8] = [0x21, 0x41, 0x20, 3, 8, 0, 0, 0];
const SERIAL: [u8; 8] = [0x40, 0x18, 0x10, 4, 0, 0, 0, 0];
const MILLISECONDS: u64 = 3;

fn request(machine: &mut Machine<Constant>, request: &[u8; 8]) -> [u8; 8] {
    let sent = exchange(machine, 0x601, request, MILLISECONDS);
    let answer = sent.iter().find(|frame| frame.identifier() == 0x581).expect("an answer");
    answer.data().try_into().expect("eight bytes")
}

/// Reads a challenge in segments.
fn challenge(machine: &mut Machine<Constant>) -> [u8; 8] {
    request(machine, &CHALLENGE);
    let [_, first @ ..] = request(machine, &[0x60, 0, 0, 0, 0, 0, 0, 0]);
    let [_, last, ..] = request(machine, &[0x70, 0, 0, 0, 0, 0, 0, 0]);
    std::array::from_fn(|at| first.get(at).copied().unwrap_or(last))
}

/// Starts the image with random numbers of this seed, and reads a challenge.
fn first_challenge(seed: u32) -> [u8; 8] {
    let mut machine = started_with(Random::with_seed(seed));
    machine.run(emulated_board::chip::CORE_HZ / 10);
    challenge(&mut machine)
}

/// Unlocks the service level with the default key.
pub fn unlock(machine: &mut Machine<Constant>) {
    let [.., a, b, c, d] = request(machine, &SERIAL);
    let serial = u32::from_le_bytes([a, b, c, d]);
    let [r0, r1, r2, r3, r4, r5, r6, r7] = Key::DEFAULT.response(challenge(machine), serial, 1);
    request(machine, &RESPONSE);
    request(machine, &[0x00, r0, r1, r2, r3, r4, r5, r6]);
    assert_eq!(request(machine, &[0x1D, r7, 0, 0, 0, 0, 0, 0])[0], 0x30, "the last segment");
}

#[test]
fn challenge_of_the_image_follows_the_random_numbers_of_the_chip() {
    let first = first_challenge(1);
    assert_eq!(first, first_challenge(1), "all else is equal");
    assert_ne!(first, first_challenge(2));
    // With an error of the generator, the key replaces its numbers.
    let without = first_challenge(0);
    assert_ne!(without, first);
    assert_ne!(without, [0; 8]);
}
