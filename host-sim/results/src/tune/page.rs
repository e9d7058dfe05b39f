//! `tune.html`: whether the joint moves better, by how much, why, and what the session did not learn.
//!
//! The first screen has the outcome, the changes with their intervals, the cause, what was not learnt, and the tracking error
//! before and after on the same motion. The sections below give the trial, the runs, the velocity loop, the parameters, the
//! joint, and the diagnosis.

use super::words::{self, NOT_MEASURED, Verdict};
use super::{TuneGain, TuneLoop, TuneOutcome, TuneReport, charts};
use crate::page::words::capitalised;
use crate::report::{Block, Cell, Page, Table, Tile, Tone};
use joint_log::number::significant;

/// Largest number of sentences of a list on the first screen; the whole list is below.
const MAX_FIRST_SCREEN: usize = 4;

/// Significant digits of a value.
const DIGITS: usize = 4;

impl TuneReport {
    /// Returns the page of the session. `diagnosis` is the page of what the runs show, as
    /// [`crate::diagnosis_page::page`] returns it.
    pub fn page(&self, diagnosis: Option<Page>) -> Page {
        let mut page = Page::new(words::title(self), words::headline(self));
        let tiles: Vec<Tile> =
            self.gains.iter().filter(|gain| is_shown(gain)).map(|gain| tile(self, gain)).collect();
        if !tiles.is_empty() {
            page.push(Block::Tiles(tiles));
        }
        page.push(Block::Lead { facts: facts(self), charts: charts::first_screen(self) });
        page.push(Block::Contents);
        let sections = [
            self.remarks(),
            self.trial_section(),
            self.runs(),
            self.control.as_ref().map_or_else(Vec::new, control),
            self.changed_parameters(),
            self.facts_of_joint(),
            self.diagnosed(diagnosis),
            files(),
        ];
        page.blocks.extend(sections.into_iter().flatten());
        page
    }

    /// Returns the lists that are too long for the first screen, and the warnings.
    fn remarks(&self) -> Vec<Block> {
        let mut blocks = Vec::new();
        if !self.warnings.is_empty() {
            blocks.push(Block::heading("Warnings"));
            blocks.push(Block::List(self.warnings.clone()));
        }
        if self.not_learnt.len() > MAX_FIRST_SCREEN {
            blocks.push(Block::heading("What was not learnt"));
            blocks.push(Block::List(self.not_learnt.clone()));
        }
        blocks
    }

    fn trial_section(&self) -> Vec<Block> {
        let mut blocks = vec![Block::heading("Trial")];
        if self.trial.blocks.is_empty() {
            blocks.push(Block::paragraph(
                "No set was tried, so the joint was not compared with itself.",
            ));
            blocks.extend(charts::course(self).into_iter().map(Block::Chart));
            return blocks;
        }
        blocks.push(Block::Paragraph(words::trial(self)));
        if !self.gains.is_empty() {
            blocks.push(Block::Records(self.gain_table()));
        }
        if let Some(table) = self.parts_table() {
            blocks.push(Block::Records(table));
        }
        blocks.extend(Block::rows(charts::strips(self)));
        blocks.push(Block::details("Values of each block", vec![self.block_table().into()]));
        blocks.extend(charts::course(self).into_iter().map(Block::Chart));
        blocks
    }

    fn gain_table(&self) -> Table {
        let row = |gain: &TuneGain| {
            let verdict = Verdict::of(gain).in_words();
            let texts = [words::name(gain.quantity), words::means(gain), words::change(gain)];
            let mut row: Vec<Cell> = texts.map(Cell::from).into();
            row.extend([Cell::from(words::interval(gain)), Cell::from(verdict)]);
            row
        };
        let header = "quantity|mean, before → after|change|95 % interval|verdict";
        Table::new(
            "Changes with the new set",
            header,
            self.gains.iter().filter(|gain| is_shown(gain)).map(row),
        )
    }

