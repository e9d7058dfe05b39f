//! Reads the charts of an HTML page: titles, axes, and the values of each series, from the coordinates of the SVG.
//!
//! Values have the resolution of the drawing, a ten-thousandth of the axis. Those of bars are exact.

/// Length of both axes in the drawing's coordinates.
const LENGTH: f64 = 10_000.0;

/// A chart of a page.
#[derive(Debug)]
pub struct DrawnChart {
    pub title: String,
    pub x_label: String,
    /// Labels of the ticks of both axes.
    pub ticks: Vec<String>,
    pub series: Vec<DrawnSeries>,
}

/// A series of a chart.
#[derive(Debug)]
pub struct DrawnSeries {
    pub name: String,
    /// Classes of its colour and dash.
    pub classes: String,
    /// Values along both axes. An interrupted curve has one entry for each part.
    pub parts: Vec<Vec<[f64; 2]>>,
}

impl DrawnSeries {
    /// Returns all values along one axis, 0 or 1.
    pub fn along(&self, axis: usize) -> Vec<f64> {
        self.parts.iter().flatten().map(|point| point[axis]).collect()
    }
}

impl DrawnChart {
    /// Returns the series with a name.
    pub fn named(&self, name: &str) -> Option<&DrawnSeries> {
        self.series.iter().find(|series| series.name == name)
    }
}

/// Returns a page without its scripts.
pub fn without_scripts(html: &str) -> String {
    let mut parts = html.split("<script");
    let first = parts.next().unwrap_or_default().to_owned();
    let rest = parts.map(|part| part.split_once("</script>").expect("the end of a script").1);
    std::iter::once(first.as_str()).chain(rest).collect()
}

/// Returns the charts of a page in their order.
pub fn charts(html: &str) -> Vec<DrawnChart> {
    let parts = html
        .split("<figure ")
        .skip(1)
        .map(|part| part.split("</figure>").next().expect("a figure"));
    parts.filter(|part| part.contains("class=\"plot\"")).map(chart).collect()
}

/// Elements of a page that hold its words. Cells and ticks are figures and names.
const WORDS: [&str; 11] =
    ["h1", "h2", "h3", "p", "li", "dt", "dd", "figcaption", "caption", "summary", "th"];

/// Returns the words of a page in their order, one line for each element.
pub fn sentences(html: &str) -> String {
    let visible = without_scripts(html);
    let body = visible.split_once("<body>").map_or(visible.as_str(), |(_, body)| body);
    let text_of = |(at, _): (usize, &str)| {
        let rest = &body[at + 1..];
        let name = &rest[..rest.find(|c: char| !c.is_ascii_alphanumeric())?];
        let inner = WORDS.contains(&name).then(|| between(rest, ">", &format!("</{name}>")))??;
        let (first, tagged) = inner.split_once('<').unwrap_or((inner, ""));
        let others = tagged.split('<').filter_map(|part| Some(part.split_once('>')?.1));
        let text: String = std::iter::once(first).chain(others).collect();
        Some(plain(text.trim()) + "\n")
    };
    body.match_indices('<').filter_map(text_of).collect()
}

/// Returns the text from `begin` to the next `end`.
pub fn between<'a>(text: &'a str, begin: &str, end: &str) -> Option<&'a str> {
    let (_, rest) = text.split_once(begin)?;
    Some(rest.split_once(end)?.0)
}

fn chart(figure: &str) -> DrawnChart {
    let scale = |name: &str| -> Vec<String> {
        let ends = between(figure, &format!(" {name}=\""), "\"").expect("a scale");
        ends.split(' ').map(str::to_owned).collect()
    };
    let scales = [scale("data-x"), scale("data-y")];
    let title = between(figure, "<p class=\"chart-title\"", "</p>").expect("a title");
    let title = title.split_once('>').expect("the end of the tag").1;
    let ticks = ["x-ticks", "y-ticks"].iter().filter_map(|name| between(figure, name, "</div>"));
    let ticks = ticks.flat_map(|ticks| ticks.split("<span ").skip(1));
    let ticks = ticks.filter_map(|tick| between(tick, ">", "</span>")).map(plain).collect();
    let series = figure.split("<g class=\"series ").skip(1).map(|group| {
        let group = group.split("</g>").next().expect("a group");
        series(group, &scales)
    });
    let x_label = between(figure, "x-label\">", "</div>").map(plain).unwrap_or_default();
    DrawnChart { title: plain(title), x_label, ticks, series: series.collect() }
}

fn series(group: &str, scales: &[Vec<String>; 2]) -> DrawnSeries {
    let classes = group.split('"').next().expect("classes").to_owned();
    let name = plain(between(group, "data-name=\"", "\"").expect("a name"));
    let bars = group.split("<rect ").skip(1).map(|bar| {
        let number = |name: &str| between(bar, name, "\"").and_then(|text| text.parse().ok());
        vec![[number("data-place=\"").expect("a place"), number("data-value=\"").expect("a value")]]
    });
    let mut parts: Vec<Vec<[f64; 2]>> = bars.collect();
    let path = ["class=\"line\" d=\"", "class=\"dots\" d=\"", "class=\"band\" d=\""];
    if let Some(path) = path.iter().find_map(|begin| between(group, begin, "\"")) {
        let value = |place: f64, scale: &[String]| {
            let end = |index: usize| scale[index].parse::<f64>().expect("a number");
            let at = end(0) + place / LENGTH * (end(1) - end(0));
            if scale.len() > 2 { 10f64.powf(at) } else { at }
        };
        let values = |part: Vec<[f64; 2]>| {
            part.into_iter().map(|[x, y]| [value(x, &scales[0]), value(y, &scales[1])]).collect()
        };
        parts.extend(path_parts(path).into_iter().map(values));
    }
    DrawnSeries { name, classes, parts }
}

/// Returns the points of an SVG path, one list for each part.
fn path_parts(path: &str) -> Vec<Vec<[f64; 2]>> {
    let spaced: String = path
        .chars()
        .map(|letter| match letter {
            '-' => " -".to_owned(),
            letter if letter.is_ascii_alphabetic() => format!(" {letter} "),
            letter => letter.to_string(),
        })
        .collect();
    let mut words = spaced.split_whitespace();
    let (mut at, mut start) = ([0.0, 0.0], [0.0, 0.0]);
    let mut parts: Vec<Vec<[f64; 2]>> = Vec::new();
    while let Some(command) = words.next() {
        let mut next = || words.next().expect("a number").parse::<f64>().expect("a number");
        match command {
            "M" | "m" => {
                let from = if command == "M" { [0.0, 0.0] } else { at };
                at = [from[0] + next(), from[1] + next()];
                start = at;
                parts.push(vec![at]);
                continue;
            }
            "h" => {
                at[0] += next();
                continue;
            }
            "v" => at[1] += next(),
            "l" => at = [at[0] + next(), at[1] + next()],
            "z" => {
                at = start;
                continue;
            }
            other => panic!("unknown command {other}"),
        }
        parts.last_mut().expect("a start").push(at);
    }
    parts
}

/// Undoes the escaping of HTML.
fn plain(text: &str) -> String {
    text.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"").replace("&amp;", "&")
}
