//! Tests of the access levels: what a locked joint refuses, how it is unlocked, and when it locks itself.

use super::STATE_REFUSED;
use super::bench::{Bench, Flash, LOCKED, NODE, frame};
use firmware::access::{Key, Level, SESSION_US};
use firmware::driver::Boot;
use firmware::joint_node::{Equipment, Joint};
use firmware::node::dictionary::{self, Access, OBJECTS, SAVE_SIGNATURE, index};
use firmware::node::lss::{LSS_ANSWER, LSS_REQUEST};
use firmware::node_settings::InputSource;

const OUT_OF_RANGE: u32 = 0x0609_0030;
const LEVEL: u8 = 1;
const CHALLENGE: u8 = 2;
const RESPONSE: u8 = 3;
const LOCK: u8 = 4;
const NEW_KEY: u8 = 5;
const WRONG_RESPONSES: u8 = 7;
const NEW_POLICY: u8 = 8;

const SECRET_KEY: Key = Key::new(*b"sixteen bytes !!");

/// Objects of the service level: index, first and last sub-index.
const SERVICE: &[(u16, u8, u8)] = &[
    (0x1010, 1, 1),
    (0x1011, 1, 1),
    (0x2001, 1, 1),
    (0x2001, 6, 9),
    (0x1F50, 1, 1),
    (0x1F51, 1, 1),
    (0x200A, 3, 3),
    (0x200C, 1, 3),
    (0x200C, 17, 17),
    (0x2024, 1, 27),
    (0x2025, 1, 23),
    (0x2026, 1, 6),
    (0x2027, 6, 6),
    (0x2029, 1, 29),
    (0x2030, 1, 5),
    (0x2030, 7, 11),
    (0x2041, 5, 5),
    (0x2041, 8, 8),
    (0x2042, 1, 2),
    (0x2043, 1, 7),
    (0x2044, 1, 5),
    (0x6007, 0, 0),
    (0x605A, 0, 0),
    (0x605B, 0, 0),
    (0x605C, 0, 0),
    (0x605D, 0, 0),
    (0x605E, 0, 0),
    (0x6065, 0, 0),
    (0x6066, 0, 0),
    (0x607D, 1, 2),
    (0x6085, 0, 0),
    (0x60FB, 1, 1),
];

/// Writable objects that every node of the bus may write: first and last index.
const OPEN: &[(u16, u16)] = &[
    // Errors, SYNC, heartbeats.
    (0x1003, 0x1007),
    (0x1016, 0x1019),
    // Process data.
    (0x1400, 0x1405),
    (0x1600, 0x1605),
    (0x1800, 0x1805),
    (0x1A00, 0x1A05),
    // Trace, operation (:2 to :5), state, inputs.
    (0x2000, 0x2004),
    // Scope.
    (0x2013, 0x2014),
    // Friction model, its envelope and the compensator; commit and discard.
    (0x2020, 0x2023),
    (0x2027, 0x2027),
    // Homing.
    (0x2031, 0x2031),
    // Response and lock.
    (0x2041, 0x2041),
    // Control, mode, reached position.
    (0x6040, 0x6040),
    (0x6060, 0x6060),
    (0x6067, 0x6068),
    // Windows of mode 3.
    (0x606D, 0x6070),
    // Targets and limits below those of the parameters.
    (0x6071, 0x6072),
    (0x607A, 0x607C),
    (0x607F, 0x6084),
    // Profiles of velocity and torque.
    (0x6086, 0x6088),
    // Homing, offsets of the targets, and interpolation.
    (0x6098, 0x609A),
    (0x60B1, 0x60B2),
    // Touch probe.
    (0x60B8, 0x60B8),
    (0x60C2, 0x60C2),
    (0x60FF, 0x60FF),
];

fn is_writable(access: Access) -> bool {
    matches!(access, Access::ReadWrite | Access::WriteOnly | Access::Input)
}

fn is_service(at_index: u16, sub_index: u8) -> bool {
    SERVICE.iter().any(|(of, first, last)| *of == at_index && (*first..=*last).contains(&sub_index))
}

fn entries() -> impl Iterator<Item = (u16, u8, dictionary::Entry)> {
    OBJECTS.iter().flat_map(|object| {
        let subs = 0..=object.highest_sub_index();
        subs.map(|sub| (object.index, sub, object.entry(sub).expect("within its last")))
    })
}

