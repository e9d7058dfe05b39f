//! The image's access challenges: they follow the chip's random numbers.

use super::bus::exchange;
use super::start::started_with;
use emulated_board::chip::random::Random;

const CHALLENGE: [u8; 8] = [0x40, 0x41, 0x20, 2, 0, 0, 0, 0];
const MILLISECONDS: u64 = 3;

/// Starts the image with random numbers of this seed, and reads a challenge in segments.
fn challenge(seed: u32) -> Vec<u8> {
    let mut machine = started_with(Random::with_seed(seed));
    machine.run(emulated_board::chip::CORE_HZ / 10);
    let mut value = Vec::new();
    for request in [CHALLENGE, [0x60, 0, 0, 0, 0, 0, 0, 0], [0x70, 0, 0, 0, 0, 0, 0, 0]] {
        let sent = exchange(&mut machine, 0x601, &request, MILLISECONDS);
        let answer = sent.iter().find(|frame| frame.identifier() == 0x581).expect("an answer");
        value.extend_from_slice(&answer.data()[1..]);
    }
    // The first answer has the length, the last one a byte.
    value.drain(..7);
    value.truncate(8);
    value
}

#[test]
fn challenge_of_the_image_follows_the_random_numbers_of_the_chip() {
    let first = challenge(1);
    assert_eq!(first, challenge(1), "all else is equal");
    assert_ne!(first, challenge(2));
    // With an error of the generator, the key replaces its numbers.
    let without = challenge(0);
    assert_ne!(without, first);
    assert_ne!(without, [0; 8]);
}
