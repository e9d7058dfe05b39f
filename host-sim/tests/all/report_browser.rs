//! A page with one of everything, opened in a real browser: all charts are drawn, the console
//! stays silent, nothing stands out of a narrow page, and paper shows what the screen shows. The page is left in the target folder's
//! `tmp` as `report_example.html`, to be looked at. Without Chromium the tests say so and pass.

use std::f64::consts::TAU;
use std::fs;
use std::path::{Path, PathBuf};

use crate::browser::{chromium, open};
use friction_results::fleet::{self, FleetRow, Level};
use friction_results::report::{
    Axis, Block, Cell, Chart, Page, Series, Table, thin_scatter, thin_series,
};

const HOSTILE: &str = "run <script>alert(1)</script> & \"7\"";

/// Noise between -1 and 1, from a fixed seed (Marsaglia's xorshift).
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

fn stribeck(v: f64) -> f64 {
    (1.5 + 0.7 * (-(v / 0.12).powi(2)).exp()) * (v / 0.01).tanh() + 0.8 * v
}

type Model = (&'static str, fn(f64) -> f64);

/// A name and its torque (Nm) over velocity (rad/s).
const MODELS: [Model; 3] = [
    ("linear", |v| 1.55 * v.signum() + 0.85 * v),
    ("atan", |v| 1.2 * (v / 0.02).atan() + 0.65 * v),
    ("lugre", stribeck),
];

fn law_chart(velocity: &[f64], torque: &[f64]) -> Chart {
    let (x, y) = thin_scatter(velocity, torque, 3000);
    let grid: Vec<f64> = (0..=400).map(|i| f64::from(i - 200) / 200.0).collect();
    let lower = grid.iter().map(|&v| stribeck(v) - 0.2).collect();
    let upper = grid.iter().map(|&v| stribeck(v) + 0.2).collect();
    let mut series = vec![
        Series::band("95 % of lugre", grid.clone(), lower, upper).coloured_as("lugre"),
        Series::points("measured", x, y).muted(),
    ];
    series.extend(MODELS.map(|(name, law)| {
        Series::line(name, grid.clone(), grid.iter().map(|&v| law(v)).collect())
    }));
    Chart {
        title: "Friction torque over velocity, held-out runs".into(),
        caption: "Near standstill only lugre follows the measured drop of torque with speed; \
                  linear jumps where the joint does not."
            .into(),
        x: Axis::new("velocity (rad/s)"),
        y: Axis::new("friction torque (Nm)"),
        series,
    }
}

fn residual_charts(time: &[f64], velocity: &[f64], torque: &[f64]) -> Vec<Chart> {
    MODELS
        .iter()
        .map(|(name, law)| {
            let mut residual: Vec<f64> =
                velocity.iter().zip(torque).map(|(&v, y)| y - law(v)).collect();
            residual[31_000] = f64::NAN;
            let (x, y) = thin_series(time, &residual, 3000);
            Chart {
                title: format!("Residual of {name}"),
                caption: "Measured less modelled torque.".into(),
                x: Axis::new("time (s)"),
                y: Axis { range: Some((-2.5, 2.5)), ..Axis::new("residual (Nm)") },
                series: vec![Series::line(*name, x, y)],
            }
        })
        .collect()
}

fn rmse_chart(rmse: &[f64]) -> Chart {
    let one = |(i, (name, _)): (usize, &Model)| Series::bars(*name, vec![rmse[i]], vec![i as f64]);
    Chart {
        title: "Error on held-out runs".into(),
        caption: "Shorter is better.".into(),
        x: Axis::new("RMSE (Nm)"),
        y: Axis::of_names("", MODELS.iter().map(|(name, _)| *name)),
        series: MODELS.iter().enumerate().map(one).collect(),
    }
}

fn metrics(rmse: &[f64]) -> Table {
    let row = |(i, (name, _)): (usize, &Model)| {
        let n = 50_000.0;
        vec![
            Cell::from(*name),
            Cell::Number(rmse[i]),
            Cell::Number(rmse[i].powi(2) * n),
            Cell::Number(2.0 * n * rmse[i].ln()),
            Cell::ShortNumber(100.0 * rmse[i], 3),
            Cell::Number(0.013 * 5f64.powi(i as i32)),
        ]
    };
    let header = ["model", "RMSE (Nm)", "SSE (Nm²)", "BIC", "relative error (%)", "time (s)"];
    Table {
        caption: "Models on runs that no fit has seen".into(),
        header: header.map(String::from).to_vec(),
        rows: MODELS.iter().enumerate().map(row).collect(),
        best: vec![1, 2, 3],
    }
}

fn parameters() -> Table {
    let row = |name: &str, value, std_error, unit: &str, verdict: &str| {
        let estimate = Cell::Estimate { value, std_error };
        vec![name.into(), estimate, unit.into(), verdict.into()]
    };
    Table {
        caption: "Parameters of lugre".into(),
        header: ["parameter", "value ± standard error", "unit", "verdict"]
            .map(String::from)
            .to_vec(),
        rows: vec![
            row("coulomb_torque", 1.5023, 0.0101, "Nm", "determined"),
            row("static_torque", 2.2, 0.042, "Nm", "determined"),
            row("stribeck_velocity", 0.12, 0.0031, "rad/s", "determined"),
            row("bristle_stiffness", 31_250.0, 91_000.0, "Nm/rad", "not determined by this data"),
            row("pressure_gain", 2.4e-6, 4e-8, "Nm/Pa", "determined"),
            row("offset", 0.0, f64::NAN, "Nm", "at its start value"),
        ],
        best: vec![],
    }
}

/// A page with one of everything, from synthetic data.
fn example() -> Page {
    let mut noise = Noise(7);
    let time: Vec<f64> = (0..50_000).map(|i| f64::from(i) * 1e-3).collect();
    let velocity: Vec<f64> =
        time.iter().map(|t| (TAU * t / 10.0).sin() * (TAU * t / 97.0).cos()).collect();
    let mut torque: Vec<f64> =
        velocity.iter().map(|&v| stribeck(v) + 0.1 * (noise.next() + noise.next())).collect();
    torque[20_000] += 1.2;
    let rmse = MODELS.map(|(_, law)| {
        let squares = velocity.iter().zip(&torque).map(|(&v, y)| (y - law(v)).powi(2));
        (squares.sum::<f64>() / 50_000.0).sqrt()
    });

    let mut page = Page::new("Friction models side by side", format!("joint 3, {HOSTILE}"));
    page.push(Block::Paragraph(
        "Three models were fitted to 5 runs and tried on 2 that no fit has seen. lugre predicts \
         them best, with an error at the noise of the sensor. linear misses what happens below \
         0.1 rad/s, where the torque falls as the joint speeds up. One parameter of lugre, its \
         bristle stiffness, cannot be told from this data. To settle it, record slow reversals."
            .into(),
    ))
    .push(Block::Heading("How well each model predicts".into()))
    .push(Block::Chart(law_chart(&velocity, &torque)))
    .push(Block::Chart(rmse_chart(&rmse)))
    .push(Block::Table(metrics(&rmse)))
    .push(Block::Heading("What each model leaves over".into()))
    .push(Block::Paragraph("White noise would be a band of even height.".into()))
    .push(Block::Row(residual_charts(&time, &velocity, &torque)))
    .push(Block::Heading("Parameters".into()))
    .push(Block::Table(parameters()))
    .push(Block::Details {
        summary: "Methods and data".into(),
        blocks: vec![
            Block::List(vec![
                "Train and test runs are whole runs, never shuffled rows.".into(),
                format!("Runs: {HOSTILE}, naïve, 関節, {}", "x".repeat(120)),
                "SHA-256 of the data: \
                 9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08"
                    .into(),
            ]),
            Block::Chart(Chart {
                title: "Error over measurement noise".into(),
                caption: "Both axes are logarithmic; a dotted plateau is a model's own error."
                    .into(),
                x: Axis { log: true, ..Axis::new("noise (Nm)") },
                y: Axis { log: true, ..Axis::new("RMSE (Nm)") },
                series: vec![
                    Series::points("lugre", vec![1e-3, 1e-2, 0.1], vec![2e-3, 1e-2, 0.1]),
                    Series::line("linear", vec![1e-3, 1e-2, 0.1], vec![0.2, 0.21, 0.25]),
                    Series::line(HOSTILE, vec![0.0, 1e-2, 0.1], vec![0.3, 0.3, 0.4]),
                ],
            }),
        ],
    });
    page
}

fn written_example(name: &str) -> PathBuf {
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&file, example().render()).expect("written");
    file
}

