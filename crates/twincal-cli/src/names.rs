//! Names of input files in results: as given, but without what belongs to one machine.

use std::path::{Component, Path};

/// One name per path: relative paths as given, absolute ones by their last components, as few as tell them apart.
pub(crate) fn display_names(paths: &[impl AsRef<Path>]) -> Vec<String> {
    (0..paths.len())
        .map(|i| {
            let path = paths[i].as_ref();
            if path.is_relative() && !path.components().any(|part| part == Component::ParentDir) {
                return path.to_string_lossy().into_owned();
            }
            let parts = plain_parts(path);
            let unique = |count: usize| {
                paths.iter().enumerate().all(|(j, other)| {
                    j == i
                        || other.as_ref() == path
                        || !plain_parts(other.as_ref()).ends_with(&parts[parts.len() - count..])
                })
            };
            let count = (1..=parts.len())
                .find(|&count| unique(count))
                .unwrap_or(parts.len());
            parts[parts.len() - count..].join("/")
        })
        .collect()
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
    }
}
