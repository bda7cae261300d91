//! Writes models back without a change, and with every inertia "changed" to what it is: says for each file whether the bytes
//! are the same. For tests; `export_unchanged FILE…`.
#![allow(clippy::print_stdout, reason = "a program for tests")]

use std::path::Path;
use twincal::write_back::{LinkChange, WriteBack};
use twincal_io::export::write_model;
use twincal_io::model::{ModelSettings, read_model};

fn main() {
    for path in std::env::args().skip(1) {
        println!("{}\t{path}", judge(Path::new(&path)));
    }
}

fn judge(path: &Path) -> String {
    let model = match read_model(path, &ModelSettings::default()) {
        Ok(model) => model,
        Err(error) => return format!("refused: {}", error.to_string().replace('\n', " ")),
    };
    let links = model.description.links.iter().filter_map(|link| {
        Some(LinkChange {
            link: link.name.clone(),
            before: link.inertia,
            after: link.inertia?,
            no_body: false,
        })
    });
    let same = WriteBack {
        links: links.collect(),
        ..WriteBack::default()
    };
    for (what, change) in [("nothing", WriteBack::default()), ("same numbers", same)] {
        match write_model(&model, &change) {
            Ok(bytes) if bytes == model.bytes => {}
            Ok(_) => return format!("different: {what}"),
            Err(error) => return format!("failed: {what}: {error}"),
        }
    }
    "same".into()
}
