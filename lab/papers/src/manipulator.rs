//! Comparison of four friction models in an arm of three joints (the third paper; see `docs/src/reference/literature.md`).
//!
//! The paper fits linear, extended, atan and LuGre friction to the angles of its arm. It uses one start, one pair of bounds
//! for every coefficient, and the same run for fitting and evaluation. Its data are not public. Here a simulated arm of its
//! Table 2 ([`paper_machines::manipulator`]) follows its control signals.
//!
//! The models are fitted within the known dynamics of that arm (`arm`, `fit`), once by the paper's protocol and once by a
//! proper one (`study`). Both are also evaluated on runs with other commands. The same models are fitted to the torques of
//! the joints and of a measured industrial arm (`torques`). `plausibility` checks the coefficients.

mod arm;
mod bounded;
pub mod coupled;
mod fit;
mod measured;
mod page;
mod plausibility;
mod printed;
mod sentences;
mod study;
mod tables;
mod torques;

use super::{Paper, PaperError, PaperOutcome, PaperRequest};
use friction_results::report::Section;
use paper_machines::manipulator::{Recording, campaign as record};
use rayon::prelude::*;
use study::Extent;

/// The paper of the manipulator.
pub struct Manipulator;

/// Difference between the seeds of repeated campaigns.
const CAMPAIGN_SEED_STEP: u64 = 7919;

impl Paper for Manipulator {
    fn name(&self) -> &'static str {
        "manipulator"
    }

    fn about(&self) -> &'static str {
        "Four friction models in an arm of three joints, as printed and done properly"
    }

    fn usual_minutes(&self, quick: bool) -> f64 {
        if quick { 1.0 } else { 2.5 }
    }

    fn title(&self) -> &'static str {
        "Four friction models in an arm of three joints"
    }

    fn preface(&self) -> &'static str {
        "The paper fits linear, extended, atan and LuGre friction to the angles of an arm with fluidic muscles, and finds LuGre the \
         worst. Its data are not public: angles and torques here are simulated, on an arm of its Table 2 whose friction is none of the \
         four. A measured industrial arm gets the same table of torques. \"As printed\" is one start (0.1) and one pair of bounds \
         (0.001 to 10) for every coefficient, fitted and evaluated on one course. \"Properly\" is scaled, from several starts, and \
         evaluated on courses that were not used in the fit."
    }

    fn run(&self, request: &PaperRequest) -> Result<PaperOutcome, PaperError> {
        let extent = if request.quick { Extent::QUICK } else { Extent::FULL };
        (request.progress)("recording the arm");
        let how = Recording { repeats: extent.repeats, ..Recording::default() };
        let campaign = record(request.seed, extent.others, &how);
        (request.progress)("fitting torques");
        let on_torques = study::fit_torques(&campaign, extent.torque_stride)?;
        (request.progress)("fitting angles");
        let courses = study::courses(&campaign, &how);
        let studies: Vec<study::ModelStudy> = printed::MODELS
            .par_iter()
            .zip(&on_torques)
            .map(|(model, torques)| study::study_model(model, &courses, torques, &extent))
            .collect();
        (request.progress)("repeating the printed protocol");
        let repeats: Vec<Vec<[f64; 3]>> = (1..=extent.repeated_campaigns)
            .map(|index| {
                let campaign =
                    record(request.seed.wrapping_add(CAMPAIGN_SEED_STEP * index), 0, &how);
                let courses = study::courses(&campaign, &how);
                let each = printed::MODELS.par_iter();
                each.map(|model| study::printed_protocol_errors(model, &courses, &extent)).collect()
            })
            .collect();
        (request.progress)("fitting the industrial arm");
        let measured = measured::axes(&request.data)?;
        let mut rows = tables::angle_rows(&studies, &courses, &repeats);
        rows.extend(tables::torque_rows(&on_torques));
        rows.extend(measured.iter().flatten().flat_map(tables::axis_rows));
        let mut summary = sentences::summary(&studies, &courses, &on_torques, &repeats);
        summary.extend(sentences::measured_sentences(&measured));
        let mut blocks = page::blocks(&studies, &courses);
        let checks = sentences::fit_checks(&studies, &courses);
        blocks.extend(Section::new("Checks of our fits").list(checks));
        let goals = sentences::goals(&studies, &courses, &on_torques, &measured);
        let digest = tables::digest(&rows);
        Ok(PaperOutcome { rows, goals, summary, blocks, digest, files: Vec::new() })
    }
}
