//! The manipulator's paper: tables and findings of its short form.

use super::quick;
use crate::is_left_out;
use published_experiments::{PaperOutcome, ResultRow};

/// Samples of a course: 110 s at 1 kHz, including both ends.
const SAMPLES: f64 = 110_001.0;

fn rows<'a>(outcome: &'a PaperOutcome, table: &'a str) -> impl Iterator<Item = &'a ResultRow> {
    outcome.rows.iter().filter(move |row| row.table.starts_with(table))
}

fn ours(outcome: &PaperOutcome, table: &str, row: &str, column: &str) -> f64 {
    let found = rows(outcome, table).find(|of| of.row == row && of.column == column);
    found.unwrap_or_else(|| panic!("{table} {row} {column}")).ours
}

#[test]
fn short_form_has_printed_tables_and_reports_their_flaws() {
    if is_left_out("paper manipulator --quick") {
        return;
    }
    let outcome = quick("manipulator");
    assert!(outcome.rows.iter().all(|row| row.ours.is_finite()));
    // Tables 3 to 10: two errors of three joints in four models, and 54 coefficients.
    let printed = outcome.rows.iter().filter(|row| row.printed.is_some()).count();
    assert_eq!(printed, 4 * 3 * 2 + 3 * (2 + 4 + 5 + 7));
    for (table, printed) in [("4, ", 3.0610), ("6, ", 1.7812), ("8, ", 2.2694), ("10, ", 2.2930)] {
        let row = rows(&outcome, table).find(|row| row.row == "joint 1").expect("joint 1");
        assert_eq!(row.printed, Some(printed));
        for joint in ["joint 1", "joint 2", "joint 3"] {
            for way in ["as printed", "properly", "by torques", "properly, other course 1"] {
                let rmse = ours(&outcome, table, joint, &format!("RMSE {way}"));
                let sse = ours(&outcome, table, joint, &format!("SSE {way}"));
                assert!(
                    (sse / (SAMPLES * rmse * rmse) - 1.0).abs() < 1e-9,
                    "{table} {joint} {way}"
                );
                assert!(rmse < 3.0, "{table} {joint} {way}: the arm is followed, {rmse} deg");
            }
        }
    }
    // The sum over the joints of a proper fit is at most that of the printed protocol on the fitted course, apart from the
    // effect of a longer step.
    for table in ["4, ", "8, ", "10, "] {
        let sum = |way: &str| -> f64 {
            let joints = ["joint 1", "joint 2", "joint 3"];
            joints.iter().map(|joint| ours(&outcome, table, joint, &format!("SSE {way}"))).sum()
        };
        assert!(sum("properly") < 1.05 * sum("as printed"), "{table}");
    }
    // On held-out torques every law without a bristle is worse than LuGre.
    for joint in 1..=3 {
        let table = format!("Torques of joint {joint}");
        let error = |model: &str| ours(&outcome, &table, model, "RMSE properly, held out");
        for other in ["linear", "extended", "atan"] {
            assert!(error("LuGre") < error(other), "{table} {other}");
        }
    }
    let assert_sentence = |parts: &[&str]| {
        let all = |sentence: &&String| parts.iter().all(|part| sentence.contains(part));
        assert!(outcome.summary.iter().find(all).is_some(), "{parts:?}: {:#?}", outcome.summary);
    };
    assert_sentence(&["LuGre as printed, joint 1", "never saturates", "98 rad"]);
    assert_sentence(&[
        "LuGre as printed",
        "at its start",
        "sigma_1 (joint 1)",
        "sigma_0 (joint 3)",
    ]);
    assert_sentence(&["LuGre as printed", "beyond the bounds stated for it", "z (joint 1)"]);
    assert_sentence(&["impossible units", "sigma_0 in N/m"]);
    assert_sentence(&["fitted and evaluated on the same data"]);
    assert_sentence(&["Table 2, link 2", "no body"]);
    assert_sentence(&["printed order"]);
    assert_sentence(&["simulated: the paper's data are not public"]);
    let measured = outcome.rows.iter().filter(|row| !row.simulated).count();
    assert_eq!(measured, 3 * 4 * 8);
    assert!(!outcome.summary.iter().any(|sentence| sentence.starts_with("skipped: ")));
}
