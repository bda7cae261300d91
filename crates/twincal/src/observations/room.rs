//! Rows of consecutive parts of a log as one, in memory that is taken once.

use super::columns::Shelved;
use super::{JointObservations, Observations};
use crate::error::Result;
use crate::signal::{Numbers, Shelf};
use std::sync::Arc;

/// Room for the rows of a log, column by column; what is not filled is never touched.
#[derive(Debug)]
pub(crate) struct Room {
    /// Rows that there is room for.
    most: usize,
    rows: Observations,
    /// Where columns go that need not stay in memory.
    shelf: Option<Arc<dyn Shelf>>,
}

impl Room {
    /// For `most` rows; with a shelf columns go there.
    pub(crate) fn new(most: usize, shelf: Option<Arc<dyn Shelf>>) -> Self {
        Self {
            shelf,
            most: most.max(1),
            rows: Observations::default(),
        }
    }

    /// Puts the next part behind those before.
    ///
    /// # Errors
    /// Those of [`Shelf::put`].
    pub(crate) fn append(&mut self, part: Observations) -> Result<()> {
        let (from, len) = (self.rows.len(), part.len());
        let all = &mut self.rows;
        all.log = part.log;
        all.cutoff = all.cutoff.max(part.cutoff);
        all.starts
            .extend(part.starts.iter().map(|start| start + from));
        all.time.extend(part.time);
        for (to, from) in [
            (&mut all.q, part.q),
            (&mut all.qd, part.qd),
            (&mut all.qdd, part.qdd),
        ] {
            to.resize(from.len(), Numbers::default());
            for (to, from) in to.iter_mut().zip(from) {
                if let Some(shelf) = &self.shelf {
                    to.put_away(shelf)?;
                }
                to.append(&from.get())?;
            }
        }
        if from + len > self.most {
            self.widen(2 * (from + len));
        }
        let most = self.most;
        self.rows
            .joints
            .resize(part.joints.len(), JointObservations::default());
        for (to, mut part) in self.rows.joints.iter_mut().zip(part.joints) {
            if let Some(shelf) = &self.shelf {
                let signals = part.signals();
                let new = || Shelved::new(shelf.clone(), signals);
                let x = std::mem::take(&mut part.x);
                to.shelved.get_or_insert_with(new).append(&x, len)?;
                to.columns.clone_from(&part.columns);
                to.recipes.clone_from(&part.recipes);
            } else {
                to.append_columns(&part, from, len, most);
            }
            if let Some(shelf) = &self.shelf {
                to.measured.put_away(shelf)?;
                to.nominal.put_away(shelf)?;
            }
            to.has_products = part.has_products;
            to.append(part, from, len, most)?;
        }
        Ok(())
    }

    /// Takes more room than was asked for first.
    fn widen(&mut self, most: usize) {
        for joint in self.rows.joints.iter_mut().filter(|j| j.shelved.is_none()) {
            let mut x = vec![0.0; joint.signals() * most];
            for (to, from) in x
                .chunks_exact_mut(most)
                .zip(joint.x.chunks_exact(self.most))
            {
                to[..self.most].copy_from_slice(from);
            }
            joint.x = x;
        }
        self.most = most;
    }

    /// The rows that there are.
    pub(crate) fn into_rows(mut self) -> Observations {
        let len = self.rows.len();
        for joint in self.rows.joints.iter_mut().filter(|j| j.shelved.is_none()) {
            for column in 0..joint.signals() {
                let from = column * self.most;
                joint.x.copy_within(from..from + len, column * len);
            }
            joint.x.truncate(joint.signals() * len);
            joint.x.shrink_to_fit();
        }
        self.rows
    }
}

impl JointObservations {
    /// Puts the columns of `len` rows behind the `from` that there are, with room for `most`.
    fn append_columns(&mut self, part: &Self, from: usize, len: usize, most: usize) {
        if self.x.is_empty() {
            self.x = vec![0.0; part.signals() * most];
            self.columns.clone_from(&part.columns);
            self.recipes.clone_from(&part.recipes);
        }
        for (to, values) in (self.x.chunks_exact_mut(most)).zip(part.x.chunks_exact(len.max(1))) {
            to[from..from + len].copy_from_slice(values);
        }
    }