    /// Returns what the loop gains took and what the friction model took; `None` unless both were compared.
    fn parts_table(&self) -> Option<Table> {
        let super::TuneParts { loop_gains, friction_model } = &self.parts;
        if loop_gains.is_empty() || friction_model.is_empty() {
            return None;
        }
        let pairs = loop_gains.iter().zip(friction_model);
        let row = |(own, model): (&TuneGain, &TuneGain)| {
            let mut row = vec![Cell::from(words::name(own.quantity))];
            row.extend([own, model].map(words::change_with_interval).map(Cell::from));
            row
        };
        let rows = pairs.filter(|(own, model)| is_shown(own) || is_shown(model)).map(row);
        let header = "quantity|by the loop gains|then by the friction model";
        Some(Table::new("Where the changes come from", header, rows))
    }

    fn block_table(&self) -> Table {
        let row = |(place, block): (usize, &super::TuneBlock)| {
            let mut row = vec![Cell::Count(place as u64 + 1), Cell::from(block.arm.letter())];
            row.extend(block.values.map(number));
            row
        };
        let names = super::TuneQuantity::ALL.map(|of| format!("{} ({})", of.in_words(), of.unit()));
        let header = format!("block|set|{}", names.join("|"));
        Table::new("", &header, self.trial.blocks.iter().enumerate().map(row))
    }

    fn runs(&self) -> Vec<Block> {
        let mut blocks = vec![Block::heading("Runs that were learnt from")];
        if self.rounds.is_empty() {
            blocks.push(Block::paragraph("No run was recorded to learn from."));
            return blocks;
        }
        let row = |round: &super::TuneRound| {
            let [motion, why] = [&round.motion, &round.why].map(|text| Cell::from(text.clone()));
            vec![motion, Cell::from(words::duration(round.seconds)), why]
        };
        let table =
            Table::new("", "motion|duration|why it was chosen", self.rounds.iter().map(row));
        blocks.push(Block::Records(table));
        blocks
    }

    fn changed_parameters(&self) -> Vec<Block> {
        let [torque, state] = self.bounds_nm.map(|bound| words::finite(bound, "Nm"));
        let (title, text) = match self.outcome {
            TuneOutcome::Saved => ("Parameters", "The joint has the new values."),
            TuneOutcome::Returned(_) if self.parameters.is_empty() => {
                ("Parameters", "No new values were found.")
            }
            TuneOutcome::Returned(_) => (
                "Parameters that were tried",
                "The joint has the former values again; the new ones were never saved.",
            ),
        };
        let mut blocks = vec![Block::heading(title), Block::paragraph(text)];
        if self.parameters.is_empty() {
            return blocks;
        }
        let row = |changed: &super::TuneParameter| {
            let texts = [&changed.name, &changed.before, &changed.after];
            texts.map(|text| Cell::from(text.clone())).into()
        };
        blocks.push(Table::new("", "parameter|former|new", self.parameters.iter().map(row)).into());
        blocks.push(Block::Paragraph(format!(
            "Bounds of the new set, for every motion: compensation torque {torque}, bristle torque {state}."
        )));
        blocks
    }

    fn facts_of_joint(&self) -> Vec<Block> {
        if self.identity.is_empty() {
            return Vec::new();
        }
        vec![Block::heading("Joint before the session"), facts_table(self.identity.clone())]
    }

    fn diagnosed(&self, diagnosis: Option<Page>) -> Vec<Block> {
        let mut blocks = vec![Block::heading("Diagnosis"), Block::Paragraph(words::cause(self))];
        match diagnosis {
            Some(page) => {
                let summary = match page.subtitle.as_str() {
                    "" => page.title,
                    subtitle => format!("{}: {subtitle}", page.title),
                };
                blocks.push(Block::details(summary, page.blocks));
            }
            None => blocks.push(Block::paragraph(
                "The session ended before its runs were diagnosed. Run host-sim diagnose runs.parquet.",
            )),
        }
        blocks
    }
}

/// Returns false for the time stuck of a joint that was never stuck.
pub(super) fn is_shown(gain: &TuneGain) -> bool {
    gain.quantity != super::TuneQuantity::StuckTime || gain.before > 0.0 || gain.after > 0.0
}

