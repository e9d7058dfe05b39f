//! The image's scope: its whole memory at 20 kHz, read over the bus.

use super::board_bus::{new_board, started};
use firmware::scope::Signal;
use joint_bus::bus::Bus;
use joint_bus::scope::{ScopeRequest, ScopeTrigger, capture};
use std::time::Duration;

/// Values of the scope of the STM32G474.
const VALUES: usize = 6144;

#[test]
fn capture_of_the_image_fills_its_memory_without_a_gap() {
    let mut client = started(new_board());
    let all: Vec<Signal> =
        Signal::ALL.iter().map(|(_, name)| Signal::from_name(name).expect("known")).collect();
    for (signals, limit_s) in [(&all[..8], 1.0), (&all[..1], 1.2)] {
        let begin_ns = client.bus().now_ns();
        let request = ScopeRequest {
            signals: signals.to_vec(),
            every: 1,
            trigger: ScopeTrigger::Now,
            before: 0.0,
            timeout: Duration::from_secs(1),
        };
        let found = capture(&mut client, &request, || false).expect("a capture");
        let elapsed_s = (client.bus().now_ns() - begin_ns) as f64 * 1e-9;
        println!(
            "measured: {} signals, {} rows, after {elapsed_s:.2} s",
            signals.len(),
            found.columns[0].len()
        );
        assert_eq!(found.columns.len(), signals.len());
        for (signal, column) in signals.iter().zip(&found.columns) {
            assert_eq!(column.len(), VALUES / signals.len(), "{}", signal.name());
            assert!(column.iter().all(|value| value.is_finite()), "{}", signal.name());
        }
        assert!(elapsed_s < limit_s, "{elapsed_s} s");
    }
}