#[test]
fn browser_draws_all_charts_without_console_messages() {
    let page = written_example("report_example.html");
    let Some(chromium) = chromium() else { return };
    let output = open(&chromium, &page, "--dump-dom");
    let (dom, log) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let complaints: Vec<&str> = log.lines().filter(|line| line.contains("CONSOLE")).collect();
    assert!(complaints.is_empty(), "{complaints:#?}");
    // Five charts are visible, the sixth is collapsed. The script adds a place for the value under the pointer to each.
    assert_eq!(dom.matches("class=\"tip\"").count(), 6, "{log}");
    assert!(dom.contains("friction torque (Nm)</div>"));
    assert!(!dom.contains("alert(1)</script>"));
}

#[test]
fn browser_prints_page_to_pdf() {
    let Some(chromium) = chromium() else { return };
    let page = written_example("report_printed.html");
    let pdf = page.with_extension("pdf");
    let output = open(&chromium, &page, &format!("--print-to-pdf={}", pdf.display()));
    let log = String::from_utf8_lossy(&output.stderr);
    assert!(!log.contains("CONSOLE"), "{log}");
    let bytes = fs::read(&pdf).expect("printed");
    assert!(bytes.starts_with(b"%PDF") && bytes.len() > 50_000, "{} bytes", bytes.len());
}

