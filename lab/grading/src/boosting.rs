//! Boosted trees with monotone figures.
//!
//! Each tree is fitted to the slope and the curvature of the log loss at the trees before it (Friedman 2001; Chen and Guestrin
//! 2016), and counts a part of what it finds. A split by a figure is refused if the leaf of the larger figure would be the smaller
//! one, and the branches are bounded by the middle of both (as in LightGBM and scikit-learn), so that the whole is monotone.
//! Written here, because a table of some hundred small trees must be read by people and by the diagnosis without a library.

use friction_diagnose::contest_calibration::{ContestCalibration, FIGURES, Node, Tree, category};

/// A candidate with its truth.
#[derive(Clone, Debug)]
pub struct Case {
    /// The cause.
    pub cause: String,
    /// The column that it follows, or empty.
    pub follows: String,
    /// Its figures, in the order of [`FIGURES`].
    pub figures: Vec<f64>,
    /// True if the cause is in the log.
    pub is_real: bool,
    /// Weight of the case.
    pub weight: f64,
    /// Part of the cases that is left out at once: a share of the worlds, or a machine.
    pub fold: usize,
}

/// Number of trees. With 300 (and no cost of a cause): Brier score of the worlds 0.072 instead of 0.073, one measured log fewer.
const TREES: usize = 150;

/// Part of a tree's leaves that counts.
const RATE: f64 = 0.06;

/// Most leaves of a tree.
const LEAVES: usize = 6;

/// Fewest cases in a leaf.
const MIN_CASES: usize = 25;

/// Weight of a leaf's squared value, in curvature of the loss.
const RIDGE: f64 = 5.0;

/// Fall of the loss by which a split by cause must surpass one by a figure. What trees learn of one cause is mostly how the
/// simulated worlds have it; what they learn of a figure holds for other machines too.
///
/// Half and twice of it, out of fold: 18 and 16 of 427 clean worlds named (19 at 6), 698 and 690 of 1205 effects found (701), 18 of
/// 25 measured logs right in each case. Without splits by cause: 39 clean, 627 found, 18 measured.
const CAUSE_COST: f64 = 6.0;

/// Most limits of a figure that are tried.
const LIMITS: usize = 63;

/// Fits the trees. The isotonic step is left empty.
pub(crate) fn boost(cases: &[&Case]) -> ContestCalibration {
    let data = Data::new(cases);
    let (real, all) = cases.iter().fold((1e-9, 2e-9), |(real, all), case| {
        (real + case.weight * truth(case), all + case.weight)
    });
    let start = (real / (all - real)).ln();
    let mut odds = vec![start; cases.len()];
    let mut trees = Vec::new();
    for _ in 0..TREES {
        let slope = |(case, odds): (&&Case, &f64)| {
            let p = 1.0 / (1.0 + (-odds).exp());
            (case.weight * (truth(case) - p), case.weight * p * (1.0 - p))
        };
        let slopes: Vec<(f64, f64)> = cases.iter().zip(&odds).map(slope).collect();
        let leaves = grow(&data, &slopes);
        for leaf in &leaves {
            leaf.rows.iter().for_each(|row| odds[*row] += RATE * leaf.value);
        }
        trees.push(tree(&data, leaves));
    }
    ContestCalibration { name: String::new(), start, trees, steps: Vec::new() }
}

fn truth(case: &Case) -> f64 {
    f64::from(u8::from(case.is_real))
}

/// The cases by figure and by cause.
struct Data {
    /// Limits of each figure, ascending.
    limits: Vec<Vec<f64>>,
    /// Number of limits at or below each case's figure.
    bins: Vec<Vec<u8>>,
    /// Names of the causes.
    causes: Vec<String>,
    /// Index of each case's cause.
    cause: Vec<usize>,
}

impl Data {
    fn new(cases: &[&Case]) -> Self {
        let of = |case: &Case| category(&case.cause, &case.follows).to_owned();
        let mut causes: Vec<String> = cases.iter().map(|case| of(case)).collect();
        causes.sort_unstable();
        causes.dedup();
        let place = |case: &&Case| causes.binary_search(&of(case)).unwrap_or(0);
        let cause = cases.iter().map(place).collect();
        let limits: Vec<Vec<f64>> = (0..FIGURES.len()).map(|at| limits(cases, at)).collect();
        let bins = (0..FIGURES.len()).map(|at| {
            let bin =
                |case: &&Case| limits[at].partition_point(|limit| *limit <= case.figures[at]) as u8;
            cases.iter().map(bin).collect()
        });
        let bins = bins.collect();
        Self { limits, bins, causes, cause }
    }
}

