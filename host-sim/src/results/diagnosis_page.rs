//! `report.html` of `diagnose`: what the model gets wrong, why, and what the extension gains, for a
//! person who was not there.
//!
//! The first screen is the whole answer: cause, size, gain, what next, and a picture. The five sentences follow; all below is what they rest on, in the order a doubter asks: is the log
//! what it says, how wrong is the model, who was weighed and what stood against the rest, what do the models
//! predict, does the residual follow the cause that is named, what is left over and where, which numbers came
//! out, how was it done, on what. *Before* is the base model and *after*
//! the extended one, in the same two colours throughout; a residual is logged minus simulated.
//!
//! The way of a page: `rows` (judged rows as columns, with both residuals) -> `bins` (means with honest
//! errors) -> `evidence` (each cause against what it acts through), `figures`, `tables`, `words`,
//! `stochastic` (a block each) -> [`page`] (their order). What `compare`'s page has already
//! (held-out time without pauses, files, models in a line each) is taken from there.

mod bins;
mod evidence;
mod figures;
mod lead;
mod log;
mod over_time;
mod rows;
mod stochastic;
mod tables;
mod words;

pub use stochastic::stochastic_section;

use super::page::{Study, View, glossary, in_rows, tables as shared};
use super::ranking::{Ranked, left_out_in_words, ranking};
use crate::report::{Block, Page};
use friction_identification::data::{Dataset, Split};
use friction_identification::diagnose::{Diagnosis, story};
use friction_identification::fit::predict::{Predicted, predict};
use friction_identification::fit::statistics::autocorrelation_time;
use rows::Rows;
use serde_json::Value;

/// Most candidates drawn, and most in the open table below.
const MOST_DRAWN: usize = 20;
const MOST_OPEN: usize = 12;

/// All that a page is made from.
#[derive(Clone, Copy)]
pub struct Diagnosed<'a> {
    /// The diagnosis.
    pub found: &'a Diagnosis,
    /// All runs.
    pub data: &'a Dataset,
    /// What was fitted on and judged by.
    pub split: &'a Split,
    /// SHA-256 of each file, in the order of [`Dataset::files`].
    pub hashes: &'a [String],
    /// Names given to foreign columns, `ours=theirs`.
    pub columns: &'a [String],
    /// Samples dropped at the start of each run.
    pub skip: usize,
    /// What was drawn at random was drawn with this.
    pub seed: u64,
}

/// A diagnosis with what follows from it.
struct Scene<'a> {
    about: Diagnosed<'a>,
    /// Both models as `compare` looks at them: before, after.
    view: View<'a>,
    /// Rows no fit has seen that they are judged by.
    held: Rows<'a>,
    /// All rows.
    all: Rows<'a>,
    /// How many neighbouring rows the residual of the extended model remembers.
    memory: f64,
}

impl Scene<'_> {
    /// Whether there is an extended model that is another one than the base.
    fn is_extended(&self) -> bool {
        self.about.found.extended.spec != self.about.found.baseline.spec
    }

    /// What the base model is called in legends: there is no before without an after.
    fn base(&self) -> &'static str {
        if self.is_extended() { figures::BEFORE } else { "base model" }
    }

    /// "rad" or "m".
    fn position_unit(&self) -> &'static str {
        self.about.data.joint.position_unit()
    }

    /// "rad/s" or "m/s".
    fn velocity_unit(&self) -> &'static str {
        self.about.data.joint.velocity_unit()
    }

    /// "torque" or "force".
    fn torque(&self) -> &'static str {
        self.view.torque()
    }

    /// Its unit.
    fn unit(&self) -> &'static str {
        self.view.unit()
    }
}

