//! Export of a network as an ONNX graph: one evaluation, with its state as input and output.
//!
//! ```text
//! inputs [1, N]   output [1, 8]   cell [1, 8]   factors [1, 3]   share [1, 1]   known [1, 1]
//!   -> one evaluation, as in compensator_core::network ->
//! factors_next    output_next     cell_next     share_next       outside
//! ```
//! The activation functions of the gates are rational, and ONNX's LSTM operator has no such functions. The graph
//! therefore consists of sums and products. It computes in `f32` and equals the driver except for the order of sums.
//!
//! The caller feeds the outputs back as inputs, starting with `factors` and `share` at 1 and the others at 0. `known` is
//! 1 if the current stroke is similar to those of the training data. The caller must evaluate this guard
//! (`network::stroke`), because it needs the motion.

use super::graph::{Builder, FLOAT, row};
use compensator_core::network::{CELL_LIMIT, CELLS, GATES};
use friction_network::NetworkFile;
use friction_results::export::{ExportFormat, ExportedModel};

/// Returns the graph of a network.
pub(super) fn export(file: &NetworkFile, source: &str) -> ExportedModel {
    let notes = vec![
        format!(
            "one evaluation, to be run every {} s; network inputs: {}; feed the outputs back as inputs, starting with factors and share at 1 and the others at 0",
            file.period_s,
            file.inputs.join(", ")
        ),
        "the factors multiply coulomb_torque, static_torque and bristle_stiffness of the law; the step of the law is not in the graph"
            .into(),
        format!(
            "start the law from the first measured torque, as {} and {} do: from a bristle torque of 0, its torque is wrong until the joint leaves presliding",
            ExportFormat::C.setting(),
            ExportFormat::Rust.setting(),
        ),
    ];
    ExportedModel::new(model(file, source), notes)
}

/// Returns the ONNX model of a network, encoded.
fn model(file: &NetworkFile, source: &str) -> Vec<u8> {
    let mut graph = Builder::default();
    let used = file.inputs.len();
    let (scaled, outside) = guard(&mut graph, file);
    let output = recurrent(&mut graph, file, &scaled);
    factors(&mut graph, file, &output, &outside);
    let inputs = vec![
        row("inputs", used),
        row("output", CELLS),
        row("cell", CELLS),
        row("factors", 3),
        row("share", 1),
        row("known", 1),
    ];
    let outputs = vec![
        row("factors_next", 3),
        row("output_next", CELLS),
        row("cell_next", CELLS),
        row("share_next", 1),
        row("outside", 1),
    ];
    let doc_string = format!(
        "Factors on coulomb_torque, static_torque (of each direction) and bristle_stiffness of the model lugre-asymmetric in \
         {source}. One evaluation; feed the outputs back as inputs. Start with factors and share 1, output and cell 0; \
         known is 1 if the stroke is similar to those of the training data. The law has a state of its own: start its bristle \
         torque from the first measured torque."
    );
    let entries = [
        ("inputs", file.inputs.join(",")),
        ("evaluation_period_s", file.period_s.to_string()),
        ("start", "factors=1,share=1,output=0,cell=0".to_owned()),
    ];
    graph.model("lugre_lstm", doc_string, [inputs, outputs], &entries)
}

/// Adds the input guard. Returns the names of the scaled inputs and of `outside`, which is 1 if an input is outside its
/// range or the stroke is not known.
fn guard(graph: &mut Builder, file: &NetworkFile) -> (String, String) {
    let used = file.inputs.len();
    let ranges = &file.network.inputs[..used];
    let middle = graph.tensor("middle", &[1, used], ranges.iter().map(|range| range.middle));
    let per_unit = graph.tensor("per_unit", &[1, used], ranges.iter().map(|range| range.per_unit));
    let (zero, one) = (graph.number(0.0), graph.number(1.0));
    // NaN is replaced by the middle of the range and counts as outside.
    let missing = graph.apply("IsNaN", &["inputs"]);
    let from_middle = graph.apply("Sub", &["inputs", &middle]);
    let scaled = graph.apply("Mul", &[&from_middle, &per_unit]);
    let scaled = graph.apply("Where", &[&missing, &zero, &scaled]);
    let size = graph.apply("Abs", &[&scaled]);
    let beyond = graph.apply("Greater", &[&size, &one]);
    let beyond = graph.apply("Or", &[&beyond, &missing]);
    let beyond = graph.apply("Cast", &[&beyond]);
    graph.set_attribute("to", FLOAT);
    let any = graph.apply("ReduceMax", &[&beyond]);
    graph.set_attribute("keepdims", 1);
    let unknown = graph.apply("Sub", &[&one, "known"]);
    let any = graph.apply("Max", &[&any, &unknown]);
    // One value, independent of the number of inputs.
    let outside = graph.named("Identity", &[&any], "outside");
    (graph.clip(&scaled, -1.0, 1.0), outside)
}