/// Returns limits between the values of a figure, with about equally many cases between them. They have four decimals, as the
/// table.
fn limits(cases: &[&Case], figure: usize) -> Vec<f64> {
    let mut values: Vec<f64> = cases.iter().map(|case| case.figures[figure]).collect();
    values.sort_by(f64::total_cmp);
    let count = values.len();
    let mut found: Vec<f64> = (1..=LIMITS)
        .map(|at| at * count / (LIMITS + 1))
        .filter(|at| *at > 0 && *at < count)
        .map(|at| (1e4 * 0.5 * (values[at - 1] + values[at])).round() / 1e4)
        .collect();
    found.dedup();
    found
}

/// A leaf that may be split.
struct Leaf {
    rows: Vec<usize>,
    value: f64,
    bounds: (f64, f64),
    /// Questions on the way, and whether the answer was yes.
    path: Vec<(Question, bool)>,
    split: Option<Split>,
}

/// A question of a node.
#[derive(Clone, Debug, PartialEq)]
enum Question {
    /// Is a figure below its limit of this index?
    Figure(usize, usize),
    /// Is the cause among these?
    Cause(Vec<usize>),
}

struct Split {
    question: Question,
    gain: f64,
    values: (f64, f64),
}

impl Question {
    fn is_yes(&self, data: &Data, row: usize) -> bool {
        match self {
            Self::Figure(figure, limit) => usize::from(data.bins[*figure][row]) <= *limit,
            Self::Cause(among) => among.contains(&data.cause[row]),
        }
    }
}

/// Sums over cases: slope, curvature and number.
#[derive(Clone, Copy, Default)]
struct Sums {
    slope: f64,
    curvature: f64,
    count: usize,
}

impl Sums {
    fn add(&mut self, (slope, curvature): (f64, f64)) {
        self.slope += slope;
        self.curvature += curvature;
        self.count += 1;
    }

    fn plus(self, other: Self) -> Self {
        Self {
            slope: self.slope + other.slope,
            curvature: self.curvature + other.curvature,
            count: self.count + other.count,
        }
    }

    fn less(self, other: Self) -> Self {
        Self {
            slope: self.slope - other.slope,
            curvature: self.curvature - other.curvature,
            count: self.count - other.count,
        }
    }

    fn value(self, (low, high): (f64, f64)) -> f64 {
        (self.slope / (self.curvature + RIDGE)).clamp(low, high)
    }

    /// Returns the fall of the loss by a value.
    fn fall(self, value: f64) -> f64 {
        2.0 * self.slope * value - (self.curvature + RIDGE) * value * value
    }
}

/// Grows one tree, the best split first.
fn grow(data: &Data, slopes: &[(f64, f64)]) -> Vec<Leaf> {
    let bounds = (f64::NEG_INFINITY, f64::INFINITY);
    let mut leaves = vec![leaf(data, slopes, (0..slopes.len()).collect(), bounds, Vec::new())];
    while leaves.len() < LEAVES {
        let gain = |leaf: &Leaf| leaf.split.as_ref().map_or(0.0, |split| split.gain);
        let best = (0..leaves.len()).max_by(|a, b| gain(&leaves[*a]).total_cmp(&gain(&leaves[*b])));
        let Some(at) = best.filter(|at| gain(&leaves[*at]) > 0.0) else { break };
        let parent = leaves.swap_remove(at);
        let Some(Split { question, values: (yes, no), .. }) = parent.split else { break };
        let (rows, others): (Vec<usize>, Vec<usize>) =
            parent.rows.iter().partition(|row| question.is_yes(data, **row));
        let middle = 0.5 * (yes + no);
        let (mut below, mut above) = (parent.bounds, parent.bounds);
        if matches!(question, Question::Figure(..)) {
            (below.1, above.0) = (middle, middle);
        }
        for (rows, bounds, answer) in [(rows, below, true), (others, above, false)] {
            let mut path = parent.path.clone();
            path.push((question.clone(), answer));
            leaves.push(leaf(data, slopes, rows, bounds, path));
        }
    }
    leaves
}

