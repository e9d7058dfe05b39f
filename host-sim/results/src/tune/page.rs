//! `tune.html`: whether the joint moves better, by how much, why, and what the session did not learn.
//!
//! The first screen has the outcome, the changes with their intervals, the cause, what was not learnt, and the tracking error
//! before and after on the same motion. The sections below give the trial, the runs, the velocity loop, the parameters, the
//! joint, and the diagnosis.

use super::words::{self, NOT_MEASURED, Verdict};
use super::{TuneGain, TuneLoop, TuneOutcome, TuneReport, charts};
use crate::page::words::capitalised;
use crate::report::{Block, Cell, Page, Section, Table, Tile, Tone};
use joint_log::number::significant;

/// Largest number of sentences of a list on the first screen; the whole list is below.
const MAX_FIRST_SCREEN: usize = 4;

/// Significant digits of a value.
const DIGITS: usize = 4;

impl TuneReport {
    /// Returns the page of the session. `diagnosis` is the page of what the runs show, as
    /// [`crate::diagnosis_page::page`] returns it.
    pub fn page(&self, diagnosis: Option<Page>) -> Page {
        let mut page = self.opening();
        page.push(Block::Contents);
        page.add(self.remarks()).add(self.trial_section()).add(self.runs());
        page.add(self.control.iter().flat_map(control));
        page.add(self.changed_parameters()).add(self.facts_of_joint());
        page.explain(charts::BEFORE, "with the former set");
        page.explain(charts::AFTER, "with the new set");
        // The page of a diagnosis explains its models itself.
        page.add(self.diagnosed(diagnosis)).add(files());
        page
    }

    /// Returns the outcome, the changes with their intervals, the cause, what was not learnt, and the tracking error.
    fn opening(&self) -> Page {
        let mut page = Page::new(words::title(self), "");
        let shown = self.gains.iter().filter(|gain| is_shown(gain));
        let tiles: Vec<Tile> = shown.map(|gain| tile(self, gain)).collect();
        if !tiles.is_empty() {
            page.push(Block::Tiles(tiles));
        }
        page.push(Block::Lead { facts: facts(self), charts: charts::first_screen(self) });
        page.answering(words::answers(self))
    }

    /// Returns the first screen as an HTML fragment, for a cell of a notebook.
    pub fn first_screen(&self) -> String {
        self.opening().fragment()
    }

    /// Returns the lists that are too long for the first screen, and the warnings.
    fn remarks(&self) -> Vec<Block> {
        let mut blocks = Vec::new();
        if !self.warnings.is_empty() {
            blocks.extend(Section::new("Warnings").list(&self.warnings));
        }
        if self.not_learnt.len() > MAX_FIRST_SCREEN {
            blocks.extend(Section::new("What was not learnt").list(&self.not_learnt));
        }
        blocks
    }

    fn trial_section(&self) -> Section {
        let mut section = Section::new("Trial");
        let courses = charts::course(self).into_iter().map(Block::Chart);
        if self.trial.blocks.is_empty() {
            let text = "No set was tried, so the joint was not compared with itself.";
            return section.words(text).with(courses);
        }
        section = section.words(words::trial(self));
        if !self.gains.is_empty() {
            section = section.records(self.gain_table());
        }
        section
            .with(self.parts_table().map(Block::Records))
            .charts(charts::strips(self))
            .details("Values of each block", [self.block_table().into()])
            .with(courses)
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
        let shown = self.gains.iter().filter(|gain| is_shown(gain));
        Table::new("Changes with the new set", header, shown.map(row))
    }

    /// Returns what the loop gains took and what the friction model took; `None` unless both were compared.
    fn parts_table(&self) -> Option<Table> {
        let super::TuneParts { loop_gains, friction_model } = &self.parts;
        if loop_gains.is_empty() || friction_model.is_empty() {
            return None;
        }
        let pairs = loop_gains.iter().zip(friction_model);
        let row = |(loop_gain, model): (&TuneGain, &TuneGain)| {
            let mut row = vec![Cell::from(words::name(loop_gain.quantity))];
            row.extend([loop_gain, model].map(words::change_with_interval).map(Cell::from));
            row
        };
        let rows =
            pairs.filter(|(loop_gain, model)| is_shown(loop_gain) || is_shown(model)).map(row);
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

    fn runs(&self) -> Section {
        let section = Section::new("Runs that were learnt from");
        if self.rounds.is_empty() {
            return section.words("No run was recorded to learn from.");
        }
        let row = |round: &super::TuneRound| {
            let [motion, why] = [&round.motion, &round.why].map(|text| Cell::from(text.clone()));
            vec![motion, Cell::from(words::duration(round.seconds)), why]
        };
        let rows = self.rounds.iter().map(row);
        section.records(Table::new("", "motion|duration|why it was chosen", rows))
    }

    fn changed_parameters(&self) -> Section {
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
        let section = Section::new(title).words(text);
        if self.parameters.is_empty() {
            return section;
        }
        let row = |changed: &super::TuneParameter| {
            let texts = [&changed.name, &changed.before, &changed.after];
            texts.map(|text| Cell::from(text.clone())).into()
        };
        let rows = self.parameters.iter().map(row);
        section.table(Table::new("", "parameter|former|new", rows)).words(format!(
            "Bounds of the new set, for every motion: compensation torque {torque}, bristle torque {state}."
        ))
    }

    fn facts_of_joint(&self) -> Vec<Block> {
        if self.identity.is_empty() {
            return Vec::new();
        }
        let facts = facts_table(self.identity.clone());
        Section::new("Joint before the session").table(facts).into_iter().collect()
    }

    fn diagnosed(&self, diagnosis: Option<Page>) -> Section {
        let section = Section::new("Diagnosis").words(words::cause(self));
        let Some(page) = diagnosis else {
            return section.words(
                "The session ended before its runs were diagnosed. Run host-sim diagnose runs.parquet.",
            );
        };
        let summary = match page.subtitle.as_str() {
            "" => page.title,
            subtitle => format!("{}: {subtitle}", page.title),
        };
        section.details(summary, page.blocks)
    }
}

/// Returns false for the time stuck of a joint that was never stuck.
fn is_shown(gain: &TuneGain) -> bool {
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
fn facts(report: &TuneReport) -> Vec<(String, String)> {
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

fn control(control: &TuneLoop) -> Section {
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
    Section::new("Velocity loop").table(facts_table(rows)).charts(charts::response(control))
}

fn facts_table(facts: Vec<(String, String)>) -> Table {
    let rows = facts
        .into_iter()
        .map(|(name, text)| vec![Cell::from(capitalised(&name)), Cell::from(text)]);
    Table::new("", "quantity|value", rows)
}

/// Returns a number, or an empty cell if it was not measured.
fn number(value: f64) -> Cell {
    if value.is_finite() { Cell::from(significant(value, DIGITS)) } else { Cell::Empty }
}

fn files() -> Section {
    let entries = [
        "tune.json: the values of this page.",
        "runs.parquet: every recorded row, as a log for identify and diagnose.",
        "diagnosis.json: the diagnosis of the runs.",
        "params.toml and before.toml: the new and the former parameters.",
    ];
    Section::new("Files beside this page").list(entries)
}
