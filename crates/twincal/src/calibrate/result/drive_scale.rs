//! Masses from motor currents: one unknown factor common to all drives widens what is reported of masses and moments.
//!
//! Torque that was made of currents is (1 + s)⁻¹ times the true one, s ~ N(0, sd²). In the model z, with x the nominal torque
//! (`drives.gain`), the coefficients that the true torque asks for are
//!
//! ```text
//! β(s) = A_z⁻¹ X_zᵀ (y + s (y + x)) = β + s d,    d = β + A_z⁻¹ X_zᵀ x
//! ```
//! so that a mass is off by s times all the mass, nominal and found, that its column stands for. Friction and motor inertia are in the
//! units of the logged torque and stay as they are. Nor does the prediction of logged torque change. Where columns are worked out about effects
//! (`relinearise`), x holds the torque of those as well, so that they count once less: d = β − β* + A_z⁻¹ X_zᵀ x.

use crate::error::{Code, Finding, Severity};
use crate::linear_algebra::Cholesky;
use crate::posterior::summary::ColumnSummary;
use crate::posterior::{Posterior, Problem};
use crate::random::Random;
use crate::signal::Payload;
use crate::term::{Library, ModelColumn};

/// Random stream of the factors.
const STREAM: u64 = (1 << 32) + 3;

/// What a common factor on torque does to the coefficients of inertial columns.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::calibrate) struct DriveScale {
    sd: f64,
    /// d of each column, averaged over the models that hold it; 0 for all but inertial columns.
    direction: Vec<f64>,
}

impl DriveScale {
    /// `None` where the factor is known (`sd` 0), or the library has no torque gain to tell what nominal torque looks like.
    pub(in crate::calibrate) fn new(
        sd: f64,
        library: &Library,
        problem: &Problem,
        posterior: &Posterior,
    ) -> Option<Self> {
        let count = problem.names.len();
        let all_joints = |k: &usize| {
            library.model_column(*k) == Some(&ModelColumn::Nominal { joint: None })
                || (library.joints() == 1
                    && matches!(library.model_column(*k), Some(ModelColumn::Nominal { .. })))
        };
        let nominal = (0..count).find(all_joints).filter(|_| sd > 0.0)?;
        let (mut sum, mut mass) = (vec![0.0; count], vec![0.0; count]);
        for model in &posterior.models {
            let factor = Cholesky::from_lower(model.factor.clone(), model.members.len());
            let product = |&k: &u32| problem.gram[k as usize * count + nominal];
            let mut direction: Vec<f64> = model.members.iter().map(product).collect();
            factor.solve(&mut direction);
            let pairs = direction.iter().zip(&model.mean);
            for (&k, (d, mean)) in model.members.iter().zip(pairs) {
                let about = library.about(k as usize);
                sum[k as usize] += model.weight * (d + mean - about);
                mass[k as usize] += model.weight;
            }
        }
        let inertial =
            |k: usize| matches!(library.model_column(k), Some(ModelColumn::Inertia { .. }));
        let direction = (0..count)
            .map(|k| {
                if inertial(k) && mass[k] > 0.0 {
                    sum[k] / mass[k]
                } else {
                    0.0
                }
            })
            .collect();
        Some(Self { sd, direction })
    }

    /// Widens what is known of a column.
    pub(in crate::calibrate) fn widen(&self, column: usize, summary: &mut ColumnSummary) {
        let more = self.sd * self.direction[column];
        if more == 0.0 {
            return;
        }
        let pip = summary.pip;
        summary.sd = (summary.sd * summary.sd + pip * more * more).sqrt();
        let Some(sd) = summary.conditional_sd.filter(|sd| *sd > 0.0) else {
            return;
        };
        let factor = (sd * sd + more * more).sqrt() / sd;
        summary.conditional_sd = Some(sd * factor);
        let middle = summary.conditional_median.unwrap_or(summary.mean);
        let stretch = |ends: [f64; 2]| ends.map(|end| middle + factor * (end - middle));
        summary.conditional_interval68 = summary.conditional_interval68.map(stretch);
        summary.conditional_interval95 = summary.conditional_interval95.map(stretch);
        // An end at the spike stays there.
        summary.interval95 = summary.interval95.map(|end| match end == 0.0 {
            true => end,
            false => middle + factor * (end - middle),
        });
    }

    /// Moves draws of some columns (one vector per draw, `None` for a dropped term), each by its own factor.
    pub(in crate::calibrate) fn shift(
        &self,
        columns: &[Option<usize>],
        draws: &mut [Vec<f64>],
        seed: u64,
    ) {
        if columns.iter().flatten().all(|&k| self.direction[k] == 0.0) {
            return;
        }
        let mut random = Random::new(seed, STREAM);
        for draw in draws {
            let factor = self.sd * random.normal();
            for (value, column) in draw.iter_mut().zip(columns) {
                *value += factor * column.map_or(0.0, |k| self.direction[k]);
            }
        }
    }