fn leaf(
    data: &Data,
    slopes: &[(f64, f64)],
    rows: Vec<usize>,
    bounds: (f64, f64),
    path: Vec<(Question, bool)>,
) -> Leaf {
    let mut all = Sums::default();
    rows.iter().for_each(|row| all.add(slopes[*row]));
    let value = all.value(bounds);
    let undivided = all.fall(value);
    let mut split: Option<Split> = None;
    let mut try_split = |question: &dyn Fn() -> Question, yes: Sums, is_monotone: bool| {
        let no = all.less(yes);
        let values = (yes.value(bounds), no.value(bounds));
        if yes.count < MIN_CASES || no.count < MIN_CASES || is_monotone && values.0 > values.1 {
            return;
        }
        let cost = if is_monotone { 0.0 } else { CAUSE_COST };
        let gain = yes.fall(values.0) + no.fall(values.1) - undivided - cost;
        if gain > split.as_ref().map_or(1e-9, |split| split.gain) {
            split = Some(Split { question: question(), gain, values });
        }
    };
    for (figure, limits) in data.limits.iter().enumerate() {
        let mut sums = vec![Sums::default(); limits.len() + 1];
        rows.iter().for_each(|row| sums[usize::from(data.bins[figure][*row])].add(slopes[*row]));
        let mut yes = Sums::default();
        for (limit, bin_sums) in sums.iter().take(limits.len()).enumerate() {
            yes = yes.plus(*bin_sums);
            try_split(&|| Question::Figure(figure, limit), yes, true);
        }
    }
    let mut sums: Vec<(Sums, usize)> =
        (0..data.causes.len()).map(|cause| (Sums::default(), cause)).collect();
    rows.iter().for_each(|row| sums[data.cause[*row]].0.add(slopes[*row]));
    sums.retain(|(bin_sums, _)| bin_sums.count > 0);
    let steepness = |bin_sums: &Sums| bin_sums.slope / (bin_sums.curvature + RIDGE);
    sums.sort_by(|(a, _), (b, _)| steepness(a).total_cmp(&steepness(b)));
    let mut yes = Sums::default();
    for at in 0..sums.len() {
        yes = yes.plus(sums[at].0);
        let among = || Question::Cause(sums[..=at].iter().map(|(_, cause)| *cause).collect());
        try_split(&among, yes, false);
    }
    Leaf { rows, value, bounds, path, split }
}

/// Returns the tree of some leaves.
fn tree(data: &Data, leaves: Vec<Leaf>) -> Tree {
    let mut nodes = Vec::new();
    add(data, &leaves.iter().collect::<Vec<_>>(), 0, &mut nodes);
    Tree(nodes)
}

/// Adds the node that parts these leaves after `depth` questions, then its branches.
fn add(data: &Data, leaves: &[&Leaf], depth: usize, nodes: &mut Vec<Node>) {
    if let [leaf] = leaves {
        // The table has four decimals.
        nodes.push(Node::Leaf((1e4 * RATE * leaf.value).round() / 1e4));
        return;
    }
    let Some((question, _)) = leaves.first().and_then(|leaf| leaf.path.get(depth)) else { return };
    let at = nodes.len();
    nodes.push(match question {
        Question::Figure(figure, limit) => {
            Node::Figure { figure: *figure, below: data.limits[*figure][*limit], other: 0 }
        }
        Question::Cause(among) => Node::Cause {
            among: among.iter().map(|cause| data.causes[*cause].clone()).collect(),
            other: 0,
        },
    });
    let (yes, no): (Vec<&Leaf>, Vec<&Leaf>) = leaves.iter().partition(|leaf| leaf.path[depth].1);
    add(data, &yes, depth + 1, nodes);
    let next = nodes.len();
    if let Node::Figure { other, .. } | Node::Cause { other, .. } = &mut nodes[at] {
        *other = next;
    }
    add(data, &no, depth + 1, nodes);
}