/// The page of a diagnosis.
pub fn page(about: &Diagnosed) -> Page {
    let Diagnosed { found, data, split, .. } = *about;
    let log = &found.log;
    let fits = [found.baseline.clone(), found.extended.clone()];
    let fits = if found.extended.spec == found.baseline.spec { &fits[..1] } else { &fits[..] };
    let study = Study {
        data,
        split,
        hashes: about.hashes,
        test: log.test_rows(),
        columns: about.columns,
        skip: about.skip,
        fits,
    };
    // Where every run is left out once, all rows are unseen ones.
    let on_train = (!log.leaves_each_out).then(|| {
        [&found.baseline, &found.extended]
            .map(|fit| predict(&fit.parameters, log.train_rows(), fit.resolution))
    });
    let held = || {
        let both = [&found.before, &found.after];
        Rows::new(data, &split.test, &log.test_tracks, both, log.decimate)
    };
    let trained = on_train.as_ref().map(|[before, after]| {
        Rows::new(data, &split.train, &log.train_tracks, [before, after], log.decimate)
    });
    let scene = Scene {
        about: *about,
        view: View::new(&study),
        held: held(),
        all: trained.map_or_else(held, |trained| trained.joined(held())),
        memory: memory(&found.after),
    };

    let mut page = Page::new(words::title(&scene), words::subtitle(&scene));
    page.push(Block::Lead { facts: lead::facts(&scene), chart: lead::above_the_floor(&scene) });
    page.push(Block::Contents);
    page.push(Block::Heading("In five sentences".into()));
    page.push(Block::List(story::story(found)));
    let sections = [
        log::log(&scene),
        gain(&scene),
        candidates(&scene),
        predictions(&scene),
        evidence(&scene),
        left_over(&scene),
        where_in_motion(&scene),
        parameters(&scene),
        stochastic(&scene),
        methods(&scene),
        sources(&scene),
    ];
    page.blocks.extend(sections.into_iter().flatten());
    page
}

/// How many neighbouring rows of a residual are one observation.
fn memory(predicted: &Predicted) -> f64 {
    autocorrelation_time(predicted.residuals.iter().map(Vec::as_slice))
}

fn gain(scene: &Scene) -> Vec<Block> {
    vec![
        Block::Heading("How well rows that no fit has seen are predicted".into()),
        Block::Paragraph(left_out_in_words(scene.about.found).into()),
        Block::Chart(figures::errors(scene)),
    ]
}

fn predictions(scene: &Scene) -> Vec<Block> {
    let Some(charts) = figures::predictions(scene) else { return Vec::new() };
    let mut blocks = vec![
        Block::Heading(format!("The {} and what the models make of it", scene.torque())),
        Block::Paragraph(words::predictions(scene)),
    ];
    let [over_time, close_up @ ..] = charts;
    blocks.push(Block::Chart(over_time));
    blocks.push(Block::Row(close_up.to_vec()));
    blocks
}

fn evidence(scene: &Scene) -> Vec<Block> {
    let mut blocks = vec![Block::Heading("The evidence".into())];
    let findings = &scene.about.found.findings;
    let Some((first, others)) = findings.split_first() else {
        blocks.push(Block::Paragraph(words::nothing_found(scene)));
        blocks.push(Block::Chart(figures::autocorrelation(scene)));
        return blocks;
    };
    blocks.push(Block::List(words::reading_means(scene)));
    blocks.extend(in_rows(evidence::of(scene, first)));
    if scene.is_extended() {
        blocks.push(Block::Chart(figures::added(scene)));
    } else {
        blocks.push(Block::Chart(figures::autocorrelation(scene)));
    }
    for other in others {
        blocks.push(Block::Details {
            summary: format!("The evidence for {}", other.cause.name()),
            blocks: in_rows(evidence::of(scene, other)),
        });
    }
    blocks
}

