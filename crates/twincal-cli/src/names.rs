//! Names of input files in results: as given, but without what belongs to one machine.

use std::collections::BTreeMap;
use std::path::{Component, Path};

/// One name per path: relative paths as given, absolute ones by their last components, as few as tell them apart.
pub(crate) fn display_names(paths: &[impl AsRef<Path>]) -> Vec<String> {
    let paths: Vec<&Path> = paths.iter().map(AsRef::as_ref).collect();
    let parts: Vec<Vec<String>> = paths.iter().map(|path| plain_parts(path)).collect();
    let mut names: Vec<String> = paths.iter().map(|p| p.to_string_lossy().into()).collect();
    let as_given = |path: &Path| {
        path.is_relative() && !path.components().any(|part| part == Component::ParentDir)
    };
    let mut open: Vec<usize> = (0..paths.len()).filter(|&i| !as_given(paths[i])).collect();
    let mut count = 0;
    while !open.is_empty() {
        // Whose last components these are; none: of several paths.
        let mut ends: BTreeMap<&[String], Option<&Path>> = BTreeMap::new();
        for (path, parts) in paths.iter().zip(&parts).filter(|(_, p)| p.len() >= count) {
            let whose = ends
                .entry(&parts[parts.len() - count..])
                .or_insert(Some(path));
            if *whose != Some(path) {
                *whose = None;
            }
        }
        open.retain(|&i| {
            let end = &parts[i][parts[i].len() - count..];
            let is_told = count > 0 && ends.get(end) == Some(&Some(paths[i]));
            if is_told || count == parts[i].len() {
                names[i] = end.join("/");
            }
            !is_told && count < parts[i].len()
        });
        count += 1;
    }
    names
}

fn plain_parts(path: &Path) -> Vec<String> {
    path.components()
        .filter_map(|part| match part {
            Component::Normal(name) => Some(name.to_string_lossy().into_owned()),
            _ => None,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::display_names;

    #[test]
    fn absolute_folders_are_left_out_unless_they_tell_two_logs_apart() {
        assert_eq!(
            display_names(&["runs/a.csv", "/data/x/b.csv", "../c.csv"]),
            ["runs/a.csv", "b.csv", "c.csv"]
        );
        assert_eq!(
            display_names(&["/data/x/run.csv", "/data/y/run.csv"]),
            ["x/run.csv", "y/run.csv"]
        );
        assert_eq!(
            display_names(&["/data/run.csv", "/data/run.csv"]),
            ["run.csv", "run.csv"]
        );
        assert_eq!(
            display_names(&["/run.csv", "/a/run.csv", "..", "b/run.csv"]),
            ["run.csv", "a/run.csv", "", "b/run.csv"]
        );
    }

    #[test]
    fn ten_thousand_names_are_told_apart_at_once() {
        let paths: Vec<String> = (0..10_000).map(|i| format!("/data/{i}/run.csv")).collect();
        let names = display_names(&paths);
        assert_eq!((&*names[0], &*names[9_999]), ("0/run.csv", "9999/run.csv"));
    }
}
