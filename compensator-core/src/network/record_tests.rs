use super::super::lstm_network::reference;
use super::*;
use proptest::prelude::*;

#[test]
fn parse_of_emitted_network_returns_same_network() {
    let mut network = reference::joint();
    assert_eq!(emit(Some(&network)).len(), LENGTH);
    assert_eq!(parse(&emit(Some(&network))), Ok(Some(network.clone())));
    network.strokes = None;
    assert_eq!(parse(&emit(Some(&network))), Ok(Some(network)));
    assert_eq!(emit(None).len(), EMPTY_LENGTH);
    assert_eq!(parse(&emit(None)), Ok(None));
}

#[test]
fn emit_writes_documented_layout() {
    let record = emit(Some(&reference::joint()));
    let number = |at: usize| f32::from_le_bytes(record[at..at + 4].try_into().unwrap());
    assert_eq!(&record[..4], b"FNET");
    assert_eq!(usize::from(u16::from_le_bytes([record[6], record[7]])), LENGTH);
    assert_eq!(record[8..16], [3, 8, 1, 0, 7, 0, 0xFE, 0xFF]);
    assert_eq!([number(16), number(20), number(24)], [1.0 / 128.0, 0.5, 0.03125]);
    assert_eq!([number(28), number(36), number(40)], [0.01, 5e-4, 0.2]);
    assert_eq!([number(64), number(68)], [1.0, 0.5]);
    let first = reference::network::<f32>().lstm.cells[0].bias[0];
    assert_eq!(number(96), first);
    assert_eq!(LENGTH, 96 + 4 * 443 + 4);
}

#[test]
fn parse_with_damaged_or_foreign_record_returns_error() {
    let network = reference::joint();
    let sealed = |change: &dyn Fn(&mut [u8])| {
        let mut record = emit(Some(&network));
        change(&mut record);
        let crc = crc32(&record[..LENGTH - 4]);
        record[LENGTH - 4..].copy_from_slice(&crc.to_le_bytes());
        parse(&record).unwrap_err()
    };
    assert_eq!(sealed(&|record| record[0] = b'X'), RecordError::Magic);
    assert_eq!(sealed(&|record| record[4] = 9), RecordError::Version(9));
    assert_eq!(sealed(&|record| record[8] = 5), RecordError::Size(5));
    assert_eq!(sealed(&|record| record[9] = 7), RecordError::Size(7));
    assert_eq!(sealed(&|record| record[10] = 3), RecordError::UnknownChoices(3));
    assert_eq!(sealed(&|record| record[12] = 99), RecordError::UnknownFeed(99));
    match sealed(&|record| record[20..24].copy_from_slice(&f32::NAN.to_le_bytes())) {
        RecordError::Refused(error) => assert_eq!(error.field, "network_slew"),
        other => panic!("{other:?}"),
    }
    let record = emit(Some(&network));
    assert_eq!(parse(&record[..LENGTH - 1]), Err(RecordError::Length(LENGTH - 1)));
    assert_eq!(parse(&[]), Err(RecordError::Length(0)));
    // Under Miri a record takes 0.4 s, so only a few bits are tested there.
    for bit in (0..LENGTH * 8).step_by(if cfg!(miri) { 4999 } else { 7 }) {
        let mut damaged = record.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert!(parse(&damaged).is_err(), "bit {bit}");
    }
}

proptest! {
    #[test]
    fn parse_of_random_bytes_with_valid_crc_never_panics(mut bytes in proptest::collection::vec(any::<u8>(), LENGTH)) {
        bytes[..4].copy_from_slice(&MAGIC);
        bytes[4..6].copy_from_slice(&VERSION.to_le_bytes());
        bytes[6..8].copy_from_slice(&(LENGTH as u16).to_le_bytes());
        bytes[8] %= 6;
        bytes[9] = 8;
        bytes[10] %= 3;
        let crc = crc32(&bytes[..LENGTH - 4]);
        bytes[LENGTH - 4..].copy_from_slice(&crc.to_le_bytes());
        if let Ok(Some(network)) = parse(&bytes) {
            prop_assert!(network.validate().is_ok());
        }
    }
}
