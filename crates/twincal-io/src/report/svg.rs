//! Builds SVG as text: shapes with a style class, coordinates in tenths of a pixel, every text escaped.

use super::text::escape;
use std::fmt::Write as _;

/// An SVG image in the making. Class names are literals: nothing the user wrote ends up in one.
#[derive(Debug)]
pub(super) struct Svg {
    width: f64,
    height: f64,
    body: String,
}

/// Which point of a text stands at its coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

impl Svg {
    /// An empty image of `width` × `height` user units, which are CSS pixels when it is shown at its own size.
    pub(super) fn new(width: f64, height: f64) -> Self {
        Self {
            width,
            height,
            body: String::new(),
        }
    }

    /// A straight line.
    pub(super) fn line(&mut self, class: &'static str, from: (f64, f64), to: (f64, f64)) {
        let _ = write!(
            self.body,
            r#"<path class="{class}" d="{}"/>"#,
            Path::new().line([from, to]).finish()
        );
    }

    /// Any path made with [`Path`]; nothing is drawn for an empty one.
    pub(super) fn path(&mut self, class: &'static str, path: Path) {
        let d = path.finish();
        if !d.is_empty() {
            let _ = write!(self.body, r#"<path class="{class}" d="{d}"/>"#);
        }
    }

    /// A rectangle; `hint` is what a pointer resting on it shows.
    pub(super) fn rect(
        &mut self,
        class: &'static str,
        corner: (f64, f64),
        size: (f64, f64),
        hint: Option<&str>,
    ) {
        let (x, y, w, h) = (
            short(corner.0),
            short(corner.1),
            short(size.0.max(0.0)),
            short(size.1.max(0.0)),
        );
        let _ = write!(
            self.body,
            r#"<rect class="{class}" x="{x}" y="{y}" width="{w}" height="{h}""#
        );
        self.close("rect", hint);
    }

    /// A circle.
    pub(super) fn circle(
        &mut self,
        class: &'static str,
        centre: (f64, f64),
        radius: f64,
        hint: Option<&str>,
    ) {
        let (x, y, r) = (short(centre.0), short(centre.1), short(radius));
        let _ = write!(
            self.body,
            r#"<circle class="{class}" cx="{x}" cy="{y}" r="{r}""#
        );
        self.close("circle", hint);
    }

    /// A text.
    pub(super) fn text(&mut self, class: &'static str, at: (f64, f64), anchor: Anchor, text: &str) {
        let _ = write!(
            self.body,
            r#"<text class="{class}{}" x="{}" y="{}">{}</text>"#,
            anchor.class(),
            short(at.0),
            short(at.1),
            escape(text)
        );
    }

    /// A text turned by 90° to the left around its coordinates.
    pub(super) fn text_up(
        &mut self,
        class: &'static str,
        at: (f64, f64),
        anchor: Anchor,
        text: &str,
    ) {
        let (x, y) = (short(at.0), short(at.1));
        let _ = write!(
            self.body,
            r#"<text class="{class}{}" transform="translate({x} {y}) rotate(-90)">{}</text>"#,
            anchor.class(),
            escape(text)
        );
    }

    /// The image as text; `label` says in words what it shows, for those who cannot see it.
    pub(super) fn finish(self, label: &str) -> String {
        let (w, h) = (short(self.width), short(self.height));
        format!(
            r#"<svg role="img" aria-label="{}" viewBox="0 0 {w} {h}" width="{w}" height="{h}">{}</svg>"#,
            escape(label),
            self.body
        )
    }

    fn close(&mut self, element: &str, hint: Option<&str>) {
        let _ = match hint {
            Some(hint) => write!(self.body, "><title>{}</title></{element}>", escape(hint)),
            None => write!(self.body, "/>"),
        };
    }
}

impl Anchor {
    fn class(self) -> &'static str {
        match self {
            Self::Start => "",
            Self::Middle => " mid",
            Self::End => " end",
        }
    }
}

/// A path's `d`: absolute moves, relative lines, in tenths of a pixel without accumulated rounding.
#[derive(Debug, Default)]
pub(super) struct Path {
    d: String,
    at: (i64, i64),
}

impl Path {
    /// An empty path.
    pub(super) fn new() -> Self {
        Self::default()
    }

