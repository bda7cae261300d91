//! One panel of a figure: a frame with axes, grid, labels, and the series drawn into it.

use super::scale::Scale;
use super::svg::{Anchor, Path, Svg};
use super::text::{shorten, text_width};

/// Size of the text on axes, px.
const TICK: f64 = 11.0;

/// A frame inside an image: pixels of its edges, and the scales of its axes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Panel {
    pub(super) x: Scale,
    pub(super) y: Scale,
}

/// Where a panel stands in its image, px.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) right: f64,
    pub(super) bottom: f64,
}

impl Frame {
    /// The frame of an image of `width` × `height` that leaves room for axis labels and y ticks as long as those of `y`.
    pub(super) fn inside(width: f64, height: f64, y: (f64, f64)) -> Self {
        let (top, bottom) = (10.0, height - 40.0);
        let longest = Scale::new(y, (0.0, 1.0))
            .ticks(y_ticks(bottom - top))
            .iter()
            .map(|(_, text)| text_width(text, TICK))
            .fold(14.0, f64::max);
        Self {
            left: longest + 28.0,
            top,
            right: width - 10.0,
            bottom,
        }
    }
}

impl Panel {
    /// A panel over exactly these domains.
    pub(super) fn new(frame: Frame, x: (f64, f64), y: (f64, f64)) -> Self {
        Self {
            x: Scale::new(x, (frame.left, frame.right)),
            y: Scale::new(y, (frame.bottom, frame.top)),
        }
    }

    /// Pixel of a data point.
    pub(super) fn at(&self, x: f64, y: f64) -> (f64, f64) {
        (self.x.at(x), self.y.at(y))
    }

    /// Grid, ticks and axis labels.
    pub(super) fn axes(&self, svg: &mut Svg, x_label: &str, y_label: &str) {
        let (left, right) = self.x.range;
        let (bottom, top) = self.y.range;
        for (value, label) in self.y.ticks(y_ticks(bottom - top)) {
            let y = self.y.at(value);
            svg.line("g", (left, y), (right, y));
            svg.text("t", (left - 6.0, y + 3.8), Anchor::End, &label);
        }
        let widest = self
            .x
            .ticks(6)
            .iter()
            .map(|(_, text)| text_width(text, TICK))
            .fold(20.0, f64::max);
        for (value, label) in self
            .x
            .ticks(((right - left) / (widest + 30.0)).clamp(2.0, 10.0) as usize)
        {
            let x = self.x.at(value);
            svg.line("g", (x, top), (x, bottom));
            // The outermost labels stay inside the image.
            let anchor = if x + 0.5 * text_width(&label, TICK) > right + 10.0 {
                Anchor::End
            } else {
                Anchor::Middle
            };
            svg.text("t", (x, bottom + 16.0), anchor, &label);
        }
        svg.line("a", (left, bottom), (right, bottom));
        svg.text(
            "l",
            (0.5 * (left + right), bottom + 33.0),
            Anchor::Middle,
            &shorten(x_label, right - left, TICK),
        );
        svg.text_up(
            "l",
            (12.0, 0.5 * (top + bottom)),
            Anchor::Middle,
            &shorten(y_label, bottom - top + 20.0, TICK),
        );
    }

    /// A line through the points.
    pub(super) fn line(
        &self,
        svg: &mut Svg,
        class: &'static str,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) {
        svg.path(
            class,
            Path::new().line(points.into_iter().map(|(x, y)| self.at(x, y))),
        );
    }

    /// Dots at the points.
    pub(super) fn dots(
        &self,
        svg: &mut Svg,
        class: &'static str,
        points: impl IntoIterator<Item = (f64, f64)>,
    ) {
        let path = points
            .into_iter()
            .fold(Path::new(), |path, (x, y)| path.dot(self.at(x, y)));
        svg.path(class, path);
    }

    /// The area between `(x, low, high)`; it ends and starts again where a value is not finite.
    pub(super) fn band(&self, svg: &mut Svg, class: &'static str, points: &[(f64, f64, f64)]) {
        let mut path = Path::new();
        for run in
            points.split(|(x, low, high)| !(x.is_finite() && low.is_finite() && high.is_finite()))
        {
            if run.len() > 1 {
                let there = run.iter().map(|&(x, low, _)| self.at(x, low));
                let back = run.iter().rev().map(|&(x, _, high)| self.at(x, high));
                path = path.polygon(there.chain(back));
            }
        }
        svg.path(class, path);
    }
}

