//! Writes worlds of a family as CSV files with their truth, for programs that grade an engine on files.
//!
//! ```text
//! cargo run --release -p unkind-worlds --example write_worlds -- training|lubricated-seal BASE COUNT DIR
//! ```

use std::path::Path;
use unkind_worlds::{Family, draw_family, seeds};

fn main() -> Result<(), String> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let [family, base, count, folder] = given.as_slice() else {
        return Err("expected FAMILY BASE COUNT DIR".into());
    };
    let kind = match family.as_str() {
        "training" => Family::Training,
        "lubricated-seal" => Family::LubricatedSeal,
        _ => return Err("expected training or lubricated-seal".into()),
    };
    let base: u64 = base.parse().map_err(|e| format!("BASE: {e}"))?;
    let count: usize = count.parse().map_err(|e| format!("COUNT: {e}"))?;
    std::fs::create_dir_all(folder).map_err(|e| format!("{folder}: {e}"))?;
    for seed in seeds(base).take(count) {
        let world = draw_family(seed, kind);
        let write = |end: &str, text: String| {
            let path = Path::new(folder).join(format!("{family}-{seed}{end}"));
            std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))
        };
        write(".csv", world.log.csv())?;
        write(".json", world.truth.json().to_string())?;
    }
    Ok(())
}
