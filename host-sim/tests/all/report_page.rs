//! A page keeps its promises whatever stands in it: it needs nothing else, no text of a file
//! becomes markup, no number breaks it, and it is written whole or not at all.

use std::fs;

use crate::drawn_chart::{DrawnChart, between, charts, sentences, without_scripts};
use crate::snapshot;
use friction_results::report::{Axis, Block, Cell, Chart, Page, Series, Style, Table};
use friction_results::write_atomically;

/// What a run, a column or a file may be called.
const HOSTILE: &str =
    "</script><script>alert('run')</script><img src=x onerror=alert(1)> \"&\" ü 関節";

/// A page that has this text in every place that takes one.
fn page_of_text(text: &str) -> Page {
    let name = || text.to_owned();
    let line = Series::line(text, vec![0.0, 1.0], vec![1.0, 2.0]);
    let axis = || Axis { label: name(), categories: vec![name()], ..Axis::default() };
    let chart = Chart { title: name(), caption: name(), x: axis(), y: axis(), series: vec![line] };
    let table = Table {
        caption: name(),
        header: vec![name()],
        rows: vec![vec![Cell::from(text)]],
        best: vec![],
    };
    let mut page = Page::new(text, text);
    page.push(Block::Heading(name()))
        .push(Block::Paragraph(name()))
        .push(Block::List(vec![name()]))
        .push(Block::Table(table))
        .push(Block::Row(vec![chart.clone(), chart.clone()]))
        .push(Block::Details { summary: name(), blocks: vec![Block::Chart(chart)] });
    page
}

fn page_of(block: Block) -> String {
    let mut page = Page::new("title", "");
    page.push(block);
    page.render()
}

fn chart_of(series: Vec<Series>) -> Chart {
    Chart { x: Axis::new("time (s)"), y: Axis::new("torque (Nm)"), series, ..Chart::default() }
}

#[test]
fn page_is_self_contained() {
    let html = page_of_text("plain").render();
    // Text may name addresses; only what a browser would load must not be there.
    for attribute in ["src=", "url(", "@import", "http-equiv=\"refresh\""] {
        assert!(!html.contains(attribute), "{attribute}");
    }
    let visible = without_scripts(&html);
    assert_eq!(visible.matches("href=").count(), 1);
    assert!(visible.contains("<link rel=\"icon\" href=\"data:,\">"));
    assert!(visible.contains("default-src 'none'"));
    assert!(html.len() < 50_000, "{} bytes", html.len());
}

#[test]
fn chart_has_round_ticks_labels_and_values() {
    let line = Series::line("model", vec![0.0, 0.5, 1.0], vec![-2.0, 3.25, 7.0]);
    let chart = &charts(&page_of(Block::Chart(chart_of(vec![line]))))[0];
    assert_eq!(chart.x_label, "time (s)");
    for label in ["0.0", "0.2", "1.0", "−2", "6"] {
        assert!(chart.ticks.iter().any(|tick| tick == label), "{label}: {:?}", chart.ticks);
    }
    let near = |values: Vec<f64>, expected: [f64; 3]| {
        values.iter().zip(expected).all(|(value, expected)| (value - expected).abs() < 1e-3)
    };
    assert!(near(chart.series[0].along(0), [0.0, 0.5, 1.0]));
    assert!(near(chart.series[0].along(1), [-2.0, 3.25, 7.0]));
}

#[test]
fn low_chart_has_few_vertical_ticks() {
    // Without regard to the height, this range has a tick at each tenth.
    let line = Series::line("demand", vec![0.0, 1.0], vec![-0.36, 0.36]);
    let ticks = |height_px| {
        let mut chart = chart_of(vec![line.clone()]);
        chart.y.height_px = height_px;
        let html = page_of(Block::Chart(chart));
        let axis = between(&html, "class=\"y-ticks\"", "</div>").expect("an axis");
        axis.matches("<span").count()
    };
    assert_eq!(ticks(None), 7);
    assert_eq!(ticks(Some(80)), 3);
}