    /// Adds an open polyline; a point that is not finite breaks it, a lonely point becomes a dot.
    pub(super) fn line(mut self, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut run = 0;
        for point in points {
            if point.0.is_finite() && point.1.is_finite() {
                if run == 0 {
                    self.start(point)
                } else {
                    self.to(point)
                }
                run += 1;
            } else {
                self.end(run);
                run = 0;
            }
        }
        self.end(run);
        self
    }

    /// Adds a closed polygon.
    pub(super) fn polygon(self, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut path = self.line(points);
        path.d.push('z');
        path
    }

    /// Adds a dot, drawn by a round line cap.
    pub(super) fn dot(mut self, point: (f64, f64)) -> Self {
        if point.0.is_finite() && point.1.is_finite() {
            self.start(point);
            self.d.push_str("h0");
        }
        self
    }

    /// The value of the attribute.
    pub(super) fn finish(self) -> String {
        self.d
    }

    fn end(&mut self, run: usize) {
        if run == 1 {
            self.d.push_str("h0");
        }
    }

    fn start(&mut self, point: (f64, f64)) {
        self.at = (tenths(point.0), tenths(point.1));
        let _ = write!(self.d, "M{} {}", decimal(self.at.0), decimal(self.at.1));
    }

    fn to(&mut self, point: (f64, f64)) {
        let next = (tenths(point.0), tenths(point.1));
        let (dx, dy) = (next.0 - self.at.0, next.1 - self.at.1);
        self.at = next;
        let space = if dy < 0 { "" } else { " " };
        let _ = write!(self.d, "l{}{space}{}", decimal(dx), decimal(dy));
    }
}

/// A coordinate in tenths, kept where browsers still draw.
fn tenths(x: f64) -> i64 {
    (x.clamp(-1e5, 1e5) * 10.0).round() as i64
}

fn decimal(tenths: i64) -> String {
    match tenths % 10 {
        0 => (tenths / 10).to_string(),
        digit => {
            let sign = if tenths < 0 { "-" } else { "" };
            let whole = (tenths / 10).abs();
            if whole == 0 {
                format!("{sign}.{}", digit.abs())
            } else {
                format!("{sign}{whole}.{}", digit.abs())
            }
        }
    }
}

fn short(x: f64) -> String {
    decimal(tenths(if x.is_finite() { x } else { 0.0 }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_short_and_do_not_drift() {
        assert_eq!(
            Path::new()
                .line([(0.04, 10.0), (0.5, 9.75), (-3.0, 9.75)])
                .finish(),
            "M0 10l.5-.2l-3.5 0"
        );
        // Each step is 0.04: rounding every step on its own would stay at 0.
        let path = Path::new()
            .line((0..=1000).map(|i| (0.04 * f64::from(i), 0.0)))
            .finish();
        let end: f64 = path
            .split('l')
            .skip(1)
            .map(|step| step.split(' ').next().unwrap().parse::<f64>().unwrap())
            .sum();
        assert!((end - 40.0).abs() < 1e-9, "{end}");
    }

    #[test]
    fn a_gap_breaks_the_line() {
        assert_eq!(
            Path::new()
                .line([
                    (0.0, 0.0),
                    (1.0, 1.0),
                    (f64::NAN, 2.0),
                    (3.0, 3.0),
                    (4.0, 2.5)
                ])
                .finish(),
            "M0 0l1 1M3 3l1-.5"
        );
        assert_eq!(
            Path::new()
                .line([(0.0, 0.0), (f64::NAN, 1.0), (2.0, 2.0)])
                .finish(),
            "M0 0h0M2 2h0"
        );
        assert_eq!(
            Path::new()
                .dot((f64::INFINITY, 1.0))
                .dot((2.0, 1.0))
                .finish(),
            "M2 1h0"
        );
    }

    #[test]
    fn texts_and_labels_are_escaped() {
        let mut svg = Svg::new(10.0, 10.0);
        svg.text("t", (1.0, 2.0), Anchor::Middle, "<script>");
        svg.rect("k", (0.0, 0.0), (1.0, f64::NAN), Some("a \"b\""));
        let text = svg.finish("x\"><script>");
        assert!(!text.contains("<script>"), "{text}");
        assert!(
            text.contains("&lt;script&gt;</text>")
                && text.contains("<title>a &quot;b&quot;</title>"),
            "{text}"
        );
        assert!(text.contains(r#"height="0""#));
    }
}
