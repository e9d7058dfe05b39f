//! The comparison of four friction models in an arm of three joints (the third paper; see `docs/references.md`).
//!
//! The paper fits linear, extended, atan and LuGre friction to the angles of its arm, from one start, between one
//! pair of bounds for every coefficient, on the very run it then judges by. Nobody has its data: here a simulated arm
//! of its Table 2 ([`simulated_machines::manipulator`]) follows its control signals, and the models are fitted
//! inside what is known of that arm (`arm`, `fit`), once as the paper did it and once properly (`study`), both judged
//! on runs of other commands as well. The same models are fitted to the joints' torques, and to those of a measured
//! industrial arm (`torques`). What the numbers say of themselves is found by `sayings`.

mod arm;
mod bounded;
pub(crate) mod coupled;
mod fit;
mod measured;
mod page;
mod printed;
mod sayings;
mod study;
mod tables;
mod torques;
mod words;

use super::{Outcome, Paper, Request};
use crate::report::Block;
use rayon::prelude::*;
use simulated_machines::manipulator::{Recording, campaign as record};
use study::Extent;

/// The paper.
pub struct Manipulator;

/// Between the seeds of campaigns that repeat the printed protocol.
const AGAIN: u64 = 7919;

impl Paper for Manipulator {
    fn name(&self) -> &'static str {
        "manipulator"
    }

    fn about(&self) -> &'static str {
        "Four friction models in an arm of three joints, as printed and done properly"
    }

    fn title(&self) -> &'static str {
        "Four friction models in an arm of three joints"
    }

    fn preface(&self) -> &'static str {
        "The paper fits linear, extended, atan and LuGre friction to the angles of an arm with fluidic muscles, and finds LuGre the \
         worst. Nobody has its data: angles and torques here are simulated, on an arm of its Table 2 whose friction is none of the \
         four. A measured industrial arm gets the same table of torques. \"As printed\" is one start (0.1) and one pair of bounds \
         (0.001 to 10) for every coefficient, fitted and judged on one course; \"properly\" is scaled, from several starts, and judged on \
         courses it has not seen."
    }

    fn run(&self, request: &Request) -> Result<Outcome, String> {
        let extent = if request.quick { Extent::QUICK } else { Extent::FULL };
        (request.progress)("recording the arm");
        let how = Recording { repeats: extent.repeats, ..Recording::default() };
        let campaign = record(request.seed, extent.others, &how);
        (request.progress)("fitting torques");
        let on_torques = study::torques(&campaign, extent.torque_stride)?;
        (request.progress)("fitting angles");
        let courses = study::courses(&campaign, &how);
        let studies: Vec<study::Study> = printed::MODELS
            .par_iter()
            .zip(&on_torques)
            .map(|(model, torques)| study::study(model, &courses, torques, &extent))
            .collect();
        (request.progress)("repeating the printed protocol");
        let again: Vec<Vec<[f64; 3]>> = (1..=extent.again)
            .map(|index| {
                let campaign = record(request.seed.wrapping_add(AGAIN * index), 0, &how);
                let courses = study::courses(&campaign, &how);
                let each = printed::MODELS.par_iter();
                each.map(|model| study::printed_again(model, &courses, &extent)).collect()
            })
            .collect();
        (request.progress)("fitting the industrial arm");
        let measured = measured::axes(&request.data)?;
        let mut rows = tables::of_angles(&studies, &courses, &again);
        rows.extend(tables::of_torques(&on_torques));
        rows.extend(measured.iter().flatten().flat_map(tables::of_axis));
        let mut summary = words::summary(&studies, &courses, &on_torques, &again);
        summary.extend(words::of_measured(&measured));
        let mut blocks = page::blocks(&studies, &courses);
        blocks.push(Block::Heading("What our fits say of themselves".into()));
        blocks.push(Block::List(words::of_fits(&studies, &courses)));
        let goals = words::goals(&studies, &courses, &on_torques, &measured);
        let digest = tables::digest(&rows);
        Ok(Outcome { rows, goals, summary, blocks, digest, files: Vec::new() })
    }
}
