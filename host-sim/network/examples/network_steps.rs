//! Evaluations of a network by the core, for comparison with exported forms of the network (`tests/onnx/run`).
//!
//! `network_steps reference DIR` writes the core's reference network as `params.toml` and `network.json`.
//! `network_steps DIR < inputs` evaluates the network in DIR on rows of inputs, numbers separated by blanks. Each
//! output row has the factors, the share, and 1 if the inputs were outside the ranges, in `f32`.

#[path = "../../../tests/reference_network.rs"]
mod reference;

use compensator_core::network::NetworkState;
use friction_fit::params;
use friction_network::NetworkFile;
use joint_log::JointKind;
use std::io::{BufRead, Write};
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["reference", folder] => write_reference(Path::new(folder)),
        [folder] => evaluate(Path::new(folder)),
        _ => Err("expected: reference DIR, or DIR".into()),
    }
}

fn write_reference(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let mut joint = reference::joint();
    joint.strokes = None;
    let network = NetworkFile::of_driver(&joint, JointKind::Revolute);
    let json = network.emit(serde_json::Value::Null);
    let mut toml = params::emit_model(&reference::parameters(), JointKind::Revolute);
    params::emit_network("network.json", &json, &mut toml);
    std::fs::write(folder.join("network.json"), json)?;
    std::fs::write(folder.join("params.toml"), toml)?;
    Ok(())
}

fn evaluate(folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let file = params::read(&folder.join("params.toml"), &[])?;
    let file = NetworkFile::of(&file.network.ok_or("params.toml names no network")?)?;
    let network = file.network.convert::<f32>();
    let mut state = NetworkState::default();
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    for line in std::io::stdin().lock().lines() {
        // Unused inputs are in the middle of their range.
        let mut inputs = network.inputs.each_ref().map(|range| range.middle);
        for (place, word) in inputs.iter_mut().zip(line?.split_whitespace()) {
            *place = word.parse()?;
        }
        let [coulomb, static_level, stiffness] = network.evaluate(&mut state, &inputs).to_array();
        let outside = u8::from(state.is_outside);
        writeln!(out, "{coulomb} {static_level} {stiffness} {} {outside}", state.share)?;
    }
    Ok(())
}
