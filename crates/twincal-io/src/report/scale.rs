//! From data to pixels: linear scales with round tick values.

use crate::words::number::number;

/// Maps `domain` linearly onto `range` (pixels).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale {
    pub(super) domain: (f64, f64),
    pub(super) range: (f64, f64),
}

impl Scale {
    /// A scale over exactly `domain`; an empty or non-finite domain becomes one of width 1 around its start (or 0).
    pub(super) fn new(domain: (f64, f64), range: (f64, f64)) -> Self {
        let (low, high) = domain;
        let domain = if low.is_finite() && high.is_finite() && high > low {
            (low, high)
        } else {
            let centre = if low.is_finite() { low } else { 0.0 };
            let half = 0.5 * centre.abs().max(1.0);
            (centre - half, centre + half)
        };
        Self { domain, range }
    }

    /// A scale over the finite `values` with 4 % of room at both ends.
    pub(super) fn over(values: impl IntoIterator<Item = f64>, range: (f64, f64)) -> Self {
        let (low, high) = extent(values);
        let room = 0.04 * (high - low);
        Self::new((low - room, high + room), range)
    }

    /// Pixel of `x`.
    pub(super) fn at(&self, x: f64) -> f64 {
        let (a, b) = self.domain;
        let (c, d) = self.range;
        c + (x - a) / (b - a) * (d - c)
    }

    /// At most about `target` round values inside the domain, each with its label.
    pub(super) fn ticks(&self, target: usize) -> Vec<(f64, String)> {
        let (low, high) = self.domain;
        let step = nice_step((high - low) / target.max(1) as f64);
        let exponent = step.log10().floor() as i32;
        let first = (low / step - 1e-9).ceil() as i64;
        let last = (high / step + 1e-9).floor() as i64;
        (first..=last)
            .map(|i| {
                let value = i as f64 * step;
                (
                    value,
                    tick_label(value, exponent, low.abs().max(high.abs())),
                )
            })
            .collect()
    }
}

/// Smallest and largest finite value; (+∞, −∞) if there is none.
pub(super) fn extent(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    values
        .into_iter()
        .filter(|x| x.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        })
}

/// The 1, 2 or 5 times a power of ten that is next above `raw`.
fn nice_step(raw: f64) -> f64 {
    let power = 10f64.powi(raw.log10().floor() as i32);
    let mantissa = raw / power;
    let nice = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|n| mantissa <= n * (1.0 + 1e-9))
        .unwrap_or(10.0);
    // 3 · 0.1 is not 0.3, but 3 / 10 is: divide by whole powers of ten.
    if power < 1.0 {
        nice / (1.0 / power).round()
    } else {
        nice * power
    }
}

fn tick_label(value: f64, step_exponent: i32, largest: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    if largest >= 1e5 || step_exponent < -4 {
        let digits = (value.abs().log10().floor() as i32 - step_exponent + 1).clamp(1, 6);
        return number(value, digits as usize);
    }
    let text = format!("{value:.*}", (-step_exponent).max(0) as usize);
    text.strip_prefix('-')
        .map_or(text.clone(), |rest| format!("−{rest}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(domain: (f64, f64), target: usize) -> Vec<String> {
        Scale::new(domain, (0.0, 1.0))
            .ticks(target)
            .into_iter()
            .map(|(_, text)| text)
            .collect()
    }

    #[test]
    fn a_scale_is_the_affine_map_between_its_ends() {
        let scale = Scale::new((-2.0, 6.0), (400.0, 0.0));
        assert_eq!(
            (scale.at(-2.0), scale.at(2.0), scale.at(6.0)),
            (400.0, 200.0, 0.0)
        );
    }

    #[test]
    fn ticks_are_round_inside_and_complete() {
        assert_eq!(
            labels((0.0, 1.0), 5),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"].map(|t| if t == "0.0" { "0" } else { t })
        );
        assert_eq!(labels((-1.3, 1.3), 5), ["−1", "0", "1"]);
        assert_eq!(labels((0.0, 27.5), 6), ["0", "5", "10", "15", "20", "25"]);
        assert_eq!(labels((0.0031, 0.0042), 4), ["0.0035", "0.0040"]);
        assert_eq!(
            labels((0.0, 3e6), 3),
            [
                "0",
                "1\u{202f}·\u{202f}10⁶",
                "2\u{202f}·\u{202f}10⁶",
                "3\u{202f}·\u{202f}10⁶"
            ]
        );
    }

    #[test]
    fn every_domain_gets_a_handful_of_increasing_ticks() {
        for exponent in -12..12 {
            for mantissa in [1.0, 1.7, 3.3, 9.99] {
                for offset in [-0.4, 0.0, 3.0] {
                    let width = mantissa * 10f64.powi(exponent);
                    let low = offset * width;
                    let ticks = Scale::new((low, low + width), (0.0, 1.0)).ticks(5);
                    assert!((2..=6).contains(&ticks.len()), "{low} + {width}: {ticks:?}");
                    assert!(
                        ticks
                            .windows(2)
                            .all(|pair| pair[0].0 < pair[1].0 && pair[0].1 != pair[1].1),
                        "{ticks:?}"
                    );
                    assert!(
                        ticks
                            .iter()
                            .all(|(x, _)| *x >= low - 1e-9 * width
                                && *x <= low + width * (1.0 + 1e-9))
                    );
                }
            }
        }
    }

    #[test]
    fn an_empty_domain_is_widened() {
        for domain in [
            (3.0, 3.0),
            (f64::INFINITY, f64::NEG_INFINITY),
            (f64::NAN, 1.0),
        ] {
            let scale = Scale::new(domain, (0.0, 100.0));
            assert!(
                scale.at(scale.domain.0) == 0.0 && scale.domain.1 > scale.domain.0,
                "{domain:?}"
            );
        }
        assert_eq!(
            Scale::over([2.0, 2.0, f64::NAN], (0.0, 100.0)).at(2.0),
            50.0
        );
    }
}
