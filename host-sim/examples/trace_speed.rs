//! How fast a CAN log is read: frames a second, of text to frames and of text to samples.
//!
//! ```text
//! cargo run --release -p host-sim --example trace_speed
//! ```

use compensator_core::can::Node;
use host_sim::trace::{Assembler, Fraction, Sample, Writer, candump};
use std::time::Instant;

const SAMPLES: u32 = 400_000;

fn main() {
    let mut log = Vec::new();
    let mut writer = Writer::new(&mut log, "vcan0", Node::FIRST, Fraction::Microseconds);
    for sequence in 0..SAMPLES {
        let mut sample = Sample::EMPTY;
        sample.time_ns = 1_436_509_052_000_000_000 + u64::from(sequence) * 200_000;
        (sample.run, sample.sequence) = (Some(1), sequence);
        let value = (sequence as f32 * 1e-3).sin();
        (sample.motion.velocity_rad_s, sample.motion.position_rad) = (value, 3.0 * value);
        (sample.torque.torque_nm, sample.torque.load_torque_nm) = (2.0 * value, 5.0);
        (sample.seal.radial_force_n, sample.seal.pressure_diff_pa) = (40.0, 2e5);
        sample.surroundings.temperature_c = 12.0 + value;
        // Writing to memory does not fail.
        let _ = writer.sample(&sample);
    }
    let lines = || log.split_inclusive(|byte| *byte == b'\n');
    let frames = lines().count() as f64;
    let measure = |name: &str, run: &dyn Fn() -> u64| {
        let best = (0..20).map(|_| {
            let begin = Instant::now();
            std::hint::black_box(run());
            begin.elapsed().as_secs_f64()
        });
        let best = best.fold(f64::INFINITY, f64::min);
        let megabytes = log.len() as f64 / best / 1e6;
        println!("{name}: {:.1} M frames/s, {megabytes:.0} MB/s", frames / best / 1e6);
    };
    measure("text to frames", &|| {
        lines().flat_map(candump::parse).fold(0, |sum, line| sum ^ line.time_ns)
    });
    measure("text to samples", &|| {
        let mut assembler = Assembler::default();
        let parsed = lines().flat_map(candump::parse);
        let samples = parsed.filter_map(|line| assembler.take(0, &line));
        samples.fold(0, |sum, sample| sum ^ sample.time_ns)
    });
}