#[test]
fn chart_with_logarithmic_axis_has_decades_and_leaves_out_zero() {
    let mut chart =
        chart_of(vec![Series::points("rmse", vec![0.0, 1e-6, 1.0], vec![1.0, 2.0, 3.0])]);
    chart.x.log = true;
    let chart = &charts(&page_of(Block::Chart(chart)))[0];
    let x = chart.series[0].along(0);
    assert!(x.len() == 2 && (x[0] / 1e-6 - 1.0).abs() < 0.01 && (x[1] - 1.0).abs() < 0.01, "{x:?}");
    assert!(
        ["10⁻⁶", "0.01"].iter().all(|label| chart.ticks.iter().any(|tick| tick == label)),
        "{:?}",
        chart.ticks
    );
}

#[test]
fn bars_of_two_series_are_side_by_side_and_single_bars_fill_their_place() {
    let bars =
        |name: &str, place: f64| Series::bars(name, vec![0.5], vec![place]).with_error(vec![0.1]);
    let page = |series: Vec<Series>| {
        let chart = Chart { y: Axis::of_names("", ["a", "b"]), ..chart_of(series) };
        page_of(Block::Chart(chart))
    };
    let heights = |html: &str| -> Vec<String> {
        let bars = html.split("data-style=\"bars\"><rect ").skip(1);
        bars.map(|bar| between(bar, "height=\"", "\"").expect("a height").to_owned()).collect()
    };
    assert_eq!(heights(&page(vec![bars("one", 0.0), bars("two", 0.0)])), ["2000", "2000"]);
    let apart = page(vec![bars("one", 0.0), bars("two", 1.0)]);
    assert_eq!(heights(&apart), ["4000", "4000"]);
    assert_eq!(apart.matches("path class=\"error\"").count(), 2);
}

#[test]
fn lead_has_first_chart_after_first_fact_and_code_without_breaks_in_words() {
    let facts = [("Cause", "pressure"), ("Next step", "Run `host-sim params set --bus can0`")];
    let facts = facts.map(|(name, text)| (name.to_owned(), text.to_owned())).to_vec();
    let titled = |title: &str| Chart {
        title: title.into(),
        ..chart_of(vec![Series::line("before", vec![0.0, 1.0], vec![0.0, 1.0])])
    };
    let charts = vec![titled("Torque over time"), titled("Error")];
    let html = page_of(Block::Lead { facts, charts });
    let order =
        ["pressure</dd>", "Torque over time</p>", "Next step</dt>", "Error</p>", "All charts:"];
    let places: Vec<Option<usize>> = order.iter().map(|text| html.find(text)).collect();
    assert!(places.iter().all(Option::is_some) && places.is_sorted(), "{order:?} at {places:?}");
    assert!(html.contains("<span>--bus</span> <span>can0</span></code>"));
}

#[test]
fn page_without_charts_is_small() {
    let html = page_of(Block::Paragraph("nothing to draw".into()));
    assert!(html.len() < 10_000, "{} bytes", html.len());
    assert!(!html.contains("<script"));
}

#[test]
fn page_escapes_hostile_text() {
    let html = page_of_text(HOSTILE).render();
    let visible = without_scripts(&html);
    assert!(visible.contains("&lt;script&gt;alert"), "the hostile text is shown");
    assert!(!visible.contains("<script>alert"));
    assert!(!visible.contains("<img"));
    assert_eq!(html.matches("<script").count(), 1, "only the page's own script");
    assert_eq!(html.matches("</script").count(), 1);
    assert_eq!(charts(&html)[0].series[0].name, HOSTILE);
}

#[test]
fn value_that_is_not_finite_is_a_gap() {
    let y = vec![1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 2.0, 3.0];
    let x: Vec<f64> = (0..6).map(f64::from).collect();
    for (style, parts) in [(Style::Points, 3), (Style::Line, 2), (Style::Bars, 3)] {
        let mut series = Series::line("odd", x.clone(), y.clone());
        series.style = style;
        let drawn = charts(&page_of(Block::Chart(chart_of(vec![series]))));
        let values = drawn[0].series[0].along(1);
        assert!(values.len() == 3 && values[0] < 1.01 && values[2] > 2.99, "{values:?}");
        assert_eq!(drawn[0].series[0].parts.len(), parts, "{values:?}");
    }
}