/// The page in a frame of a width, and what stands out of it once its charts are drawn. A frame, as a window may not be as
/// narrow as a telephone.
pub fn framed(page: &Path, width_px: u32) -> PathBuf {
    let text = fs::read_to_string(page).expect("written");
    let text = text.replace('&', "&amp;").replace('"', "&quot;");
    // What scrolls in itself may be as wide as it likes.
    let script = format!(
        r#"addEventListener("load", () => setTimeout(() => {{
            const page = document.querySelector("iframe").contentDocument;
            const out = [...page.querySelectorAll("main *")].filter(each =>
                each.getBoundingClientRect().right > {width_px} + 0.5 && !each.closest(".table, .unseen"));
            const said = out.map(each => each.tagName + ": " + each.textContent.slice(0, 60));
            document.body.dataset.drawn = page.querySelectorAll(".tip").length;
            document.body.dataset.beyond = page.documentElement.scrollWidth - page.documentElement.clientWidth;
            document.body.dataset.out = said.join("; ");
            const scrolls = [...page.querySelectorAll(".records")].filter(each => each.scrollWidth > each.clientWidth);
            document.body.dataset.scrolls = scrolls.map(each => each.textContent.slice(0, 60)).join("; ");
            const box = name => page.querySelector(".lead-" + name)?.getBoundingClientRect();
            const parts = ["first", "main", "rest", "below"].filter(box);
            parts.sort((a, b) => box(a).top - box(b).top || box(a).left - box(b).left);
            document.body.dataset.order = parts.join(" ");
            const shown = [...(page.querySelector(".lead")?.querySelectorAll("dd, .plot") ?? [])];
            document.body.dataset.bottom = Math.max(...shown.map(each => each.getBoundingClientRect().bottom));
            document.body.dataset.beside = parts.length && box("main").left > box("first").right;
        }}, 3000));"#
    );
    let frame = page.with_extension("frame.html");
    let style = format!("width: {width_px}px; height: 3000px; border: 0");
    let document = format!(
        "<!DOCTYPE html><meta charset=\"utf-8\"><iframe style=\"{style}\" srcdoc=\"{text}\"></iframe><script>{script}</script>"
    );
    fs::write(&frame, document).expect("written");
    frame
}

