//! Every file of `tests/` runs: it is a module of its crate's `suite.rs`, or a test by itself in Cargo.toml.

use std::fs;
use std::path::Path;

#[test]
fn every_file_of_tests_runs() {
    for name in ["twincal", "twincal-io", "twincal-cli"] {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name);
        let suite = fs::read_to_string(root.join("tests/suite.rs")).expect("a suite");
        let manifest = fs::read_to_string(root.join("Cargo.toml")).expect("a manifest");
        let mut files = 0;
        for entry in fs::read_dir(root.join("tests")).expect("a folder") {
            let path = entry.expect("an entry").path();
            let is_code = path.extension().is_some_and(|own| own == "rs");
            if !(is_code || path.join("mod.rs").exists()) {
                continue;
            }
            files += 1;
            let stem = path
                .file_stem()
                .and_then(|own| own.to_str())
                .expect("a name");
            let in_suite = suite.lines().any(|line| line == format!("mod {stem};"));
            let alone = manifest.contains(&format!("[[test]]\nname = \"{stem}\"\n"));
            assert!(in_suite != alone, "{}", path.display());
        }
        assert!(files > 10, "{name}: {files} files");
    }
}
