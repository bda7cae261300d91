//! The page's one script, the hash that lets it run, and JSON that stands safely inside a page.

use serde::Serialize;
use sha2::{Digest, Sha256};

/// uPlot, which draws and zooms, as its project ships it (`vendor/README.md`).
const PLOT_LIBRARY: &str = include_str!("vendor/uPlot.iife.min.js");

/// Its licence asks to stand beside it.
const LICENSE: &str = include_str!("vendor/LICENSE");

/// Its style sheet.
pub(super) const PLOT_STYLE: &str = include_str!("vendor/uPlot.min.css");

/// Picker, hover values, zoom, pan and CSV.
const OURS: &str = include_str!("report.js");

/// The text between the tags. It is the same on every page: no name of a model or log is in it.
pub(super) fn text() -> String {
    format!("\n/*\n{LICENSE}*/\n{PLOT_LIBRARY}\n{OURS}")
}

/// The source expression of a content security policy that lets `script` run, and no other.
pub(super) fn source(script: &str) -> String {
    format!("'sha256-{}'", base64(&Sha256::digest(script.as_bytes())))
}

/// `value` as JSON for a data block: no character of it can end the block or begin an element or a reference.
///
/// # Errors
/// What `serde_json` says of a value that is no JSON.
pub(super) fn json(value: &impl Serialize) -> Result<String, serde_json::Error> {
    let text = serde_json::to_string(value)?;
    // Outside of strings JSON has none of these.
    Ok(text
        .replace('<', "\\u003c")
        .replace('>', "\\u003e")
        .replace('&', "\\u0026"))
}

/// RFC 4648, with padding.
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let group = (0..3).fold(0u32, |group, at| {
            (group << 8) | u32::from(chunk.get(at).copied().unwrap_or(0))
        });
        for at in 0..4 {
            let letter = LETTERS[((group >> (18 - 6 * at)) & 63) as usize];
            out.push(if at <= chunk.len() {
                letter as char
            } else {
                '='
            });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 4648, section 10, and the hash of the empty string in the form of a policy.
    #[test]
    fn base64_is_that_of_the_standard() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
        assert_eq!(
            source(""),
            "'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='"
        );
    }

    #[test]
    fn no_string_ends_the_data_block() {
        let hostile = ["</script><img src=x onerror=alert(1)>", "<!--", "a&lt;b"];
        let text = json(&hostile).expect("strings are JSON");
        assert!(!text.contains(['<', '>', '&']), "{text}");
        let back: Vec<String> = serde_json::from_str(&text).expect("still JSON");
        assert_eq!(back, hostile);
    }

    #[test]
    fn the_script_stays_one_script() {
        let script = text();
        assert!(!script.contains("</") && !script.contains("<!--"));
        assert!(script.contains("Permission is hereby granted"));
        assert!(!OURS.contains("innerHTML") && !OURS.contains("insertAdjacentHTML"));
    }

    /// The vendored files are those that their README names.
    #[test]
    fn vendored_files_are_unchanged() {
        let readme = include_str!("vendor/README.md");
        for text in [PLOT_LIBRARY, PLOT_STYLE, LICENSE] {
            assert!(readme.contains(&crate::artifact::sha256(text.as_bytes())));
        }
    }
}