fn left_over(scene: &Scene) -> Vec<Block> {
    let mut blocks = vec![
        Block::Heading("What is left over, and what it follows".into()),
        Block::Paragraph(words::left_over(scene)),
        Block::Chart(over_time::over_time(scene)),
    ];
    let (along, plain) = evidence::survey(scene);
    blocks.extend(in_rows(along));
    blocks.push(Block::Details {
        summary: "The same, whichever way the joint moves".into(),
        blocks: [vec![Block::Paragraph(words::PLAIN.into())], in_rows(plain)].concat(),
    });
    if !scene.about.found.findings.is_empty() && scene.is_extended() {
        blocks.push(Block::Chart(figures::autocorrelation(scene)));
    }
    blocks
}

fn where_in_motion(scene: &Scene) -> Vec<Block> {
    let found = scene.about.found;
    vec![
        Block::Heading("Where in the motion the base model is wrong".into()),
        Block::Row(vec![
            figures::shares(scene, "By what the joint is doing", &found.by_regime, words::REGIMES),
            figures::shares(scene, "By direction", &found.by_direction, words::DIRECTIONS),
        ]),
        Block::Paragraph(words::reversals(found, scene.unit())),
        Block::Table(tables::shares(scene)),
    ]
}

fn candidates(scene: &Scene) -> Vec<Block> {
    let found = scene.about.found;
    let heading = match scene.is_extended() {
        true => "What was found, and what stood against the rest",
        false => "What was tried, and how far each got",
    };
    let mut blocks = vec![Block::Heading(heading.into())];
    if !found.findings.is_empty() {
        blocks.push(Block::Table(tables::findings(scene)));
        blocks.push(Block::List(words::findings(found)));
    }
    let ranking = ranking(found);
    // What is in the answer is drawn wherever it stood alone.
    let drawn = ranking.iter().enumerate().filter(|(place, own)| *place < MOST_DRAWN || own.named);
    let drawn: Vec<&Ranked> = drawn.map(|(_, own)| own).collect();
    if drawn.is_empty() {
        blocks.push(Block::Paragraph("No column of this log can be blamed for anything.".into()));
        return blocks;
    }
    blocks.push(Block::Chart(figures::ranking(&drawn)));
    let open = &ranking[..ranking.len().min(MOST_OPEN)];
    blocks
        .push(Block::Table(tables::ranking("Each alone beside the base model, best first", open)));
    if ranking.len() > MOST_OPEN {
        blocks.push(Block::Details {
            summary: format!("All {} candidates", ranking.len()),
            blocks: vec![Block::Table(tables::ranking("Each in its best setting", &ranking))],
        });
    }
    blocks
}

fn parameters(scene: &Scene) -> Vec<Block> {
    let mut blocks = vec![
        Block::Heading("Parameters".into()),
        Block::Paragraph(words::PARAMETERS.into()),
        Block::Table(tables::parameters(scene)),
    ];
    let verdicts = words::verdicts(scene);
    if !verdicts.is_empty() {
        blocks.push(Block::List(verdicts));
    }
    if let Some(table) = shared::correlation(&scene.about.found.extended) {
        let summary = format!("{}: correlation of the estimates", scene.about.found.extended.spec);
        blocks.push(Block::Details { summary, blocks: vec![Block::Table(table)] });
    }
    blocks
}

fn stochastic(scene: &Scene) -> Vec<Block> {
    let made = &scene.about.found.certificates;
    let after = if scene.is_extended() { made.after.json() } else { Value::Null };
    stochastic_section(&made.before.json(), &after, Some(&made.reading))
}

fn methods(scene: &Scene) -> Vec<Block> {
    vec![
        Block::Heading("How it was done".into()),
        Block::List(words::methods(scene)),
        Block::Details {
            summary: "The models".into(),
            blocks: vec![Block::List(glossary::models(&scene.view))],
        },
    ]
}

fn sources(scene: &Scene) -> Vec<Block> {
    vec![
        Block::Heading("Data".into()),
        Block::Table(shared::files(&scene.view)),
        Block::List(words::sources(scene)),
        Block::Details {
            summary: "Runs".into(),
            blocks: vec![Block::Table(shared::runs(&scene.view))],
        },
    ]
}