    /// Puts the rest of `len` rows behind the `from` that there are, with room for `most`.
    fn append(&mut self, part: Self, from: usize, len: usize, most: usize) -> Result<()> {
        // Taken once: vectors that grow beside chapters that come and go leave holes that nothing fits into.
        self.measured.reserve(most);
        self.nominal.reserve(most);
        self.y.reserve_exact(most.saturating_sub(self.y.len()));
        self.standstill
            .reserve_exact(most.saturating_sub(self.standstill.len()));
        // A temperature that is missing in one part is missing in all.
        if part.temperature.len() == len && self.temperature.len() == from {
            self.temperature.extend(part.temperature);
        } else {
            self.temperature.clear();
        }
        self.measured.append(&part.measured.get())?;
        self.nominal.append(&part.nominal.get())?;
        self.y.extend(part.y);
        self.standstill.extend(part.standstill);
        self.spread.extend(part.spread);
        self.weight.extend(part.weight);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::observe;
    use super::*;
    use crate::robot::{
        Inertia, JointDescription, JointKind, LinkDescription, Robot, RobotDescription,
    };
    use crate::signal::{Corrections, DerivedFrom, Payload, Pipeline, Segment, Trajectory};
    use crate::term::{Family, Library, LibrarySettings, Recipes};

    fn part(first: usize, len: usize) -> Observations {
        let value = |column: usize| (0..len).map(move |row| (100 * column + first + row) as f64);
        let joint = |columns: Vec<usize>| JointObservations {
            x: columns.iter().flat_map(|column| value(*column)).collect(),
            measured: value(7).collect::<Vec<_>>().into(),
            nominal: value(8).collect::<Vec<_>>().into(),
            y: value(9).collect(),
            standstill: (0..len)
                .map(|row| (first + row).is_multiple_of(3))
                .collect(),
            temperature: value(10).collect(),
            columns,
            ..JointObservations::default()
        };
        let of_parts = JointObservations {
            x: [1, 3, 4].into_iter().flat_map(value).collect(),
            recipes: Some(Arc::new(Recipes::new(
                3,
                vec![vec![(0, 1.0), (2, -1.0)], vec![(1, 2.0)]],
            ))),
            ..joint(vec![1, 4])
        };
        let motion: Vec<Numbers> = [1, 2]
            .map(|c| value(c).collect::<Vec<f64>>().into())
            .to_vec();
        Observations {
            log: "run".into(),
            cutoff: 0.4,
            time: value(0).collect(),
            starts: (0..2).map(|i| i * len / 2).filter(|_| len > 0).collect(),
            q: motion.clone(),
            qd: motion.clone(),
            qdd: motion,
            joints: vec![joint(vec![0, 2, 5]), joint(Vec::new()), of_parts],
        }
    }

    #[test]
    fn parts_behind_each_other_are_the_whole_however_much_room_there_was() {
        let mut whole = part(0, 26);
        whole.starts = vec![0, 5, 10, 15, 20, 23];
        for most in [0, 7, 26, 1000] {
            let mut room = Room::new(most, None);
            for (first, len) in [(0, 0), (0, 10), (10, 10), (20, 0), (20, 6), (26, 0)] {
                room.append(part(first, len)).unwrap();
            }
            assert_eq!(room.into_rows(), whole, "room for {most}");
        }
    }

    /// Numbers behind each other.
    #[derive(Debug, Default)]
    struct Attic(std::sync::Mutex<Vec<f64>>);

    impl Shelf for Attic {
        fn put(&self, numbers: &[f64]) -> Result<u64> {
            let mut all = self.0.lock().unwrap();
            all.extend_from_slice(numbers);
            Ok((all.len() - numbers.len()) as u64)
        }

        fn get(&self, place: u64, skip: usize, numbers: &mut [f64]) {
            let all = self.0.lock().unwrap();
            numbers.copy_from_slice(&all[place as usize + skip..][..numbers.len()]);
        }

        fn failure(&self) -> Option<crate::error::Error> {
            None
        }
    }

    /// Columns that are dropped while the rest lies on a shelf, over several blocks and from the middle of one on.
    #[test]
    fn columns_on_a_shelf_are_dropped_as_in_memory() {
        let parts = [(0, 700), (700, 300), (1000, 40)];
        let filled = |shelf: Option<Arc<dyn Shelf>>| {
            let mut room = Room::new(1040, shelf);
            for (first, len) in parts {
                room.append(part(first, len)).unwrap();
            }
            let mut rows = room.into_rows();
            rows.drop_columns(&[2]);
            rows
        };
        let (memory, shelf) = (filled(None), filled(Some(Arc::new(Attic::default()))));
        assert_eq!(memory.joints[0].columns, [0, 4]);
        assert_eq!(shelf.joints[0].columns, [0, 4]);
        assert!(shelf.joints[0].x.is_empty() && memory.q == shelf.q);
        for range in [0..1040, 250..731, 256..512, 1039..1040, 5..5] {
            let of = |rows: &Observations| {
                let mut columns = vec![Vec::new(); 2];
                rows.joints[0].visit_columns(1040, range.clone(), &mut |piece, values| {
                    for (i, column) in columns.iter_mut().enumerate() {
                        column.extend_from_slice(values.of(i, 0, piece.len()));
                    }
                });
                columns
            };
            let expected: Vec<Vec<f64>> = [0, 5]
                .map(|column| {
                    range
                        .clone()
                        .map(|row| (100 * column + row) as f64)
                        .collect()
                })
                .to_vec();
            assert_eq!(of(&shelf), expected, "{range:?}");
            assert_eq!(of(&memory), expected, "{range:?}");
        }
    }

    /// A hanging arm of two links and candidates whose columns are more than the parts that they are made of.
    fn arm() -> (Robot, Library) {
        let (com, tensor) = (
            [0.5, 0.1, 0.0],
            [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]],
        );
        let link = |(name, mass): (&str, f64)| LinkDescription {
            name: name.into(),
            inertia: (mass > 0.0).then_some(Inertia { mass, com, tensor }),
        };
        let joint = |(name, from, to)| JointDescription::new(name, JointKind::Revolute, from, to);
        let mut description = RobotDescription {
            name: "arm".into(),
            gravity: [0.0, -9.81, 0.0],
            links: [("base", 0.0), ("upper", 3.0), ("fore", 2.0)]
                .map(link)
                .to_vec(),
            joints: [("shoulder", "base", "upper"), ("elbow", "upper", "fore")]
                .map(joint)
                .to_vec(),
            allow_unphysical: false,
        };
        description.joints[1].placement.translation = com;
        let (robot, _) = Robot::new(description, &Default::default()).unwrap();
        let settings = LibrarySettings {
            families: vec![Family::Payload, Family::MassMoments, Family::Viscous],
            generic: Some(false),
            ..LibrarySettings::default()
        };
        let library = Library::propose(&robot, &settings).unwrap().0;
        (robot, library)
    }

