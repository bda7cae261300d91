//! How many points lie where: shaded hexagons.

use crate::report::svg::{Path, Svg};
use std::collections::BTreeMap;

/// Radius of a hexagon, px.
pub(super) const HEX: f64 = 3.6;
/// Shades of the hexagons, light to dark.
const SHADES: [&str; 5] = ["h1", "h2", "h3", "h4", "h5"];

/// Hexagons that hold points (px), darker the more they hold.
pub(super) fn hexagons(svg: &mut Svg, points: impl Iterator<Item = (f64, f64)>) {
    let bins = hexbin(points);
    let most = bins.values().copied().max().unwrap_or(1);
    for (shade, class) in SHADES.into_iter().enumerate() {
        let mut path = Path::new();
        for (&(column, row), &n) in &bins {
            if shade_of(n, most) == shade {
                let (cx, cy) = hex_centre(column, row);
                path = path.polygon((0..6).map(|corner| {
                    let angle = std::f64::consts::FRAC_PI_3 * f64::from(corner)
                        + std::f64::consts::FRAC_PI_6;
                    (cx + HEX * angle.cos(), cy + HEX * angle.sin())
                }));
            }
        }
        svg.path(class, path);
    }
}

/// Counts per hexagon of a grid with pointy tops, key (column, row).
fn hexbin(points: impl Iterator<Item = (f64, f64)>) -> BTreeMap<(i32, i32), usize> {
    let mut bins = BTreeMap::new();
    for (x, y) in points {
        // The nearest centre is in one of the two rows around y.
        let below = (y / (1.5 * HEX)).floor() as i32;
        let nearest = [below, below + 1].map(|row| {
            let shift = 0.5 * f64::from(row.rem_euclid(2));
            let column = (x / (3f64.sqrt() * HEX) - shift).round() as i32;
            let (cx, cy) = hex_centre(column, row);
            ((x - cx).powi(2) + (y - cy).powi(2), (column, row))
        });
        let key = if nearest[0].0 <= nearest[1].0 {
            nearest[0].1
        } else {
            nearest[1].1
        };
        *bins.entry(key).or_insert(0) += 1;
    }
    bins
}

fn hex_centre(column: i32, row: i32) -> (f64, f64) {
    let shift = 0.5 * f64::from(row.rem_euclid(2));
    (
        3f64.sqrt() * HEX * (f64::from(column) + shift),
        1.5 * HEX * f64::from(row),
    )
}

fn shade_of(n: usize, most: usize) -> usize {
    ((n as f64 / most as f64).sqrt() * SHADES.len() as f64).ceil() as usize - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hexagons_partition_the_plane_by_nearest_centre() {
        for i in 0..400 {
            let point = (
                f64::from(i * 37 % 101) * 0.31 - 7.0,
                f64::from(i * 53 % 89) * 0.29 - 6.0,
            );
            let bins = hexbin(std::iter::once(point));
            let (&(column, row), _) = bins.first_key_value().unwrap();
            let distance = |c, r| {
                let (cx, cy) = hex_centre(c, r);
                (point.0 - cx).hypot(point.1 - cy)
            };
            let best = (-10..10)
                .flat_map(|r| (-10..10).map(move |c| (c, r)))
                .map(|(c, r)| distance(c, r))
                .fold(f64::INFINITY, f64::min);
            assert!((distance(column, row) - best).abs() < 1e-9, "{point:?}");
        }
    }

    #[test]
    fn shades_span_their_range() {
        assert_eq!(
            (shade_of(1, 1000), shade_of(1000, 1000), shade_of(1, 1)),
            (0, 4, 4)
        );
    }
}
