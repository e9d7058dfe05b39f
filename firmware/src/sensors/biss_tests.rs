use super::*;

/// The CRC by its definition, bit by bit.
fn crc_of(value: u64, bits: u32) -> u64 {
    let mut remainder = 0u64;
    for bit in (0..bits).rev() {
        let top = remainder >> 5 & 1 ^ value >> bit & 1;
        remainder = remainder << 1 & 0x3F;
        if top == 1 {
            remainder ^= 0x03;
        }
    }
    remainder
}

/// Words of a frame with these clocks of idle and busy, and flips of its bits.
fn words(idle: u32, busy: u32, covered: u64, bits: u32, flips: u64) -> [u16; WORDS] {
    let crc = crc_of(covered, bits) ^ 0x3F;
    let mut line: Vec<u64> = vec![1; idle as usize];
    line.extend(vec![0; busy as usize]);
    line.extend([1, 0]);
    line.extend((0..bits).rev().map(|bit| covered >> bit & 1));
    line.extend((0..6).rev().map(|bit| crc >> bit & 1));
    line.resize(56, 0);
    let frame = line.iter().take(56).fold(0, |frame, bit| frame << 1 | bit) ^ flips;
    std::array::from_fn(|word| (frame >> (14 * (3 - word)) & 0x3FFF) as u16)
}

#[test]
fn crc_of_a_known_value_matches_its_polynomial() {
    assert_eq!(crc_of(1, 1), 0x03);
    assert_eq!(crc_of(0b100_0011, 7), 0);
    for value in [0, 1, 0x3F, 0xFF_FFFF_FFFF, 0x12_3456_789A, 0xAA_AAAA_AAAA] {
        assert_eq!(u64::from(crc(value << 24, 8)), crc_of(value, 40), "{value:x}");
    }
}

#[test]
fn position_is_the_angle_for_every_width_and_delay() {
    for (bits, turn_bits) in [(18, 0), (19, 12), (26, 12), (32, 8), (10, 0), (24, 16)] {
        let encoder = BissEncoder::new(bits, turn_bits);
        for (idle, busy) in [(1, 1), (2, 1), (2, 3), (3, 2)] {
            let position = 0x1234_5678_9ABC_DEF0u64 >> (64 - bits - turn_bits);
            let covered = position << 2 | 3;
            let angle = ((position << (32 - bits)) & 0xFFFF_FFFF) as u32;
            let read = encoder.evaluate(Some(words(idle, busy, covered, bits + turn_bits + 2, 0)));
            assert_eq!(read, Evaluation::Angle(angle), "{bits} {turn_bits} {idle} {busy}");
        }
    }
}

#[test]
fn error_leaves_no_angle_and_warning_is_reported() {
    let encoder = BissEncoder::new(18, 0);
    let read = |covered| encoder.evaluate(Some(words(2, 1, covered, 20, 0)));
    assert_eq!(read(0x1_0000 << 2 | 3), Evaluation::Angle(0x4000_0000));
    assert_eq!(read(0x1_0000 << 2 | 2), Evaluation::Doubtful(0x4000_0000));
    assert_eq!(read(0x1_0000 << 2 | 1), Evaluation::Missing);
    assert_eq!(read(0x1_0000 << 2), Evaluation::Missing);
}

#[test]
fn every_flip_of_one_or_two_covered_bits_is_found() {
    let encoder = BissEncoder::new(18, 0);
    let flipped = |flips| encoder.evaluate(Some(words(2, 1, 0x2_A5A5 << 2 | 3, 20, flips)));
    // Turns to CRC: behind 2 idle bits, 1 busy bit, start and CDS.
    for one in 25..51 {
        assert_eq!(flipped(1 << one), Evaluation::Missing, "{one}");
        for other in 25..one {
            assert_eq!(flipped(1 << one | 1 << other), Evaluation::Missing, "{one} {other}");
        }
    }
}

#[test]
fn line_that_is_open_low_or_not_exchanged_is_missing() {
    let encoder = BissEncoder::new(18, 0);
    for words in [Some([0x3FFF; WORDS]), Some([0; WORDS]), None] {
        assert_eq!(encoder.evaluate(words), Evaluation::Missing);
    }
    // A frame of an encoder that is busy for too long.
    let late = words(2, 30, 0x2_A5A5 << 2 | 3, 20, 0);
    assert_eq!(encoder.evaluate(Some(late)), Evaluation::Missing);
}

#[test]
fn turns_follow_the_angle_over_the_end_of_a_turn() {
    for (bits, turn_bits) in [(18, 12), (10, 24), (19, 16), (26, 12), (32, 8)] {
        let most = (1u64 << turn_bits) - 1;
        for (turns, position, angle, expected) in [
            (5, 0, 0, 5),
            (5, 0, u32::MAX - 1000, 4),
            (5, (1u64 << bits) - 1, 1000, 6),
            (most, (1u64 << bits) - 1, u32::MAX, most),
        ] {
            let covered = (turns << bits | position) << 2 | 3;
            for (idle, busy) in [(1, 1), (2, 3)] {
                let [a, b, c, _] = words(idle, busy, covered, bits + turn_bits + 2, 0);
                let read = turns_of(&[a, b, c], [bits, turn_bits], angle);
                assert_eq!(read, Some(expected as u16), "{bits} {turn_bits} {turns} {angle}");
            }
        }
    }
}

fn turns_of(words: &[u16; TURN_WORDS], bits: [u32; 2], angle: u32) -> Option<u16> {
    super::turns(*words, bits, angle)
}

#[test]
fn turns_with_another_position_or_without_a_frame_are_none() {
    let [a, b, c, _] = words(2, 1, (7u64 << 18) << 2 | 3, 32, 0);
    assert_eq!(turns_of(&[a, b, c], [18, 12], 0), Some(7));
    assert_eq!(turns_of(&[a, b, c], [18, 12], 1 << 30), None);
    assert_eq!(turns_of(&[a, b, c], [18, 0], 0), None);
    for line in [0, 0x3FFF] {
        assert_eq!(turns_of(&[line; 3], [18, 12], 0), None);
    }
}
