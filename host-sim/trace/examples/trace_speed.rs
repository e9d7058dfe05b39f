//! Speed of reading a CAN log on one core, in frames per second; one line for each reader.
//!
//! `tests/bench` runs it. It measures text to frames, by this reader and by that of the `socketcan` crate, and text to
//! samples of a joint.

use compensator_core::can::NodeId;
use joint_trace::{Assembler, Fraction, TraceSample, Writer, candump};
use socketcan::dump::Reader;
use std::time::Instant;

const SAMPLES: u32 = 400_000;

fn main() {
    let mut log = Vec::new();
    let mut writer = Writer::new(&mut log, "vcan0", NodeId::FIRST, Fraction::Microseconds);
    for sequence in 0..SAMPLES {
        let mut sample = TraceSample::EMPTY;
        sample.time_ns = 1_436_509_052_000_000_000 + u64::from(sequence) * 200_000;
        (sample.run, sample.sequence) = (Some(1), sequence);
        let value = (sequence as f32 * 1e-3).sin();
        (sample.motion.velocity_rad_s, sample.motion.position_rad) = (value, 3.0 * value);
        (sample.torque.torque_nm, sample.torque.load_torque_nm) = (2.0 * value, 5.0);
        (sample.seal.radial_force_n, sample.seal.pressure_diff_pa) = (40.0, 2e5);
        sample.surroundings.temperature_c = 12.0 + value;
        // Writing to memory cannot fail.
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
        println!("{name}\t{:e}", frames / best);
    };
    measure("host-sim, frames", &|| {
        lines().flat_map(candump::parse).fold(0, |sum, line| sum ^ line.time_ns)
    });
    measure("socketcan crate, frames", &|| {
        let records = Reader::from_reader(log.as_slice()).flatten();
        records.fold(0, |sum, record| sum ^ record.t_us)
    });
    measure("host-sim, samples of a joint", &|| {
        let mut assembler = Assembler::default();
        let parsed = lines().flat_map(candump::parse);
        let samples = parsed.filter_map(|line| assembler.push(0, &line));
        samples.fold(0, |sum, sample| sum ^ sample.time_ns)
    });
}
