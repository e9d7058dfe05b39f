//! `fleet.html`: the fleet on one page.
//!
//! The order is what a maintainer asks: how many joints need attention, each joint over its campaigns, the report of each log,
//! then the causes, the levels that change, and the logs that failed. Lists are cut at [`MAX_LISTED`], because ten
//! thousand rows of HTML stop a browser. The list of logs searches all rows and shows at most that many.

use super::comparison::MIN_COMPARED;
use super::joint::{JointSummary, level_unit, summarise};
use super::statistics::{FLEET_SIGNIFICANCE, Limit, Trend, middle, trends};
use super::{Ageing, FleetRow, LEVELS};
use crate::page::words::counted;
use crate::report::{
    Answers, Axis, Benefit, Block, Cell, Chart, Finder, Page, Section, Series, Table,
};
use joint_log::number::{count, significant};
use std::collections::{BTreeMap, BTreeSet};

/// Largest number of rows in a list.
const MAX_LISTED: usize = 100;

/// Largest number of trends and of causes that are drawn.
const MAX_DRAWN: usize = 4;

/// Returns the page of a fleet. `limits` are the levels above which a joint needs service.
pub fn page(rows: &[FleetRow], ageing: &[Ageing], limits: &[Limit]) -> Page {
    let learnt = ageing.iter().map(|joint| joint.joint.as_str());
    let names: BTreeSet<&str> = rows.iter().map(|row| row.joint.as_str()).chain(learnt).collect();
    let campaigns: BTreeSet<&str> = rows.iter().map(|row| row.campaign.as_str()).collect();
    let subtitle =
        format!("{}, {}", counted(names.len(), "joint"), counted(campaigns.len(), "campaign"));
    let mut page = Page::new("Friction of a fleet", subtitle);
    let (trends, fleet) = (trends(rows, limits), summarise(rows, ageing, limits));
    for line in fleet.in_words().lines() {
        page.push(Block::Paragraph(format!("{line}.")));
    }
    page.push(Block::Paragraph(reading_joints(fleet.joints.len())));
    page.push(Block::Records(joint_table(rows, &fleet.joints)));
    page.add(Section::new("All logs").with([Block::Find(finder(rows))]));
    let lead = Block::Lead { facts: facts(rows), charts: vec![causes(rows)] };
    page.add(Section::new("Causes").with([lead]));
    page.add(trend_section(&trends, rows));
    page.add(ageing_section(ageing));
    page.add(failures(rows));
    page.answering(answers(rows, &fleet.joints))
}

fn answers(rows: &[FleetRow], joints: &[JointSummary]) -> Answers {
    let diagnosed = rows.iter().filter(|row| row.is_ok());
    let gains = diagnosed.clone().filter(|row| row.cause != "none").filter_map(|row| row.gain);
    let gains: Vec<f64> = gains.collect();
    Answers {
        what: format!(
            "The friction of {} in {}, side by side and over time.",
            counted(joints.len(), "joint"),
            counted(rows.len(), "log")
        ),
        certainty: format!(
            "Logs with a result: {} of {}. A joint that differs or changes does so at a significance of {}\u{a0}% for the whole fleet.",
            count(diagnosed.count() as u64),
            count(rows.len() as u64),
            100.0 * FLEET_SIGNIFICANCE
        ),
        benefit: match gains.is_empty() {
            true => Benefit::Purpose("It shows which joints need attention, and why.".into()),
            false => Benefit::Gain(format!(
                "Where a cause is named, the extension reduces the held-out error by {}\u{a0}% (median of {}).",
                significant(100.0 * middle(gains.iter().copied()), 2),
                counted(gains.len(), "log")
            )),
        },
        next: match joints.first().filter(|joint| !joint.reasons.is_empty()) {
            Some(joint) => {
                format!("Look at joint {}: {}.", joint.joint, joint.reasons.join("; "))
            }
            None => "Nothing: no joint needs attention.".to_owned(),
        },
    }
}

