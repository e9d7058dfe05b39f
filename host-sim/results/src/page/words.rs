//! The title of the page, and the texts beside its charts and tables.

use super::View;
use friction_diagnose::prepare::Prepared;
use joint_log::number::{count, significant};
use joint_log::{Dataset, JointKind, Part};

/// Text above the parameter tables.
pub(crate) const PARAMETERS: &str = "Values are given with one standard error. Only a \"determined\" parameter describes the \
     machine; for the others, different values would predict the data equally well. The best model comes first.";

/// Returns the title of the page: the files, and the model if there is only one.
pub(crate) fn title(view: &View) -> String {
    let on = file_names(&view.study.input.data);
    let of = match view.study.fits {
        [one] => format!("Friction model {}", one.spec),
        _ => "Friction models".to_owned(),
    };
    if on.is_empty() { of } else { format!("{of} on {on}") }
}

/// Returns what the page shows: the number of fits and the best one.
pub(crate) fn what(view: &View) -> String {
    let best = view.name(view.best());
    match view.study.fits.len() {
        1 => format!("A fit of the friction model {best} to this log."),
        fits => format!("{fits} friction models fitted to this log. The best one is {best}."),
    }
}

/// Lists the names of the files; empty for data that were not read from files.
pub(crate) fn file_names(data: &Dataset) -> String {
    let name = |file: &std::path::PathBuf| {
        file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned()
    };
    listed(&data.files.iter().map(name).collect::<Vec<_>>(), 3)
}

/// Describes the log: the kind of joint, the rows and the runs.
pub(crate) fn logged(view: &View) -> String {
    let data = &view.study.input.data;
    let joint = match data.joint {
        JointKind::Revolute => "Revolute joint (torque in Nm",
        JointKind::Prismatic => "Prismatic joint (force in N",
    };
    // A renamed column may have another unit, so the page shows its source.
    let renamed = view.study.input.columns.iter().filter_map(|pair| pair.split_once('='));
    let mut renamed = renamed.map(|(ours, theirs)| (ours.trim(), theirs.trim()));
    let target = renamed.rfind(|(ours, _)| ["torque_nm", "force_n"].contains(ours));
    let source = target.map_or("as logged".to_owned(), |(_, theirs)| format!("logged as {theirs}"));
    format!(
        "{joint}, {source}). {} rows in {}.",
        count(data.rows as u64),
        counted(data.runs.len(), "run")
    )
}

/// Returns the subtitle: the log and the held-out rows.
pub(crate) fn subtitle(view: &View) -> String {
    let Prepared { data, split, .. } = view.study.input;
    let held: usize = split.test.iter().map(|part| part.rows.len()).sum();
    let (fitted, held_runs) = (split.train_runs(data), split.test_runs(data));
    let is_tail = |part: &Part| part.rows.start > 0 && part.rows.end == data.runs[part.run].len();
    let what = match held_runs.iter().any(|run| fitted.contains(run)) {
        true if split.test.iter().all(is_tail) => "the end of ",
        true => "segments of ",
        false => "",
    };
    format!(
        "{} Held out, {} rows: {what}{} {}.",
        logged(view),
        count(held as u64),
        if held_runs.len() == 1 { "run" } else { "runs" },
        listed(&held_runs, fitting(&held_runs))
    )
}

/// Text above the charts over velocity.
pub(crate) fn over_velocity(view: &View) -> String {
    let all = view.study.fits.len();
    let which = match all {
        1 => String::new(),
        _ if view.shown_and_rest().1.is_empty() => String::new(),
        _ => format!(
            " The charts show the best three models{}.",
            if view.ranking[..super::VISIBLE_MODELS].contains(&view.simplest) {
                String::new()
            } else {
                format!(" and {}, the simplest model", view.name(view.simplest))
            }
        ),
    };
    format!(
        "All rows in these charts are held out. Each model uses the logged motion as input and not the logged {0}; only the \
         initial {0} of the bristles, where a segment starts at rest, is estimated from the segment.{which} The points are \
         thinned in proportion to their density; outliers are kept.",
        view.torque()
    )
}