#[test]
fn page_of_400_px_width_has_no_overflow() {
    let Some(chromium) = chromium() else { return };
    let page = written_example("report_narrow.html");
    let said = read_frame(&chromium, &framed(&page, 400));
    assert_eq!(said("out").as_deref(), Some(""));
    assert_eq!(said("beyond").as_deref(), Some("0"));
    assert_eq!(said("drawn").as_deref(), Some("6"));
}

#[test]
fn fleet_page_of_400_px_width_shows_rows_without_scrolling() {
    let Some(chromium) = chromium() else { return };
    let row = |at: usize| FleetRow {
        joint: format!("line-{}-robot-{at:02}-shoulder_lift", at % 3),
        campaign: format!("2026-0{}-01", 1 + at % 6),
        error: (at == 7).then(|| format!("/data/logs/{}/a.csv: found no rows", "x".repeat(80))),
        cause: "temperature-viscous".into(),
        probability: Some(0.9312),
        gain: Some(0.312),
        levels: [
            Some(Level {
                value: if at < 3 { 3.0 } else { 1.0 + 0.01 * at as f64 },
                std_error: 0.01,
            }),
            None,
            None,
        ],
        report: "joint=a/report.html".into(),
        ..FleetRow::default()
    };
    let rows: Vec<FleetRow> = (0..40).map(row).collect();
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fleet_narrow.html");
    fs::write(&file, fleet::page(&rows, &[], &[]).render()).expect("written");
    let said = read_frame(&chromium, &framed(&file, 400));
    assert_eq!(said("out").as_deref(), Some(""));
    assert_eq!(said("beyond").as_deref(), Some("0"));
    assert_eq!(said("scrolls").as_deref(), Some(""));
}

/// Opens a framed page and returns what its script recorded, by name.
pub fn read_frame(chromium: &Path, frame: &Path) -> impl Fn(&str) -> Option<String> + use<> {
    let output = open(chromium, frame, "--dump-dom");
    let dom = String::from_utf8_lossy(&output.stdout).into_owned();
    move |name: &str| {
        let begin = format!(" data-{name}=\"");
        let at = dom.rfind(&begin).map(|at| at + begin.len());
        at.and_then(|at| dom[at..].split('"').next()).map(str::to_owned)
    }
}

#[test]
fn lead_has_first_chart_beside_facts_or_after_first_fact_if_narrow() {
    let Some(chromium) = chromium() else { return };
    let fact = |name: &str, text: &str| (name.to_owned(), text.to_owned());
    let command = "Write it: `host-sim params set params.toml --bus can0`";
    let time: Vec<f64> = (0..100).map(f64::from).collect();
    let torque: Vec<f64> = time.iter().map(|t| stribeck(t / 50.0 - 1.0)).collect();
    let mut page = Page::new("Diagnosis", "");
    page.push(Block::Lead {
        facts: vec![fact("Cause", "pressure preloads the seal"), fact("Next step", command)],
        charts: vec![law_chart(&time, &torque), rmse_chart(&[3.0, 2.0, 1.0])],
    });
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("report_lead.html");
    fs::write(&file, page.render()).expect("written");
    let order = ["first", "main", "rest", "below"].join(" ");
    for (width_px, beside) in [(400, "false"), (1000, "true")] {
        let said = read_frame(&chromium, &framed(&file, width_px));
        assert_eq!(said("out").as_deref(), Some(""), "{width_px}");
        assert_eq!(said("drawn").as_deref(), Some("2"), "{width_px}");
        assert_eq!(said("order").as_ref(), Some(&order), "{width_px}");
        assert_eq!(said("beside").as_deref(), Some(beside), "{width_px}");
    }
}