#[test]
fn gap_in_either_edge_parts_a_band() {
    let x = vec![0.0, 1.0, 2.0, 3.0];
    let lower = vec![0.0, f64::NAN, 0.5, 0.5];
    let upper = vec![1.0, 1.0, 1.0, f64::INFINITY];
    let band = Series::band("band", x, lower, upper);
    let drawn = charts(&page_of(Block::Chart(chart_of(vec![band]))));
    let rounded = |part: &Vec<[f64; 2]>| -> Vec<[f64; 2]> {
        part.iter().map(|point| point.map(|value| (10.0 * value).round() / 10.0)).collect()
    };
    let parts: Vec<_> = drawn[0].series[0].parts.iter().map(rounded).collect();
    assert_eq!(parts, [vec![[0.0, 0.0], [0.0, 1.0]], vec![[2.0, 0.5], [2.0, 1.0]]]);
}

#[test]
fn long_curve_keeps_its_extremes() {
    let x: Vec<f64> = (0..100_000).map(f64::from).collect();
    let mut y = vec![0.0; x.len()];
    (y[41_234], y[77_777]) = (5.0, -3.0);
    let html = page_of(Block::Chart(chart_of(vec![Series::line("signal", x, y)])));
    assert!(html.len() < 80_000, "{} bytes", html.len());
    let values = charts(&html)[0].series[0].along(1);
    assert!(values.iter().any(|y| *y > 4.99) && values.iter().any(|y| *y < -2.99));
}

#[test]
fn chart_without_finite_values_shows_message() {
    let series = vec![
        Series::line("empty", vec![], vec![]),
        Series::points("unknown", vec![f64::NAN], vec![1.0]),
    ];
    let html = page_of(Block::Chart(chart_of(series)));
    assert_eq!(html.matches("<figure ").count(), 1);
    snapshot::check("report-page", "chart without finite values", &sentences(&html));
    assert!(charts(&html).is_empty());
}

#[test]
fn series_name_has_one_colour_and_measured_data_is_grey() {
    let line = |name: &str| Series::line(name, vec![0.0], vec![0.0]);
    let mut page = Page::new("title", "");
    page.push(Block::Row(vec![chart_of(vec![line("measured").muted(), line("a"), line("b")])]));
    page.push(Block::Chart(chart_of(vec![line("b")])));
    let drawn: Vec<DrawnChart> = charts(&page.render());
    let classes = |chart: usize, series: usize| &drawn[chart].series[series].classes;
    assert_eq!(classes(0, 2), classes(1, 0));
    assert_ne!(classes(0, 1), classes(0, 2));
    assert_eq!(classes(0, 0), "muted");
}

#[test]
fn table_marks_best_finite_value() {
    let row = |name: &str, rmse: f64| vec![Cell::from(name), Cell::from(rmse)];
    let table = Table {
        caption: String::new(),
        header: vec!["model".into(), "RMSE (Nm)".into()],
        rows: vec![row("a", 0.5), row("b", 0.0312), row("c", f64::NAN), vec!["d".into()]],
        best: vec![1, 7],
    };
    let html = page_of(Block::Table(table));
    assert_eq!(html.matches("(best)").count(), 1);
    assert!(html.contains(
        "<td class=\"num best\">0<span class=\"behind\" style=\"min-width:6ch\">.03120</span>"
    ));
    assert!(html.contains("NaN"));
    assert!(html.contains("–"));
}

#[test]
fn write_atomically_replaces_file_or_leaves_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("report.html");
    write_atomically(&file, b"first").expect("written");
    write_atomically(&file, b"second").expect("replaced");
    assert_eq!(fs::read(&file).expect("there"), b"second");
    assert_eq!(fs::read_dir(folder.path()).expect("folder").count(), 1, "nothing is left behind");

    assert!(write_atomically(&folder.path().join("missing/report.html"), b"").is_err());
    let occupied = folder.path().join("folder");
    fs::create_dir_all(occupied.join("inside")).expect("a folder");
    assert!(write_atomically(&occupied, b"").is_err());
    assert!(occupied.join("inside").is_dir());
    assert_eq!(fs::read_dir(folder.path()).expect("folder").count(), 2, "nothing is left behind");
}

#[cfg(unix)]
#[test]
fn write_atomically_gives_default_permissions() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().expect("a folder");
    let (report, other) = (folder.path().join("report"), folder.path().join("other"));
    write_atomically(&report, b"").expect("written");
    fs::write(&other, b"").expect("written");
    let rights = |file| fs::metadata(file).expect("there").permissions().mode();
    assert_eq!(rights(&report), rights(&other));
}