/// Text above the residuals.
pub(crate) fn left_over(view: &View) -> String {
    let starts = &view.held_out.starts;
    let start = |(run, time): &(String, f64)| format!("{run} from {} s", significant(*time, 3));
    let order = match starts.len() {
        0 | 1 => String::new(),
        _ => {
            let all: Vec<String> = starts.iter().map(start).collect();
            let all = listed(&all, fitting(&all));
            format!(" Held-out segments follow one another (run {all}).")
        }
    };
    format!(
        "The residual is the logged minus the simulated {}; all charts have the same axis. Noise is a band of constant \
         height. A visible pattern shows an effect that the model does not contain.{order} The curves are thinned; the \
         minimum and maximum of each group of rows are kept.",
        view.torque()
    )
}

/// Returns notes about the data, including unused columns.
pub(crate) fn data(view: &View) -> Vec<String> {
    let mut texts = sources(view);
    let covariates = &view.study.input.data.covariates;
    if !covariates.is_empty() {
        let names = listed(covariates, 12);
        texts.push(format!("Columns that no model uses: {names}."));
    }
    texts
}

/// Returns notes about the data.
pub(crate) fn sources(view: &View) -> Vec<String> {
    let study = &view.study;
    let Prepared { data, skip, columns, .. } = study.input;
    let mut texts = vec![match data.bad_rows.count {
        0 => format!("All {} rows were used.", count(data.rows_read as u64)),
        bad => format!(
            "Of {} rows, {} were invalid and left out.",
            count(data.rows_read as u64),
            count(bad as u64)
        ),
    }];
    texts.extend(data.bad_rows.first.iter().map(|cell| format!("Left out: {cell}.")));
    if *skip > 0 {
        texts.push(format!("The first {} rows of each run were dropped.", count(*skip as u64)));
    }
    if study.test.decimate > 1 {
        texts.push(format!(
            "Residuals are evaluated at one row in {}, after an anti-aliasing filter; the simulation runs at the full rate.",
            study.test.decimate
        ));
    }
    if !columns.is_empty() {
        texts.push(format!(
            "Columns were mapped by --columns ({}); values have the units of the names on the left.",
            columns.join(", ")
        ));
    }
    let rigid = study.fits.iter().flat_map(|fit| &fit.spec.rigid_body);
    let mut rigid: Vec<&str> = rigid.map(|term| term.name()).collect();
    rigid.sort_unstable();
    rigid.dedup();
    if !rigid.is_empty() {
        texts.push(format!(
            "The {} column contains more than friction; every model also includes {}.",
            view.torque(),
            listed(&rigid, 8)
        ));
    }
    let left_out = data.left_out_columns.iter();
    texts.extend(
        left_out.map(|column| format!("Column {} was left out: {}.", column.name, column.why)),
    );
    texts.extend(data.notes.iter().cloned());
    texts
}

/// Returns the number of names that fit into a sentence: at most eight, fewer if they are long.
fn fitting(names: &[String]) -> usize {
    const CHARACTERS: usize = 120;
    let mut length = 0;
    let fits = |name: &&String| {
        length += name.chars().count() + 2;
        length <= CHARACTERS
    };
    names.iter().take(8).take_while(fits).count().max(1)
}

/// Formats a number with its unit, with a non-breaking blank.
pub(crate) fn quantity(value: f64, unit: &str) -> String {
    format!("{}\u{a0}{unit}", significant(value, 3))
}

/// Returns a text with a capital first letter.
pub(crate) fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// Formats a count and a noun: "1 run", "2 runs".
pub(crate) fn counted(number: usize, thing: &str) -> String {
    format!("{} {thing}{}", count(number as u64), if number == 1 { "" } else { "s" })
}

/// Lists names in a sentence; beyond `most`, only their number is given.
pub(crate) fn listed<S: AsRef<str>>(names: &[S], most: usize) -> String {
    let shown: Vec<&str> = names.iter().take(most).map(AsRef::as_ref).collect();
    match (names.len().saturating_sub(most), shown.as_slice()) {
        (0, [first @ .., last]) if !first.is_empty() => format!("{} and {last}", first.join(", ")),
        (0, _) => shown.join(", "),
        (more, _) => format!("{} and {more} more", shown.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn listed_joins_names_and_counts_the_rest() {
        assert_eq!(listed::<&str>(&[], 3), "");
        assert_eq!(listed(&["a"], 3), "a");
        assert_eq!(listed(&["a", "b", "c"], 3), "a, b and c");
        assert_eq!(listed(&["a", "b", "c", "d"], 2), "a, b and 2 more");
    }
}
