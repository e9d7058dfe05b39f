use super::*;

fn ns(text: &str) -> Option<i128> {
    parse_stamp(text.as_bytes(), None)
        .unwrap_or_else(|error| panic!("{text}: {error}"))
        .map(Stamp::nanoseconds)
}

#[test]
fn parse_stamp_with_common_dates_returns_nanoseconds() {
    let noon = 1_714_564_800_000_000_000;
    for text in [
        "2024-05-01T12:00:00Z",
        "2024-05-01T14:00:00+02:00",
        "2024-05-01T14:00:00+0200",
        "2024-05-01 14:00:00 +02",
        "2024-05-01 12:00:00",
        "2024-05-01 12:00:00 UTC",
        "2024/05/01 12:00:00.000",
        "\"2024-05-01T12:00:00.000000000\"",
        "2024-05-01 14:00:00 CEST",
        "2024-05-01 14:00:00.0 Europe/Berlin",
        "2024-05-01T14:00:00+02:00[Europe/Berlin]",
        "2024-05-01 12:00:00 PM",
        "2024-05-01 02:00:00.000 PM CEST",
        "01-May-24 12:00:00.000",
        "01-May-2024 12:00:00",
        "1 May 2024, 12:00:00",
        "May 1, 2024 12:00:00 PM",
        "01.05.2024 12:00:00",
        "01.05.24 12:00:00,0",
        "2024-05-01 12:00:00,000",
        "2024-05-01 12:00:00:000",
        "20240501 120000.000",
        "20240501T120000",
        "DT#2024-05-01-12:00:00.000",
        "Wed May  1 12:00:00.000 2024",
        "Wed May  1 12:00:00 UTC 2024",
        "Wed, 01 May 2024 12:00:00 GMT",
    ] {
        assert_eq!(ns(text), Some(noon), "{text}");
    }
    assert_eq!(ns("2024-05-01T12:00:00.123456789Z"), Some(noon + 123_456_789));
    assert_eq!(ns("01.05.2024 12:00:00,015"), Some(noon + 15_000_000));
}

#[test]
fn parse_stamp_with_time_or_duration_returns_nanoseconds() {
    for (text, expected) in [
        ("00:01:00.5", 60_500_000_000),
        ("00:01:00,5", 60_500_000_000),
        ("00:01:00:500", 60_500_000_000),
        ("12:01:00.5 AM", 60_500_000_000),
        ("1:00:00 pm", 13 * HOUR_NS),
        ("TOD#00:01:00.5", 60_500_000_000),
        ("01:00.5", 60_500_000_000),
        ("59:60.0", HOUR_NS),
        ("59:00,5", 3_540_500_000_000),
        ("T#0s15ms", 15_000_000),
        ("T#1m500ms", 60_500_000_000),
        ("LTIME#1s500us", 1_000_500_000),
        ("0 days 00:00:00.015000", 15_000_000),
        ("1 day, 0:00:02", DAY_NS + 2 * SECOND_NS),
        ("100:00:00", 100 * HOUR_NS),
    ] {
        assert_eq!(ns(text), Some(expected), "{text}");
    }
}

#[test]
fn parse_stamp_with_other_text_returns_none() {
    for text in [
        "",
        "noon",
        "12",
        "2024-13-01T12:00:00Z",
        "noon: CST",
        "T#5x",
        "a1:2",
        "3 x 12:00:00",
        "x#1",
        "é:10:00",
    ] {
        assert_eq!(ns(text), None, "{text}");
    }
}

#[test]
fn parse_stamp_with_several_readings_returns_what_is_expected() {
    let error = |text: &str| parse_stamp(text.as_bytes(), None).unwrap_err();
    assert_eq!(error("03/04/2024 09:15:02"), AMBIGUOUS_ORDER);
    assert_eq!(error("03-04-24 09:15:02"), AMBIGUOUS_YEAR);
    assert_eq!(error("09:15"), AMBIGUOUS_MINUTES);
    assert_eq!(error("2024-03-14"), NO_TIME_OF_DAY);
    assert!(error("2024-05-01 12:00:00 CST").contains("several time zones"));
    assert_eq!(ns("03/14/2024 00:00:00"), ns("14/03/2024 00:00:00"));
}

#[test]
fn parse_stamp_with_given_order_returns_date() {
    let of = |order: &str| {
        parse_stamp(b"03/04/05 00:00:00", DateOrder::parse(order)).unwrap().unwrap().nanoseconds()
    };
    assert_eq!(of("dmy"), ns("2005-04-03 00:00:00").unwrap());
    assert_eq!(of("MDY"), ns("2005-03-04 00:00:00").unwrap());
    assert_eq!(of("ymd"), ns("2003-04-05 00:00:00").unwrap());
    assert_eq!(parse_day(b"14.03.2024", None), Ok(ns("2024-03-14 00:00:00")));
    assert_eq!(parse_day(b"03/04/2024", None), Err(AMBIGUOUS_ORDER));
}
