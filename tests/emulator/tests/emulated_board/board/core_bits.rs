//! The core alone on the emulated chip, in each number type and with a network: its bits are those of this PC, and its calls
//! are counted for `core_cost`.
//!
//! The image of `tests/emulator/core` computes the courses of `hil_course`.

use super::board_bus::NODE;
use super::hil_course::{Model, course, models};
use super::start::Constant;
use super::update::is_long;
use crate::common::core_image;
use compensator_core::can::{Message, SampleAssembler, SyncOutcome};
use compensator_core::{Fixed, record};
use core_image::{CompensatedJoint, Joint, NetworkJoint, Number, WORDS};
use emulated_board::Machine;
use emulated_board::calls::Call;
use emulated_board::chip::Chip;
use joint_bus::replay::Plan;
use std::sync::LazyLock;

/// Samples of each model's course, in the short and in the long form.
const SAMPLES: [u32; 2] = [330, 16_500];
/// Most frames of a request: those of a sample fit behind it (`core/src/mailbox.rs`).
const MOST_FRAMES: usize = 1000;
/// States of the mailbox, and the places of its parts, bytes.
const REQUESTED: u32 = 1;
const ANSWERED: u32 = 2;
const FRAMES_AT: u32 = 8;
const ANSWERS_AT: u32 = FRAMES_AT + 1024 * 12;
/// Slices in which the image runs until it answers, and their number at most, cycles.
const SLICE_CYCLES: u64 = 20_000;
const MOST_SLICES: u32 = 20_000;

/// Calls of a function during a course: fewest and most instructions, and cycles.
#[derive(Clone, Copy, Debug)]
pub struct Counted {
    pub least: u32,
    pub most: u32,
    pub cycles: u32,
}

/// What the functions of a joint take: of a model and its compensator with the sum, or of a network's evaluation and its law.
#[derive(Debug)]
pub struct Costs {
    pub name: String,
    pub is_network: bool,
    pub functions: [Counted; 2],
}

/// The image with its mailbox.
struct CoreBoard {
    machine: Machine<Constant>,
    mailbox: u32,
}

impl CoreBoard {
    /// Starts the image with a model, or with the network; counts the calls of the functions.
    fn start(model: Option<&Model>, number: &NumberNames) -> Self {
        let image = core_image();
        let address = |name: &str| image.find(name).unwrap_or_else(|| panic!("no {name}")).address;
        let mut machine = Machine::new(image, Chip::new(Constant::default())).expect("a machine");
        let functions = if model.is_some() { MODEL_FUNCTIONS } else { NETWORK_FUNCTIONS };
        let named = |function: &str| {
            let parts = [number.module, function];
            let is_it = |name: &str| parts.iter().all(|part| name.contains(part));
            let found = image.symbols.iter().find(|symbol| is_it(&symbol.name));
            found.unwrap_or_else(|| panic!("no {parts:?}")).address
        };
        machine.count_calls(&functions.map(named));
        let mut board = Self { machine, mailbox: address("MAILBOX") };
        // The image clears its statics before it looks at them.
        board.machine.run(SLICE_CYCLES);
        let record = model.map(|model| record::emit(&model.friction).to_vec());
        let flags = u32::from(number.is_fixed) | u32::from(model.is_none()) << 1;
        board.request(&record.unwrap_or_default(), flags);
        board
    }

    fn request(&mut self, content: &[u8], count: u32) -> u32 {
        self.machine.write_memory(self.mailbox + FRAMES_AT, content);
        self.machine.write_memory(self.mailbox + 4, &count.to_le_bytes());
        self.machine.write_memory(self.mailbox, &REQUESTED.to_le_bytes());
        for _ in 0..MOST_SLICES {
            self.machine.run(SLICE_CYCLES);
            match self.machine.word(self.mailbox) {
                REQUESTED => {}
                ANSWERED => return self.machine.word(self.mailbox + 4),
                state => panic!("state {state} at {:#x}", self.machine.pc()),
            }
        }
        panic!("no answer at {:#x}: {:?}", self.machine.pc(), self.machine.chip().last_fault);
    }

