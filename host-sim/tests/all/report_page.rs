//! A page keeps its promises whatever stands in it: it needs nothing else, no text of a file
//! becomes markup, no number breaks it, and it is written whole or not at all.

use std::fs;

use friction_results::report::{Axis, Best, Block, Cell, Chart, Page, Series, Style, Table};
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

/// The page without Plotly.js, whose source mentions all manner of things.
fn own_part(html: &str) -> String {
    let (before, rest) = html.split_once("<script type=\"text/javascript\">").expect("Plotly.js");
    let (_, after) = rest.split_once("</script>").expect("its end");
    format!("{before}{after}")
}

/// The JSON behind each chart.
fn figures(html: &str) -> Vec<serde_json::Value> {
    let start = "<script type=\"application/json\"";
    html.split(start)
        .skip(1)
        .map(|part| {
            let json = part.split_once('>').expect("end of tag").1;
            let json = json.split_once("</script>").expect("end of script").0;
            serde_json::from_str(json).expect("valid JSON")
        })
        .collect()
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
    let own = own_part(&html);
    // Text may name addresses; only what a browser would load must not be there.
    for attribute in ["src=", "url(", "@import", "http-equiv=\"refresh\""] {
        assert!(!own.contains(attribute), "{attribute}");
    }
    assert_eq!(own.matches("href=").count(), 1);
    assert!(own.contains("<link rel=\"icon\" href=\"data:,\">"));
    assert!(own.contains("default-src 'none'"));
    assert!(html.contains("plotly.js v"));
    assert!(!html.contains("MathJax.loader"), "no formulas, no MathJax");
    assert!(html.len() < 7_000_000, "{} bytes", html.len());
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
    let own = own_part(&page_of_text(HOSTILE).render());
    assert!(own.contains("&lt;script&gt;alert"), "the hostile text is shown");
    assert!(!own.contains("<script>alert"));
    assert!(!own.contains("<img"));
    // Each chart has one JSON element; beyond those there is only the page's own script.
    let charts = own.matches("type=\"application/json\"").count();
    assert_eq!(own.matches("<script").count(), charts + 1);
    assert_eq!(own.matches("</script").count(), charts + 1);
}

#[test]
fn plotly_gets_texts_that_stand_for_themselves() {
    let mut chart = chart_of(vec![Series::line(HOSTILE, vec![0.0, 1.0], vec![0.0, 1.0])]);
    chart.x.label = "a<b>c</b> & d\ne".into();
    chart.y.categories = vec!["<i>x</i>".into()];
    let figure = &figures(&page_of(Block::Chart(chart)))[0];
    assert!(!figure.to_string().contains(['<', '>']));
    assert_eq!(figure["layout"]["xaxis"]["title"]["text"], "a&lt;b&gt;c&lt;/b&gt; &amp; d e");
}

#[test]
fn what_is_not_finite_is_a_hole() {
    let y = vec![1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 2.0];
    let x: Vec<f64> = (0..5).map(f64::from).collect();
    for style in [Style::Points, Style::Line, Style::Steps, Style::Bars] {
        let mut series = Series::line("odd", x.clone(), y.clone());
        series.style = style;
        let figure = &figures(&page_of(Block::Chart(chart_of(vec![series]))))[0];
        assert_eq!(figure["data"][0]["y"], serde_json::json!([1.0, null, null, null, 2.0]));
    }
}

#[test]
fn a_hole_in_either_edge_parts_a_band() {
    let x = vec![0.0, 1.0, 2.0, 3.0];
    let lower = vec![0.0, f64::NAN, 0.5, 0.5];
    let upper = vec![1.0, 1.0, 1.0, f64::INFINITY];
    let band = Series::band("band", x, lower, upper);
    let figure = &figures(&page_of(Block::Chart(chart_of(vec![band]))))[0];
    assert_eq!(figure["data"][0]["x"], serde_json::json!([0.0, 0.0, null, 2.0, 2.0]));
    assert_eq!(figure["data"][0]["y"], serde_json::json!([0.0, 1.0, null, 0.5, 1.0]));
}

#[test]
fn chart_without_finite_values_shows_message() {
    let series = vec![
        Series::line("empty", vec![], vec![]),
        Series::points("unknown", vec![f64::NAN], vec![1.0]),
    ];
    let html = page_of(Block::Chart(chart_of(series)));
    assert!(html.contains("There is no finite value to draw."));
    assert!(figures(&html).is_empty());
}

#[test]
fn series_name_has_one_colour_and_measured_data_is_grey() {
    let line = |name: &str| Series::line(name, vec![0.0], vec![0.0]);
    let mut page = Page::new("title", "");
    page.push(Block::Row(vec![chart_of(vec![line("measured").muted(), line("a"), line("b")])]));
    page.push(Block::Chart(chart_of(vec![line("b")])));
    let figures = figures(&page.render());
    let colour = |figure: usize, series: usize| &figures[figure]["data"][series]["line"]["color"];
    assert_eq!(colour(0, 2), colour(1, 0));
    assert_ne!(colour(0, 1), colour(0, 2));
    assert_eq!(colour(0, 0), "#8C8C8C");
}

#[test]
fn table_marks_best_finite_value() {
    let row = |name: &str, rmse: f64| vec![Cell::from(name), Cell::from(rmse)];
    let table = Table {
        caption: String::new(),
        header: vec!["model".into(), "RMSE (Nm)".into()],
        rows: vec![row("a", 0.5), row("b", 0.0312), row("c", f64::NAN), vec!["d".into()]],
        best: vec![(1, Best::Smallest), (7, Best::Largest)],
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