/// Starts a locked joint that the bench does not unlock.
fn locked() -> Bench {
    let mut bench = Bench::on_sensors();
    bench.key = None;
    bench.sent();
    bench
}

fn unlocked() -> Bench {
    let mut bench = locked();
    bench.unlock(&Key::DEFAULT).expect("the default key");
    bench
}

fn save(bench: &mut Bench) -> Result<(), u32> {
    bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes())
}

/// Restarts with what is stored.
fn restarted(bench: Bench) -> Bench {
    let flash: Flash = bench.driver.joint.into_flash();
    let mut bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
    bench.key = None;
    bench.sent();
    bench
}

/// A new object is in neither list, so that its level must be decided.
#[test]
fn every_writable_object_has_a_decided_level() {
    let mut open_entries = 0;
    for (at_index, sub_index, entry) in entries() {
        let is_open = OPEN.iter().any(|(first, last)| (*first..=*last).contains(&at_index));
        if !is_writable(entry.access) {
            assert!(!is_service(at_index, sub_index), "{at_index:04X}h:{sub_index} is not written");
            continue;
        }
        let decided = is_service(at_index, sub_index);
        assert!(decided || is_open, "{at_index:04X}h:{sub_index}: decide its level");
        // A new parameter of the friction model is open as the others are.
        let is_of_model = (index::MODEL..=index::PARAMETERS).contains(&at_index);
        open_entries += u32::from(!decided && !is_of_model);
        let level = if decided { Level::Service } else { Level::Open };
        let entry = dictionary::find(at_index, sub_index).expect("an entry");
        assert_eq!(entry.level, level, "{at_index:04X}h:{sub_index}");
    }
    assert_eq!(open_entries, 229, "a new entry of an open object is open: is that right?");
    for (at_index, first, last) in SERVICE {
        for sub_index in *first..=*last {
            let entry = dictionary::find(*at_index, sub_index).expect("an object");
            assert!(is_writable(entry.access), "{at_index:04X}h:{sub_index}");
        }
    }
}

/// Indices that the page names: `2024h`, and all of `605Ah to 605Eh`.
fn indices_named_in(page: &str) -> Vec<u16> {
    let words: Vec<&str> = page.split(|letter: char| !letter.is_ascii_alphanumeric()).collect();
    let index = |word: &str| {
        word.strip_suffix('h')
            .filter(|digits| digits.len() == 4)
            .and_then(|digits| u16::from_str_radix(digits, 16).ok())
    };
    let mut named: Vec<u16> = words.iter().filter_map(|word| index(word)).collect();
    for range in words.windows(3).filter(|range| range[1] == "to") {
        if let (Some(first), Some(last)) = (index(range[0]), index(range[2])) {
            named.extend(first..=last);
        }
    }
    named
}

#[test]
fn security_page_names_every_object_of_the_service_level_and_no_open_one() {
    let page = include_str!("../../../../docs/src/explanation/bus-security.md");
    let table = page.split("| objects of the service level |").nth(1).expect("its table");
    let table = &table[..table.find("\n\n").expect("the end of the table")];
    let named = indices_named_in(table);
    for (at_index, ..) in SERVICE {
        assert!(named.contains(at_index), "{at_index:04X}h is not named");
    }
    for at_index in named {
        let object = OBJECTS.iter().find(|object| object.index == at_index);
        // 2027h:6 is a record of service objects; ranges name some numbers without an object.
        let is_open = object.is_some() && !SERVICE.iter().any(|(of, ..)| *of == at_index);
        assert!(!is_open, "{at_index:04X}h is open");
    }
}

/// Excluded: write an object of the service level.
#[test]
fn locked_joint_refuses_every_service_object_and_no_other() {
    let mut bench = locked();
    for (at_index, sub_index, entry) in entries().filter(|(.., entry)| is_writable(entry.access)) {
        let value = vec![0; entry.data.length().unwrap_or(8)];
        let refused = bench.write(at_index, sub_index, &value) == Err(LOCKED);
        assert_eq!(refused, is_service(at_index, sub_index), "{at_index:04X}h:{sub_index}");
        if refused {
            bench.check_refusal("locked joint", &[]);
        }
    }
}

