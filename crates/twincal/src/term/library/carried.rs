//! What a library says of the payload: where it is told, which columns it has, and whether motion tells its parts apart.

use super::Library;
use crate::robot::Robot;

impl Library {
    /// The link in whose frame payloads are described.
    pub fn payload_frame<'a>(&'a self, robot: &'a Robot) -> &'a str {
        match &self.payload_frame {
            Some(name) => name,
            None => robot.last_link(),
        }
    }

    /// True if no motion tells the payload's tensor from its mass and first moments: one joint, say, or only the last one.
    pub fn payload_is_one(&self) -> bool {
        self.payload_is_one
    }

    /// `(joint, row in the joint's table)` of every column of the payload component.
    pub fn payload_entries(&self) -> Vec<(usize, usize)> {
        let is_payload = |column: usize| self.terms[self.columns[column]].family.is_payload();
        let of_joint = |(joint, columns): (usize, &Vec<usize>)| -> Vec<(usize, usize)> {
            let rows = columns.iter().enumerate();
            let own = rows.filter(|(_, column)| is_payload(**column));
            own.map(|(row, _)| (joint, row)).collect()
        };
        self.by_joint
            .iter()
            .enumerate()
            .flat_map(of_joint)
            .collect()
    }
}