/// Adds the recurrent layer. Returns the name of its output.
fn recurrent(graph: &mut Builder, file: &NetworkFile, scaled: &str) -> String {
    let (cells, used) = (&file.network.lstm.cells, file.inputs.len());
    let gates: [String; GATES] = std::array::from_fn(|gate| {
        let name = ["forget", "input", "output", "candidate"][gate];
        let bias = cells.iter().map(|cell| cell.bias[gate]);
        let bias = graph.tensor(&format!("bias_{name}"), &[1, CELLS], bias);
        let of_input =
            (0..used).flat_map(|input| cells.iter().map(move |cell| cell.input[input][gate]));
        let of_input = graph.tensor(&format!("input_{name}"), &[used, CELLS], of_input);
        let of_cell =
            (0..CELLS).flat_map(|other| cells.iter().map(move |cell| cell.recurrent[other][gate]));
        let of_cell = graph.tensor(&format!("recurrent_{name}"), &[CELLS, CELLS], of_cell);
        graph.sums(&[(scaled, &of_input), ("output", &of_cell)], &bias)
    });
    let [forget, input, output, candidate] = gates;
    let (forget, input) = (graph.sigmoid(&forget), graph.sigmoid(&input));
    let candidate = graph.squash(&candidate);
    let kept = graph.apply("Mul", &[&forget, "cell"]);
    let taken = graph.apply("Mul", &[&input, &candidate]);
    let cell = graph.apply("Add", &[&kept, &taken]);
    let (least, most) = (graph.number(-CELL_LIMIT), graph.number(CELL_LIMIT));
    let cell = graph.named("Clip", &[&cell, &least, &most], "cell_next");
    let (output, squashed) = (graph.sigmoid(&output), graph.squash(&cell));
    graph.named("Mul", &[&output, &squashed], "output_next")
}

/// Adds the readout with its bounds, the share of the network, and the slew limit.
fn factors(graph: &mut Builder, file: &NetworkFile, output: &str, outside: &str) {
    let network = &file.network;
    let readout = &network.readout;
    let bias = graph.tensor("bias_factors", &[1, 3], readout.bias.into_iter());
    let weights = (0..CELLS).flat_map(|cell| readout.weights.iter().map(move |row| row[cell]));
    let weights = graph.tensor("factors_of_cells", &[CELLS, 3], weights);
    let sums = graph.sums(&[(output, &weights)], &bias);
    let share_of_range = graph.sigmoid(&sums);
    let bounds = &network.bounds;
    let least = graph.tensor("least", &[1, 3], bounds.iter().map(|bound| bound.least));
    let width = graph.tensor("width", &[1, 3], bounds.iter().map(|bound| bound.most - bound.least));
    let above = graph.apply("Mul", &[&width, &share_of_range]);
    let targets = graph.apply("Add", &[&least, &above]);
    // The static factor must not be below the Coulomb factor. This matrix copies the first column to the second.
    let places = [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let places = graph.tensor("coulomb_twice", &[3, 3], places.into_iter());
    let floor = graph.apply("MatMul", &[&targets, &places]);
    let targets = graph.apply("Max", &[&targets, &floor]);
    // The share rises by `fade` per evaluation inside the range and falls by `fade` outside.
    let (one, fade, twice) =
        (graph.number(1.0), graph.number(network.fade), graph.number(2.0 * network.fade));
    let loss = graph.apply("Mul", &[&twice, outside]);
    let change = graph.apply("Sub", &[&fade, &loss]);
    let share = graph.apply("Add", &["share", &change]);
    let zero = graph.number(0.0);
    let share = graph.named("Clip", &[&share, &zero, &one], "share_next");
    let from_one = graph.apply("Sub", &[&targets, &one]);
    let faded = graph.apply("Mul", &[&from_one, &share]);
    let faded = graph.apply("Add", &[&one, &faded]);
    let way = graph.apply("Sub", &[&faded, "factors"]);
    let step = graph.clip(&way, -network.slew, network.slew);
    graph.named("Add", &["factors", &step], "factors_next");
}