/// Excluded: write one in segments or in blocks.
#[test]
fn begin_of_a_block_or_segmented_download_to_a_locked_joint_is_refused() {
    let mut bench = locked();
    // 2027h:6, in blocks and in segments.
    for request in [[0xC2, 0x27, 0x20, 6, 0, 1, 0, 0], [0x21, 0x27, 0x20, 6, 0, 1, 0, 0]] {
        bench.driver.receive(&frame(0x601, &request), bench.now_us);
        let abort = frame(0x581, &[0x80, 0x27, 0x20, 6, 0, 0, 1, 6]);
        assert_eq!(bench.sent(), [abort]);
    }
}

/// Excluded: write one by process data.
#[test]
fn process_data_cannot_write_an_object_of_the_service_level() {
    for (at_index, sub_index, _) in entries() {
        let is_mappable = dictionary::is_received(at_index, sub_index);
        assert!(!(is_mappable && is_service(at_index, sub_index)), "{at_index:04X}h:{sub_index}");
    }
    let mut bench = unlocked();
    bench.write(0x1400, 1, &0x8000_0201u32.to_le_bytes()).unwrap();
    bench.write(0x1600, 0, &[0]).unwrap();
    // The larger position limit.
    let mapped = bench.write(0x1600, 1, &0x607D_0220u32.to_le_bytes());
    assert_eq!(mapped, Err(0x0604_0041));
}

#[test]
fn right_response_unlocks_until_the_lock() {
    let mut bench = locked();
    assert_eq!(bench.number(index::ACCESS, LEVEL), 0);
    bench.unlock(&Key::DEFAULT).unwrap();
    assert_eq!(bench.number(index::ACCESS, LEVEL), 1);
    bench.write(index::FOLLOWING_TIME, 0, &[5, 0]).unwrap();
    bench.write(index::ACCESS, LOCK, &[1]).unwrap();
    assert_eq!(bench.number(index::ACCESS, LEVEL), 0);
    assert_eq!(bench.write(index::FOLLOWING_TIME, 0, &[6, 0]), Err(LOCKED));
    assert_eq!(bench.number(index::FOLLOWING_TIME, 0), 5);
}

/// Excluded: use a recorded response.
#[test]
fn response_is_valid_once_and_for_the_last_challenge_only() {
    let mut bench = locked();
    let (first, second) = (bench.response(&Key::DEFAULT), bench.response(&Key::DEFAULT));
    assert_ne!(first, second, "every challenge is another one");
    assert_eq!(bench.write(index::ACCESS, RESPONSE, &first), Err(OUT_OF_RANGE));
    bench.pass_ms(1000);
    // The wrong response has used the challenge.
    assert_eq!(bench.write(index::ACCESS, RESPONSE, &second), Err(OUT_OF_RANGE));
    bench.pass_ms(2000);
    let third = bench.response(&Key::DEFAULT);
    bench.write(index::ACCESS, RESPONSE, &third).unwrap();
    bench.write(index::ACCESS, LOCK, &[1]).unwrap();
    assert_eq!(bench.write(index::ACCESS, RESPONSE, &third), Err(OUT_OF_RANGE), "a replay");
    assert_eq!(bench.number(index::ACCESS, LEVEL), 0);
}

/// Excluded: try responses quickly.
#[test]
fn wrong_response_delays_the_right_one() {
    let mut bench = locked();
    assert_eq!(bench.write(index::ACCESS, RESPONSE, &[0; 8]), Err(OUT_OF_RANGE));
    assert_eq!(bench.unlock(&Key::DEFAULT), Err(STATE_REFUSED));
    assert_eq!(bench.number(index::ACCESS, WRONG_RESPONSES), 1);
    bench.pass_ms(1000);
    assert_eq!(bench.write(index::ACCESS, RESPONSE, &[0; 8]), Err(OUT_OF_RANGE));
    bench.pass_ms(1999);
    assert_eq!(bench.unlock(&Key::DEFAULT), Err(STATE_REFUSED));
    bench.pass_ms(1);
    bench.unlock(&Key::DEFAULT).unwrap();
    assert_eq!(bench.number(index::ACCESS, WRONG_RESPONSES), 0);
}

#[test]
fn response_of_a_wrong_length_is_refused_without_a_delay() {
    let mut bench = locked();
    assert_eq!(bench.write(index::ACCESS, RESPONSE, &[0; 7]), Err(0x0607_0013));
    assert_eq!(bench.write(index::ACCESS, RESPONSE, &[0; 9]), Err(0x0607_0012));
    bench.unlock(&Key::DEFAULT).unwrap();
    for (place, length) in [(NEW_KEY, 24), (NEW_POLICY, 9)] {
        assert_eq!(bench.write(index::ACCESS, place, &vec![0; length - 1]), Err(0x0607_0013));
        assert_eq!(bench.write(index::ACCESS, place, &vec![0; length + 1]), Err(0x0607_0012));
    }
}