/// Returns one row for each joint over its campaigns, those that need attention first.
fn joint_table(rows: &[FleetRow], joints: &[JointSummary]) -> Table {
    let listed = joints.iter().take(MAX_LISTED).map(|joint| {
        let of_cause = joint.rows.iter().rev().map(|at| &rows[*at]);
        let shown = of_cause.clone().find(|row| row.is_ok() && row.cause == joint.cause);
        let shown = shown.or_else(|| of_cause.clone().find(|row| row.is_ok()));
        let named = match joint.named {
            0 => Cell::Empty,
            named => format!("{named} of {}", counted(joint.diagnosed, "log")).into(),
        };
        let text = |text: String| if text.is_empty() { Cell::Empty } else { text.into() };
        let [size, difference, factor] = joint.sizes().map(text);
        vec![
            shown.map_or_else(|| joint.joint.as_str().into(), joint_cell),
            match joint.reasons.is_empty() {
                true => "no".into(),
                false => joint.reasons.join("; ").into(),
            },
            joint.cause.as_str().into(),
            size,
            difference,
            factor,
            named,
            if joint.trend.is_empty() { Cell::Empty } else { joint.trend.as_str().into() },
            Cell::Count(joint.rows.len() as u64),
        ]
    });
    let header =
        "joint|needs attention|cause|size|minus the others|times the others|named in|trend|logs";
    Table::new("", header, listed)
}

/// Explains the table of this many joints.
fn reading_joints(joints: usize) -> String {
    format!(
        "A joint needs attention if more than half of its logs name the same cause (a small one that most joints share \
         excepted), the size of its cause or a level differs from the other joints, a level changes, its latest log has no \
         result, or its seal ages. The name leads to the latest report with the cause. The size is compared with the median \
         of the other joints that do not differ, from {MIN_COMPARED} joints on, with 95 % intervals.{}",
        cut(joints)
    )
}

fn facts(rows: &[FleetRow]) -> Vec<(String, String)> {
    let good: Vec<&FleetRow> = rows.iter().filter(|row| row.is_ok()).collect();
    let seconds: f64 = good.iter().filter_map(|row| row.seconds).sum();
    let total: u64 = good.iter().filter_map(|row| row.rows).sum();
    let models = good.iter().map(|row| row.fixed_model.as_str()).filter(|name| !name.is_empty());
    let models = Vec::from_iter(models.collect::<BTreeSet<_>>());
    vec![
        ("Diagnoses".into(), count(rows.len() as u64)),
        ("Failed".into(), count((rows.len() - good.len()) as u64)),
        ("Rows".into(), count(total)),
        ("Computing time".into(), format!("{} s", significant(seconds, 3))),
        ("Fixed model of the trends".into(), models.join(", ")),
    ]
}

fn causes(rows: &[FleetRow]) -> Chart {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    rows.iter()
        .filter(|row| row.is_ok())
        .for_each(|row| *counts.entry(&row.cause).or_default() += 1);
    let mut counts: Vec<(&str, usize)> = counts.into_iter().collect();
    counts.sort_by_key(|(name, count)| (std::cmp::Reverse(*count), *name));
    let (names, values): (Vec<&str>, Vec<usize>) = counts.into_iter().unzip();
    let places = (0..names.len()).map(|at| at as f64).collect();
    let values = values.into_iter().map(|count| count as f64).collect();
    Chart {
        title: "Causes".into(),
        caption: "Number of diagnoses that name each cause.".into(),
        x: Axis::new("diagnoses"),
        y: Axis::of_names("", names),
        series: vec![Series::bars("diagnoses", values, places)],
    }
}

/// Returns the name of a joint, linked to its report.
fn joint_cell(row: &FleetRow) -> Cell {
    match row.report.is_empty() {
        true => row.joint.as_str().into(),
        false => Cell::Link { text: row.joint.clone(), target: row.report.clone() },
    }
}

/// Returns a sentence for a list that was cut; empty for a complete one.
fn cut(total: usize) -> String {
    match total > MAX_LISTED {
        true => format!(" The first {MAX_LISTED} of {total}; fleet.parquet has all."),
        false => String::new(),
    }
}

