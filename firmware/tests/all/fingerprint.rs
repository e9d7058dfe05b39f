//! The fingerprints of this PC are those of the emulated Cortex-M4F, which `tests/cost/run` compares with the same table.

use firmware::fingerprint;

#[test]
fn fingerprints_on_this_pc_match_table_of_target() {
    let table = include_str!("../../../tests/cost/core-cost.tsv");
    let (_, rows) = table.split_once("# Fingerprints").expect("a section");
    let mut count = 0;
    for (name, value) in fingerprint::all() {
        let row = format!("{name}\t{value:08x}\t{value:08x}");
        assert!(rows.lines().any(|line| line == row), "not in tests/cost/core-cost.tsv: {row}");
        count += 1;
    }
    assert_eq!(count, 10, "runs");
}