    /// What was done, and what would end it; `None` where no inertia was found that it could widen.
    pub(in crate::calibrate) fn finding(&self) -> Option<Finding> {
        if self.direction.iter().all(|more| *more == 0.0) {
            return None;
        }
        let share = 100.0 * self.sd;
        Some(Finding::new(
            Severity::Note,
            Code::DriveGainUncertain,
            "",
            format!(
                "torque comes from the motors: an error of {share:.0} % (sd) that all drive constants may share is in the intervals of masses, \
                 centres of mass and inertias; log two known payloads ([[log]] payload) to be rid of it, or set prior.drive_gain"
            ),
            0,
        )
        .with([("gain_sd", self.sd)]))
    }
}

/// Said where a factor on torque is unknown and nothing tells what it does to inertias.
pub(in crate::calibrate) fn ignored(
    sd: f64,
    scale: Option<&DriveScale>,
    library: &Library,
) -> Option<Finding> {
    let inertial = |k| matches!(library.model_column(k), Some(ModelColumn::Inertia { .. }));
    let asked = (0..library.columns().len()).any(inertial) && sd > 0.0;
    (asked && scale.is_none()).then(|| {
        Finding::new(
            Severity::Warning,
            Code::DriveGainIgnored,
            "prior.drive_gain",
            format!(
                "an error of {:.0} % (sd) that all drive constants may share is not in the intervals of masses: that takes `gain` among the \
                 candidates ([library] families)",
                100.0 * sd
            ),
            0,
        )
        .with([("gain_sd", sd)])
    })
}

/// The sd of the common factor that is left: none where two known payloads were logged.
pub(in crate::calibrate) fn left(sd: f64, payloads: impl Iterator<Item = Payload>) -> f64 {
    let known = payloads.filter_map(|payload| match payload {
        Payload::None => Some(0.0),
        Payload::Known { mass, .. } => Some(mass),
        Payload::Unknown => None,
    });
    let ends = known.fold(
        [f64::INFINITY, f64::NEG_INFINITY],
        |[low, high], mass: f64| [low.min(mass), high.max(mass)],
    );
    if ends[1] > ends[0] { 0.0 } else { sd }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::testing::tree;
    use crate::term::{Family, LibrarySettings};

    #[test]
    fn two_known_payloads_settle_the_factor() {
        let known = |mass| Payload::Known {
            mass,
            com: [0.0; 3],
        };
        let of = |payloads: &[Payload]| left(0.07, payloads.iter().copied());
        assert_eq!(of(&[Payload::None]), 0.07);
        assert_eq!(of(&[Payload::None, Payload::Unknown]), 0.07);
        assert_eq!(of(&[known(1.0), known(1.0)]), 0.07);
        assert_eq!(of(&[Payload::None, known(1.0)]), 0.0);
        assert_eq!(of(&[known(2.0), known(1.0)]), 0.0);
    }

    /// Without `gain` among the candidates nothing says what nominal torque looks like: that is reported, and nothing where the factor is known.
    #[test]
    fn a_factor_that_no_candidate_shows_is_reported() {
        let settings = LibrarySettings {
            families: vec![Family::Density],
            generic: Some(false),
            ..LibrarySettings::default()
        };
        let (library, _) = Library::propose(&tree(), &settings).unwrap();
        let finding = ignored(0.07, None, &library).unwrap();
        assert_eq!(finding.code, Code::DriveGainIgnored);
        assert_eq!(ignored(0.0, None, &library), None);
        let direction = vec![0.0];
        let scale = DriveScale {
            sd: 0.07,
            direction,
        };
        assert_eq!(ignored(0.07, Some(&scale), &library), None);
        assert_eq!(scale.finding(), None);
    }

    /// A mass of 1.5 ± 0.3 kg where 10 kg hang on the factor of 7 %: √(0.3² + 0.7²).
    #[test]
    fn a_mass_is_off_by_a_share_of_all_of_it() {
        let scale = DriveScale {
            sd: 0.07,
            direction: vec![10.0, 0.0],
        };
        let mut summary = ColumnSummary {
            pip: 1.0,
            pip_mcse: 0.0,
            mean: 1.5,
            sd: 0.3,
            interval95: [0.9, 2.1],
            conditional_mean: Some(1.5),
            conditional_sd: Some(0.3),
            conditional_median: Some(1.5),
            conditional_interval68: Some([1.2, 1.8]),
            conditional_interval95: Some([0.9, 2.1]),
            selected: true,
        };
        let before = summary;
        scale.widen(1, &mut summary);
        assert_eq!(summary, before);
        scale.widen(0, &mut summary);
        let sd = 0.58f64.sqrt();
        assert!((summary.sd - sd).abs() < 1e-12);
        assert!((summary.interval95[1] - (1.5 + 2.0 * sd)).abs() < 1e-12);
        let mut draws = vec![vec![1.5, 0.2]; 20_000];
        scale.shift(&[Some(0), Some(1)], &mut draws, 1);
        let square: f64 = draws.iter().map(|d| (d[0] - 1.5).powi(2)).sum();
        // Standard error of the sd 0.5 %; five of them.
        assert!(((square / 2e4).sqrt() / 0.7 - 1.0).abs() < 0.025);
        assert!(draws.iter().all(|d| d[1] == 0.2));
    }
}