/// Excluded: use a session after its ten minutes, or extend it.
#[test]
fn session_ends_ten_minutes_after_the_unlock_whatever_is_written() {
    let mut bench = unlocked();
    let minute_ms = 60_000;
    assert_eq!(SESSION_US, 10 * minute_ms * 1000);
    for minute in 0..9u8 {
        bench.pass_ms(minute_ms);
        bench.sent();
        bench.write(index::FOLLOWING_TIME, 0, &[minute, 0]).unwrap();
    }
    bench.pass_ms(minute_ms);
    bench.sent();
    assert_eq!(bench.number(index::ACCESS, LEVEL), 0);
    assert_eq!(bench.write(index::FOLLOWING_TIME, 0, &[5, 0]), Err(LOCKED));
}

/// Excluded: use a session after a reset.
#[test]
fn reset_of_node_or_communication_locks_the_joint() {
    let mut bench = restarted(unlocked());
    assert_eq!(bench.number(index::ACCESS, LEVEL), 0);
    bench.unlock(&Key::DEFAULT).unwrap();
    bench.driver.receive(&frame(0, &[0x82, NODE.number()]), bench.now_us);
    bench.sent();
    assert_eq!(bench.number(index::ACCESS, LEVEL), 0);
}

/// Excluded: commit what a tool has staged and left.
#[test]
fn lock_discards_what_was_staged_at_service_level() {
    let mut bench = unlocked();
    // motor.current_limit_a: an open commit must not use it later.
    bench.write(index::MOTOR, 1, &8f32.to_le_bytes()).unwrap();
    assert_ne!(bench.number(index::COMMIT, 1), bench.number(index::COMMIT, 2));
    bench.write(index::ACCESS, LOCK, &[1]).unwrap();
    assert_eq!(bench.number(index::COMMIT, 1), bench.number(index::COMMIT, 2));
}

#[test]
fn new_key_replaces_the_default_and_is_stored_with_a_save() {
    let mut bench = unlocked();
    bench.write_proven(NEW_KEY, &SECRET_KEY.bytes(), &Key::DEFAULT).unwrap();
    assert_eq!(bench.read(index::ACCESS, NEW_KEY), Err(0x0601_0001), "a key is not read");
    save(&mut bench).unwrap();
    let mut bench = restarted(bench);
    assert_eq!(bench.unlock(&Key::DEFAULT), Err(OUT_OF_RANGE));
    bench.pass_ms(1000);
    bench.unlock(&SECRET_KEY).unwrap();
    bench.write_proven(NEW_KEY, &Key::DEFAULT.bytes(), &SECRET_KEY).unwrap();
    save(&mut bench).unwrap();
    restarted(bench).unlock(&Key::DEFAULT).unwrap();
}

/// Excluded: keep a session that another node began, by a new key or an open policy.
#[test]
fn new_key_or_policy_without_the_proof_of_the_present_key_is_refused() {
    for (place, change) in [(NEW_KEY, &[7; 16][..]), (NEW_POLICY, &[0])] {
        let other_change: Vec<u8> = change.iter().map(|byte| byte ^ 1).collect();
        // Of no value, of another one, and of this one with another key.
        for (key, proven) in
            [(Key::DEFAULT, &[][..]), (Key::DEFAULT, &other_change), (SECRET_KEY, change)]
        {
            let mut bench = unlocked();
            let proof = bench.proof(&key, proven);
            let written = bench.write(index::ACCESS, place, &[change, &proof].concat());
            assert_eq!(written, Err(OUT_OF_RANGE), "{place}");
            assert_eq!(bench.number(index::ACCESS, WRONG_RESPONSES), 1);
            save(&mut bench).unwrap();
            let mut bench = restarted(bench);
            assert_eq!(bench.number(index::ACCESS, LEVEL), 0);
            bench.unlock(&Key::DEFAULT).expect("the key is the same");
        }
        // A proof is valid once.
        let mut bench = unlocked();
        let proof = bench.proof(&Key::DEFAULT, change);
        let value = [change, &proof].concat();
        bench.write(index::ACCESS, place, &value).unwrap();
        assert_eq!(bench.write(index::ACCESS, place, &value), Err(OUT_OF_RANGE));
    }
}