/// How many ticks a y axis of this many pixels gets.
fn y_ticks(height: f64) -> usize {
    (height / 26.0).clamp(2.0, 7.0) as usize
}

/// At most `2 × buckets` points of a line that keep its extremes: first the smaller, then the larger of each bucket in
/// the order of time. Lines that are short enough stay as they are.
pub(super) fn thin(points: &[(f64, f64)], buckets: usize) -> Vec<(f64, f64)> {
    let size = points.len().div_ceil(buckets.max(1));
    if size <= 2 {
        return points.to_vec();
    }
    let mut out = Vec::with_capacity(2 * buckets + 2);
    for bucket in points.chunks(size) {
        // A break in the line stays a break.
        if bucket.iter().any(|(_, y)| !y.is_finite()) {
            out.extend(bucket.iter().copied());
            continue;
        }
        let low = (0..bucket.len())
            .min_by(|&a, &b| bucket[a].1.total_cmp(&bucket[b].1))
            .unwrap_or(0);
        let high = (0..bucket.len())
            .max_by(|&a, &b| bucket[a].1.total_cmp(&bucket[b].1))
            .unwrap_or(0);
        out.push(bucket[low.min(high)]);
        if low != high {
            out.push(bucket[low.max(high)]);
        }
    }
    out
}

/// At most `buckets` points of a band: the lowest low and the highest high of each bucket, at its middle.
pub(super) fn thin_band(points: &[(f64, f64, f64)], buckets: usize) -> Vec<(f64, f64, f64)> {
    let size = points.len().div_ceil(buckets.max(1));
    if size <= 1 {
        return points.to_vec();
    }
    points
        .chunks(size)
        .map(|bucket| {
            if bucket
                .iter()
                .any(|(_, low, high)| !(low.is_finite() && high.is_finite()))
            {
                return (bucket[0].0, f64::NAN, f64::NAN);
            }
            let low = bucket.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
            let high = bucket.iter().map(|p| p.2).fold(f64::NEG_INFINITY, f64::max);
            (bucket[bucket.len() / 2].0, low, high)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_order_extremes_and_breaks() {
        let mut line: Vec<(f64, f64)> = (0..10_000)
            .map(|i| (f64::from(i), (f64::from(i) * 0.01).sin()))
            .collect();
        line[4321].1 = 7.5;
        line[8765].1 = -7.5;
        let thinned = thin(&line, 300);
        assert!(thinned.len() <= 600, "{}", thinned.len());
        assert!(thinned.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert!(thinned.contains(&(4321.0, 7.5)) && thinned.contains(&(8765.0, -7.5)));
        assert_eq!(thin(&line[..500], 300), line[..500]);

        line[100].1 = f64::NAN;
        assert!(thin(&line, 300).iter().any(|(_, y)| y.is_nan()));
    }

    #[test]
    fn a_thinned_band_contains_the_band() {
        let band: Vec<_> = (0..5000)
            .map(|i| (f64::from(i), -(f64::from(i % 7)), f64::from(i % 11)))
            .collect();
        let thinned = thin_band(&band, 400);
        assert!(thinned.len() <= 400);
        assert!(
            thinned
                .iter()
                .all(|&(_, low, high)| low == -6.0 && high == 10.0)
        );
    }

    #[test]
    fn a_band_breaks_where_a_value_is_missing() {
        let frame = Frame {
            left: 0.0,
            top: 0.0,
            right: 10.0,
            bottom: 10.0,
        };
        let panel = Panel::new(frame, (0.0, 10.0), (0.0, 10.0));
        let mut svg = Svg::new(10.0, 10.0);
        let gap = (2.0, f64::NAN, 1.0);
        panel.band(
            &mut svg,
            "b",
            &[
                (0.0, 1.0, 2.0),
                (1.0, 1.0, 2.0),
                gap,
                (3.0, 1.0, 2.0),
                (4.0, 1.0, 2.0),
            ],
        );
        let text = svg.finish("");
        assert_eq!(text.matches('z').count(), 2, "{text}");
    }
}