    /// Returns the words of all samples.
    fn answers(&mut self, plan: &Plan) -> Vec<u32> {
        let mut words = Vec::new();
        let frames: Vec<_> = plan.frames.iter().map(|planned| planned.message.emit()).collect();
        for part in frames.chunks(MOST_FRAMES) {
            let mut content = Vec::new();
            for frame in part {
                let mut data = [0; 8];
                data[..frame.data().len()].copy_from_slice(frame.data());
                content.extend(frame.identifier().to_le_bytes());
                content.extend((frame.data().len() as u16).to_le_bytes());
                content.extend(data);
            }
            let samples = self.request(&content, part.len() as u32) as usize;
            let bytes = self.machine.read_memory(self.mailbox + ANSWERS_AT, 4 * WORDS * samples);
            words.extend(
                bytes
                    .chunks_exact(4)
                    .map(|word| u32::from_le_bytes(word.try_into().expect("four bytes"))),
            );
        }
        words
    }
}

/// Returns the words of all samples on this PC.
fn words_of_pc(mut joint: impl Joint, plan: &Plan) -> Vec<u32> {
    let mut inbox = SampleAssembler::new(NODE);
    let mut words = Vec::new();
    for planned in &plan.frames {
        match planned.message {
            Message::Sync(sync) => {
                if let SyncOutcome::Sample { .. } = inbox.sync(sync) {
                    words.extend(joint.step(&inbox));
                    inbox.end_sample();
                }
            }
            message => {
                inbox.take(&message);
            }
        }
    }
    words
}

fn count(calls: &[Call]) -> Option<Counted> {
    Some(Counted {
        least: calls.iter().map(|call| call.instructions).min()?,
        most: calls.iter().map(|call| call.instructions).max()?,
        cycles: calls.iter().map(|call| call.cost.upper).max()?,
    })
}

/// Names of a number type: in the table, and of its module in the image.
struct NumberNames {
    number: &'static str,
    is_fixed: bool,
    module: &'static str,
}

const F32: NumberNames = NumberNames { number: "f32", is_fixed: false, module: "in_f32" };
const FIXED: NumberNames = NumberNames { number: "fixed", is_fixed: true, module: "in_fixed" };
/// Functions of that module, as the ends of their symbols have them.
const MODEL_FUNCTIONS: [&str; 2] = ["4step", "6update"];
const NETWORK_FUNCTIONS: [&str; 2] = ["8evaluate", "5apply"];

/// Runs a course of a model, or of the network, and compares its words with those of this PC. `None` if the number type
/// cannot compute it.
fn run<T: Number>(model: Option<&Model>, seed: u64, number: &NumberNames) -> Option<(u64, Costs)> {
    let plan = course(SAMPLES[usize::from(is_long())], seed);
    let expected = match model {
        Some(model) => words_of_pc(CompensatedJoint::<T>::build(&model.friction)?, &plan),
        None => words_of_pc(NetworkJoint::<T>::build()?, &plan),
    };
    let name = model.map_or("network of 8 cells", |model| &model.name);
    let mut board = CoreBoard::start(model, number);
    let found = board.answers(&plan);
    assert_eq!(found.len(), WORDS * plan.samples as usize, "{name}");
    let differs = (0..found.len()).find(|at| found[*at] != expected[*at]);
    assert_eq!(differs.map(|at| (at / WORDS, at % WORDS)), None, "{name}: sample, word");
    let calls = board.machine.take_calls();
    let functions = [count(&calls[0])?, count(&calls[1])?];
    let name = format!("{name}, {}", number.number);
    Some((plan.samples, Costs { name, is_network: model.is_none(), functions }))
}

/// Returns the costs of every model in every number type, whose bits have been compared, and the number of samples. They are
/// computed once per process.
pub fn costs() -> &'static (u64, Vec<Costs>) {
    static COSTS: LazyLock<(u64, Vec<Costs>)> = LazyLock::new(|| {
        let models = models();
        let (mut samples, mut costs) = (0, Vec::new());
        for (model, seed) in models.iter().map(Some).chain([None]).zip(300..) {
            let float = run::<f32>(model, seed, &F32);
            let fixed = run::<Fixed>(model, seed, &FIXED);
            for (count, cost) in [float, fixed].into_iter().flatten() {
                samples += count;
                costs.push(cost);
            }
        }
        (samples, costs)
    });
    &COSTS
}

#[test]
fn core_on_the_chip_has_the_bits_of_this_pc_in_every_number_type() {
    let (samples, costs) = costs();
    println!("measured: {samples} samples of {} models and number types", costs.len());
    // Every law, term and the network, in both.
    assert_eq!(costs.len(), 2 * (models().len() + 1));
    assert!(*samples >= 20_000, "{samples}");
}