fn trend_section(trends: &[Trend], rows: &[FleetRow]) -> Section {
    let section = Section::new("Trends");
    let found: Vec<&Trend> = trends.iter().filter(|trend| trend.is_significant).collect();
    let Some(first) = found.first() else {
        return section.words(format!(
            "No level changes significantly over the campaigns. {} tested, each under one law.",
            counted(trends.len(), "level")
        ));
    };
    let unit = first.unit.name();
    let until = |trend: &Trend| match trend.until_limit {
        Some([time, soonest, latest]) if time.is_finite() => {
            let latest = if latest.is_finite() { significant(latest, 2) } else { "unknown".into() };
            let time = significant(time, 2);
            format!("{time} ({} to {latest})", significant(soonest, 2)).into()
        }
        _ => Cell::Empty,
    };
    let listed = found.iter().take(MAX_LISTED).map(|trend| {
        let [low, high] = trend.slope_ci95.map(|end| significant(end, 3));
        vec![
            trend.joint.as_str().into(),
            LEVELS[trend.level].into(),
            trend.now.into(),
            format!("{} ({low} to {high})", significant(trend.slope, 3)).into(),
            Cell::ShortNumber(100.0 * trend.slope / trend.now, 2),
            Cell::Count(trend.times.len() as u64),
            until(trend),
        ]
    });
    let caption = format!(
        "Levels that change over the campaigns, under the law that more logs determine; the intervals are of 95 %.{}",
        cut(found.len())
    );
    let header =
        format!("joint|level|now|change per {unit}|% per {unit}|campaigns|{unit}s until the limit");
    let charts = found.iter().take(MAX_DRAWN).map(|trend| trend_chart(trend, rows));
    section.records(Table::new(caption, &header, listed)).with([Block::Row(charts.collect())])
}

/// Returns the trends of the levels that the joints have learnt, those that age first; empty without one.
fn ageing_section(ageing: &[Ageing]) -> Vec<Block> {
    if ageing.is_empty() {
        return Vec::new();
    }
    let found: Vec<&Ageing> = ageing.iter().filter(|joint| joint.ageing.is_some()).collect();
    let sentence =
        |joint: &&Ageing| Some(format!("joint {}: {}", joint.joint, joint.ageing.as_ref()?));
    let sentences: Vec<String> = found.iter().filter_map(sentence).take(MAX_LISTED).collect();
    let listed = ageing.iter().take(MAX_LISTED).map(|joint| {
        let percent = |share: f64| significant(100.0 * share, 2);
        let change = match (joint.change_per_100h, joint.change_per_100h_ci95) {
            (Some(change), Some([low, high])) => {
                format!("{} ({} to {})", percent(change), percent(low), percent(high)).into()
            }
            _ => Cell::Empty,
        };
        vec![
            joint.joint.as_str().into(),
            if joint.ageing.is_some() { "yes" } else { "no" }.into(),
            joint.level.map_or(Cell::Empty, |level| Cell::ShortNumber(level, 3)),
            joint.unit.as_str().into(),
            change,
            joint.change.map_or(Cell::Empty, |change| Cell::ShortNumber(100.0 * change, 2)),
            Cell::ShortNumber(joint.learnt_h, 3),
            Cell::Count(joint.entries as u64),
        ]
    });
    let caption = format!(
        "Learnt Coulomb levels over the time of learning, by the median of the slopes of all pairs; the intervals are of 95 %.{}",
        cut(ageing.len())
    );
    let header = "joint|ages|level|unit|% per 100 h|% in all|learnt (h)|entries";
    Section::new("Ageing of the seals")
        .words(match sentences.is_empty() {
            true => "No joint's learnt level changes by more than the fleet explains.".to_owned(),
            false => format!("{}.", sentences.join("; ")),
        })
        .records(Table::new(caption, header, listed))
        .charts(found.iter().take(MAX_DRAWN).map(|joint| ageing_chart(joint)).collect())
        .into_iter()
        .collect()
}

fn ageing_chart(joint: &Ageing) -> Chart {
    let (times, levels): (Vec<f64>, Vec<f64>) = joint.points.iter().copied().unzip();
    Chart {
        title: format!("{}: learnt level", joint.joint),
        caption: "Coulomb level of each entry of the joint's trend.".into(),
        x: Axis::new("time of learning (h)"),
        y: Axis::new(format!("level ({})", joint.unit)),
        series: vec![Series::points("entries", times, levels)],
    }
}

