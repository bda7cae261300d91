//! A symmetric matrix in a file: its lower triangle, row by row.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub(super) fn serialize<S: Serializer>(matrix: &[f64], to: S) -> Result<S::Ok, S::Error> {
    let size = matrix.len().isqrt();
    let rows = (0..size).flat_map(|row| &matrix[row * size..=row * (size + 1)]);
    rows.collect::<Vec<_>>().serialize(to)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
    let own: Vec<f64> = Deserialize::deserialize(from)?;
    let size = ((8 * own.len() + 1).isqrt().saturating_sub(1)) / 2;
    if size * (size + 1) / 2 != own.len() {
        return Err(D::Error::custom("no triangle of a matrix"));
    }
    let at = |row: usize, column: usize| {
        let (low, high) = (row.min(column), row.max(column));
        own[high * (high + 1) / 2 + low]
    };
    let places = (0..size * size).map(|place| at(place / size.max(1), place % size.max(1)));
    Ok(places.collect())
}

#[cfg(test)]
mod tests {
    #[derive(serde::Serialize, serde::Deserialize)]
    struct Held(#[serde(with = "super")] Vec<f64>);

    #[test]
    fn a_matrix_comes_back() {
        let three = vec![2.0, -1.0, 0.5, -1.0, 4.0, 7.0, 0.5, 7.0, 9.0];
        for matrix in [vec![], vec![3.0], three] {
            let text = serde_json::to_string(&Held(matrix.clone())).expect("text");
            let back: Held = serde_json::from_str(&text).expect(&text);
            assert_eq!(back.0, matrix);
        }
        assert!(serde_json::from_str::<Held>("[1.0, 2.0]").is_err());
    }
}