/// Excluded: restore the default key with the defaults.
#[test]
fn restored_defaults_keep_key_and_policy() {
    let mut bench = unlocked();
    bench.write_proven(NEW_KEY, &SECRET_KEY.bytes(), &Key::DEFAULT).unwrap();
    bench.write(index::FOLLOWING_TIME, 0, &[5, 0]).unwrap();
    save(&mut bench).unwrap();
    bench.write(index::RESTORE, 1, b"load").unwrap();
    let mut bench = restarted(bench);
    assert_ne!(bench.number(index::FOLLOWING_TIME, 0), 5);
    assert_eq!(bench.number(index::ACCESS, LEVEL), 0);
    bench.unlock(&SECRET_KEY).expect("the key is the same");
}

#[test]
fn joint_without_a_lock_by_default_accepts_a_master_that_cannot_unlock() {
    let mut bench = unlocked();
    bench.write_proven(NEW_POLICY, &[0], &Key::DEFAULT).unwrap();
    save(&mut bench).unwrap();
    let mut bench = restarted(bench);
    assert_eq!(bench.number(index::ACCESS, LEVEL), 1);
    bench.write(index::FOLLOWING_TIME, 0, &[5, 0]).unwrap();
    // motor.current_limit_a, staged while every node may write it: an open commit must not use it later.
    bench.write(index::MOTOR, 1, &8f32.to_le_bytes()).unwrap();
    bench.write_proven(NEW_POLICY, &[1], &Key::DEFAULT).unwrap();
    assert_eq!(bench.write(index::FOLLOWING_TIME, 0, &[6, 0]), Err(LOCKED));
    assert_eq!(bench.number(index::COMMIT, 1), bench.number(index::COMMIT, 2));
}

/// Sends an LSS request to the one joint of the bus, and returns the error code of its answer.
fn configure(bench: &mut Bench, request: [u8; 8]) -> u8 {
    bench.driver.receive(&frame(LSS_REQUEST, &[4, 1, 0, 0, 0, 0, 0, 0]), bench.now_us);
    bench.driver.receive(&frame(LSS_REQUEST, &request), bench.now_us);
    let answers = bench.sent();
    let answer = answers.iter().find(|sent| sent.identifier() == LSS_ANSWER).expect("an answer");
    assert_eq!(answer.data()[0], request[0]);
    answer.data()[1]
}

/// Excluded: change number or bit rate by LSS.
#[test]
fn lss_changes_number_and_bit_rate_of_a_numbered_joint_only_at_service_level() {
    let requests =
        [[0x11, 9, 0, 0, 0, 0, 0, 0], [0x13, 0, 2, 0, 0, 0, 0, 0], [0x17, 0, 0, 0, 0, 0, 0, 0]];
    let mut bench = unlocked();
    save(&mut bench).unwrap();
    let mut bench = restarted(bench);
    for request in requests {
        assert_eq!(configure(&mut bench, request), 255, "{request:?}");
    }
    assert_eq!(bench.number(index::OPERATION, 6), 1);
    bench.unlock(&Key::DEFAULT).unwrap();
    for request in requests {
        assert_eq!(configure(&mut bench, request), 0, "{request:?}");
    }
    // A joint from the shelf has no number yet.
    assert_eq!(configure(&mut Bench::blank(7), requests[0]), 0);
}

#[test]
fn challenges_do_not_repeat_and_are_no_process_data() {
    let mut bench = locked();
    let mut seen: Vec<Vec<u8>> =
        (0..1000).map(|_| bench.read(index::ACCESS, CHALLENGE).unwrap()).collect();
    seen.sort();
    seen.dedup();
    assert_eq!(seen.len(), 1000);
    assert!(!dictionary::is_transmitted(index::ACCESS, CHALLENGE));
}

#[test]
fn seed_of_the_board_changes_the_challenges_of_the_next_start() {
    let challenge = |seed: Option<[u8; 16]>| {
        let mut bench = locked();
        if let Some(seed) = seed {
            bench.driver.joint.equip(Equipment { seed: Some(seed), ..Equipment::default() });
        }
        bench.read(index::ACCESS, CHALLENGE).unwrap()
    };
    assert_ne!(challenge(Some([1; 16])), challenge(Some([2; 16])));
    assert_ne!(challenge(Some([1; 16])), challenge(None));
}