fn trend_chart(trend: &Trend, rows: &[FleetRow]) -> Chart {
    let (first, last) = (trend.times[0], trend.times[trend.times.len() - 1]);
    let line = |time: f64| trend.now + trend.slope * (time - last);
    let row = rows.iter().find(|row| row.joint == trend.joint && row.is_ok());
    let unit = row.map_or("", |row| level_unit(trend.level, &row.unit));
    let (law, time_unit) = (trend.law, trend.unit.name());
    Chart {
        title: format!("{}: {}", trend.joint, LEVELS[trend.level]),
        caption: format!("Level of each campaign under {law}, and its trend ({time_unit})."),
        x: Axis::new(format!("time since the first campaign ({time_unit}s)")),
        y: Axis::new(format!("{} ({unit})", LEVELS[trend.level])),
        series: vec![
            Series::points("campaigns", trend.times.clone(), trend.values.clone()),
            Series::line("trend", vec![first, last], vec![line(first), line(last)]),
        ],
    }
}

/// Returns the logs without a result; empty if all have one.
fn failures(rows: &[FleetRow]) -> Vec<Block> {
    let failed: Vec<&FleetRow> = rows.iter().filter(|row| !row.is_ok()).collect();
    if failed.is_empty() {
        return Vec::new();
    }
    let listed = failed.iter().take(MAX_LISTED).map(|row| {
        let error = row.error.clone().unwrap_or_default();
        vec![row.joint.as_str().into(), row.campaign.as_str().into(), error.into()]
    });
    let caption = format!("Logs without a result.{}", cut(failed.len()));
    let table = Table::new(caption, "joint|campaign|reason", listed);
    Section::new("Failures").records(table).into_iter().collect()
}

fn finder(rows: &[FleetRow]) -> Finder {
    let cells = |row: &FleetRow| {
        let percent = |gain: f64| format!("{} %", significant(100.0 * gain, 2));
        let cause = if row.is_ok() { row.cause.clone() } else { "failed".into() };
        let probability = row.probability.map_or(String::new(), |share| significant(share, 2));
        let gain = row.gain.map_or(String::new(), percent);
        vec![row.joint.clone(), row.campaign.clone(), cause, probability, gain]
    };
    Finder {
        header: ["joint", "campaign", "cause", "probability", "gain"].map(String::from).to_vec(),
        rows: rows.iter().map(cells).collect(),
        targets: rows.iter().map(|row| row.report.clone()).collect(),
        most: MAX_LISTED,
    }
}

#[cfg(test)]
mod tests {
    use super::super::Level;
    use super::*;

    fn fleet(joints: usize) -> Vec<FleetRow> {
        let row = |joint: usize| FleetRow {
            joint: format!("joint <{joint}>"),
            campaign: "1".into(),
            cause: if joint.is_multiple_of(3) { "none" } else { "pressure-coulomb" }.into(),
            size: (!joint.is_multiple_of(3)).then_some(1e-6 * (1.0 + 1e-4 * joint as f64)),
            size_ci95: Some([0.9e-6, 1.1e-6]),
            size_unit: "Nm/Pa".into(),
            error: joint.is_multiple_of(20).then(|| "a.csv: found no rows".into()),
            fixed_model: "lugre".into(),
            unit: "Nm".into(),
            levels: [
                Some(Level { value: 1.0 + 0.01 * (joint % 17) as f64, std_error: 0.01 }),
                None,
                None,
            ],
            report: format!("joint={joint}/report.html"),
            ..FleetRow::default()
        };
        (0..joints).map(row).collect()
    }

    #[test]
    fn page_of_ten_thousand_joints_lists_a_few() {
        let html = page(&fleet(10_000), &[], &[]).render();
        let lines = html.matches("<tr>").count();
        assert!(lines < 4 * MAX_LISTED, "{lines} rows of tables");
        assert!(html.len() < 3_000_000, "{} bytes", html.len());
        assert!(html.contains("joint=9999/report.html") && html.contains("10000 rows"));
        assert!(!html.contains("joint <1>"), "a name is not escaped");
    }

    #[test]
    fn page_without_rows_renders() {
        let page = page(&[], &[], &[]);
        let html = page.render();
        assert!(!page.title.is_empty() && html.contains(&format!("<h1>{}</h1>", page.title)));
    }
}
