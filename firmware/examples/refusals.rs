//! Prints the texts of refusals with their numbers, a line each, for masters that read object 2028h:
//!
//! ```text
//! cargo run -p firmware --example refusals > refusals.tsv
//! ```

use std::collections::BTreeMap;

fn main() {
    let texts: BTreeMap<&str, u32> =
        firmware::refusal::texts().map(|text| (text.as_str(), text.number())).collect();
    for (text, number) in texts {
        println!("{number:08X}\t{text}");
    }
}