    /// `samples` at 100 Hz from `from` s on.
    fn motion(from: f64, samples: usize, payload_acts: bool) -> Trajectory {
        let time: Vec<f64> = (0..samples).map(|i| from + 0.01 * i as f64).collect();
        let wave = |f: fn(f64, f64) -> f64| -> Vec<f64> {
            let joint = |j: usize| time.iter().map(move |t| f(*t, 1.0 + j as f64));
            (0..2).flat_map(joint).collect()
        };
        let segment = Segment {
            q: wave(|t, a| (a * t).sin()),
            qd: wave(|t, a| a * (a * t).cos()),
            qdd: wave(|t, a| -a * a * (a * t).sin()),
            tau: wave(|t, a| a + t.cos()),
            standstill: vec![false; 2 * samples],
            history: Vec::new(),
            input_rows: (0..samples).collect(),
            logged: None,
            interval: 0.01,
            logged_interval: 0.01,
            time,
        };
        Trajectory {
            name: "run".into(),
            dof: 2,
            segments: vec![segment],
            payload: Payload::None,
            payload_acts,
        }
    }

    /// A chapter that is shorter than the filter has no rows: first, in the middle, at the end, in memory and on a shelf, whether the
    /// payload acts or not.
    #[test]
    fn a_part_without_rows_changes_nothing_wherever_it_stands() {
        let (robot, library) = arm();
        let pipeline = Pipeline {
            cutoff_hz: 5.0,
            motion_cutoff_hz: 20.0,
            rate_hz: 12.5,
            motion_interval: 0.0,
            coulomb_velocity: 0.02,
            standstill_velocity: vec![0.02; 2],
            derived_from: vec![DerivedFrom::Position; 2],
            velocity_from: Vec::new(),
            corrections: Corrections::default(),
            history: Vec::new(),
        };
        for (acts, most) in [(true, 0), (true, 1000), (false, 1000)] {
            let rows = |from: f64, samples: usize| {
                observe(&robot, &library, &pipeline, &motion(from, samples, acts)).unwrap()
            };
            let parts = [rows(0.0, 700), rows(7.0, 900)];
            let empty = rows(16.0, 50);
            assert!(empty.is_empty() && parts.iter().all(|part| part.len() > 50));
            for joint in &parts[0].joints {
                assert_ne!(joint.signals(), joint.columns.len(), "no parts to speak of");
            }
            let filled = |at: Option<usize>, shelf: Option<Arc<dyn Shelf>>| {
                let mut room = Room::new(most, shelf);
                for i in 0..=parts.len() {
                    if at == Some(i) {
                        room.append(empty.clone()).unwrap();
                    }
                    if let Some(part) = parts.get(i) {
                        room.append(part.clone()).unwrap();
                    }
                }
                room.into_rows()
            };
            let shelf = || Some(Arc::new(Attic::default()) as Arc<dyn Shelf>);
            let (memory, away) = (filled(None, None), filled(None, shelf()));
            let beta: Vec<f64> = (1..=library.columns().len()).map(|k| k as f64).collect();
            for at in 0..=parts.len() {
                assert_eq!(filled(Some(at), None), memory, "part {at}");
                let found = filled(Some(at), shelf());
                for (joint, wanted) in away.joints.iter().enumerate() {
                    assert_eq!(found.joints[joint].recipes, wanted.recipes, "part {at}");
                    let residual =
                        |rows: &Observations| rows.whole().residual(joint, &beta, 0..rows.len());
                    assert_eq!(residual(&found), residual(&memory), "part {at}");
                }
                assert_eq!(found.whole().gram(), away.whole().gram(), "part {at}");
            }
        }
    }
}