fn tile(report: &TuneReport, gain: &TuneGain) -> Tile {
    let verdict = Verdict::of(gain);
    let mut notes = vec![words::means(gain)];
    if verdict != Verdict::NotMeasured {
        notes.push(format!("95\u{a0}%: {}", words::interval(gain)));
    }
    match verdict {
        Verdict::Open => notes.push(verdict.in_words().to_owned()),
        Verdict::Better | Verdict::Worse => notes.extend(words::parts(report, gain.quantity)),
        Verdict::NotMeasured => {}
    }
    Tile {
        name: words::name(gain.quantity),
        // The note says that it was not measured; the words are too long for large type on a narrow screen.
        figure: match verdict {
            Verdict::NotMeasured => "–".to_owned(),
            _ => words::change(gain),
        },
        notes,
        tone: match verdict {
            Verdict::Better => Tone::Good,
            Verdict::Worse => Tone::Bad,
            Verdict::Open | Verdict::NotMeasured => Tone::Neutral,
        },
    }
}

/// Returns the facts of the first screen.
pub(super) fn facts(report: &TuneReport) -> Vec<(String, String)> {
    let mut facts = vec![("Cause".to_owned(), words::cause(report))];
    let mut list = |name: &str, texts: &[String]| {
        for (place, text) in texts.iter().take(MAX_FIRST_SCREEN).enumerate() {
            facts.push((if place == 0 { name } else { "" }.to_owned(), text.clone()));
        }
        if texts.len() > MAX_FIRST_SCREEN {
            let rest = texts.len() - MAX_FIRST_SCREEN;
            facts.push((String::new(), format!("And {rest} more, listed below.")));
        }
    };
    match report.not_learnt.as_slice() {
        [] => list("Not learnt", &["Nothing is known to be missing.".to_owned()]),
        texts => list("Not learnt", texts),
    }
    list("Warning", &report.warnings);
    facts
}

fn control(control: &TuneLoop) -> Vec<Block> {
    let value = |value: f64, unit: &str| words::finite(value, unit);
    let highest = control.response.iter().map(|[frequency, ..]| *frequency);
    let highest = highest.filter(|frequency| frequency.is_finite()).fold(0.0, f64::max);
    let resonance = match control.resonance_hz {
        Some(at) => value(at, "Hz"),
        None if highest > 0.0 => format!("none up to {}", value(highest, "Hz")),
        None => NOT_MEASURED.to_owned(),
    };
    let rows = [
        ("inertia at the joint", value(control.inertia_kg_m2, "kg m²")),
        ("delay from velocity to torque", value(1e3 * control.delay_s, "ms")),
        ("first resonance", resonance),
        ("noise of the velocity at rest", value(control.velocity_noise_rad_s, "rad/s")),
        ("crossover of the velocity loop", value(control.crossover_hz, "Hz")),
        ("phase margin", value(control.phase_margin_deg, "degrees")),
        ("gain margin", value(control.gain_margin_db, "dB")),
    ];
    let rows = rows.map(|(name, text)| (name.to_owned(), text)).into();
    let mut blocks = vec![Block::heading("Velocity loop"), facts_table(rows)];
    let response = charts::response(control);
    if !response.is_empty() {
        blocks.push(Block::Row(response));
    }
    blocks
}

fn facts_table(facts: Vec<(String, String)>) -> Block {
    let rows = facts
        .into_iter()
        .map(|(name, text)| vec![Cell::from(capitalised_name(&name)), Cell::from(text)]);
    Table::new("", "quantity|value", rows).into()
}

/// Returns a name with a capital letter; an empty name stays empty.
fn capitalised_name(name: &str) -> String {
    if name.is_ascii() && !name.is_empty() { capitalised(name) } else { name.to_owned() }
}

/// Returns a number, or an empty cell if it was not measured.
fn number(value: f64) -> Cell {
    if value.is_finite() { Cell::from(significant(value, DIGITS)) } else { Cell::Empty }
}

fn files() -> Vec<Block> {
    let entries = [
        "tune.json: the values of this page.",
        "runs.parquet: every recorded row, as a log for identify and diagnose.",
        "diagnosis.json: the diagnosis of the runs.",
        "params.toml and before.toml: the new and the former parameters.",
    ];
    vec![Block::heading("Files beside this page"), Block::List(entries.map(str::to_owned).into())]
}
