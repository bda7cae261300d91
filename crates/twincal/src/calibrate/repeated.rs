//! What two halves of the data say about a number, and about an effect with all of its numbers.

use super::result::Repeat;

/// Sd between two halves from which a number is said not to repeat: 3 in 1000 of honest ones.
pub(super) const APART: f64 = 3.0;
/// Sd between two halves from which a number is said to waver: 5 in 100 of honest ones.
const WAVERS: f64 = 2.0;
/// Probability that a half must give an effect for it to count as found there.
const HELD: f64 = 0.5;

/// How well a number of one half of the data is found again in the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Repeated {
    /// Both halves have it, less than 2 sd apart.
    Repeats,
    /// Both halves have it, 2 to 3 sd apart.
    Wavers,
    /// 3 sd apart or more.
    Differs,
    /// One half alone is more likely to have its effect than not.
    InOneHalf,
    /// Neither half alone is more likely to have its effect than not.
    InNeitherHalf,
    /// The halves leave it so wide that a difference as large as the number itself would be within 2 sd.
    TooLoose,
    /// A half leaves it as wide as the prior.
    NotSeen,
}

impl Repeated {
    /// In words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Repeats => "repeats",
            Self::Wavers => "wavers",
            Self::Differs => "does not repeat",
            Self::InOneHalf => "found in one half alone",
            Self::InNeitherHalf => "found in neither half alone",
            Self::TooLoose => "too loose to tell",
            Self::NotSeen => "not seen in both halves",
        }
    }
}

impl Repeat {
    /// What the two halves say about this number.
    #[must_use]
    pub fn repeated(&self) -> Repeated {
        self.judged(self.first_pip, self.second_pip)
    }

    /// Of an effect, by all of its numbers: it differs where one of them does, and is too loose where all that both halves see are. It is in a
    /// half where any of its columns is: the tensor of a payload may be out. [`Repeated::NotSeen`] without numbers.
    #[must_use]
    pub fn of_effect(numbers: &[Self]) -> Repeated {
        let most = |of: fn(&Self) -> f64| numbers.iter().map(of).fold(0.0, f64::max);
        let (first, second) = (most(|r| r.first_pip), most(|r| r.second_pip));
        let each = || numbers.iter().map(|number| number.judged(first, second));
        // What one number is enough for, the least sure first; then what holds of all that are seen.
        let order = [
            Repeated::Differs,
            Repeated::InNeitherHalf,
            Repeated::InOneHalf,
            Repeated::Wavers,
            Repeated::Repeats,
            Repeated::TooLoose,
        ];
        let said = order.into_iter().find(|state| each().any(|r| r == *state));
        said.unwrap_or(Repeated::NotSeen)
    }

    /// What the halves say about this number where they have its effect with these probabilities.
    fn judged(&self, first_pip: f64, second_pip: f64) -> Repeated {
        let spread = self.first_sd.hypot(self.second_sd);
        let held = [first_pip, second_pip].map(|pip| pip >= HELD);
        match self.z.map(f64::abs) {
            Some(z) if z >= APART => Repeated::Differs,
            _ if held == [false; 2] => Repeated::InNeitherHalf,
            _ if held != [true; 2] => Repeated::InOneHalf,
            None => Repeated::NotSeen,
            Some(z) if z >= WAVERS => Repeated::Wavers,
            Some(_) if WAVERS * spread > self.pooled().abs() => Repeated::TooLoose,
            Some(_) => Repeated::Repeats,
        }
    }

    /// Both halves together: the mean weighted by precision.
    fn pooled(&self) -> f64 {
        let [first, second] = [self.first_sd, self.second_sd].map(|sd| sd.powi(-2));
        (first * self.first + second * self.second) / (first + second)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(first: (f64, f64), second: (f64, f64), pip: (f64, f64)) -> Repeat {
        Repeat {
            component: "arm.viscous".into(),
            term: "arm.viscous".into(),
            unit: "N·m·s/rad".into(),
            first: first.0,
            first_sd: first.1,
            first_pip: pip.0,
            second: second.0,
            second_sd: second.1,
            second_pip: pip.1,
            z: Some((second.0 - first.0) / first.1.hypot(second.1)),
        }
    }

    #[test]
    fn what_is_too_loose_to_tell_is_not_said_to_repeat() {
        let sure = (1.0, 1.0);
        let says = |first, second| of(first, second, sure).repeated();
        // A second half of 1550 would have passed as the same number.
        assert_eq!(says((722.0, 553.0), (830.0, 555.0)), Repeated::TooLoose);
        assert_eq!(says((722.0, 55.0), (830.0, 56.0)), Repeated::Repeats);
        assert_eq!(says((722.0, 30.0), (830.0, 30.0)), Repeated::Wavers);
        assert_eq!(says((722.0, 20.0), (830.0, 20.0)), Repeated::Differs);
        assert_eq!(
            of((7.0, 0.1), (7.0, 0.1), (0.6, 0.4)).repeated(),
            Repeated::InOneHalf
        );
        assert_eq!(
            of((7.0, 0.1), (7.0, 0.1), (0.4, 0.4)).repeated(),
            Repeated::InNeitherHalf
        );
        let unseen = |pips| Repeat {
            z: None,
            ..of((0.0, 1.0), (0.0, 1.0), pips)
        };
        assert_eq!(unseen(sure).repeated(), Repeated::NotSeen);
        assert_eq!(unseen((0.1, 0.1)).repeated(), Repeated::InNeitherHalf);
        // Apart by 2.8 sd is no agreement, however loose either half is.
        assert_eq!(says((-3.0, 1.0), (1.0, 1.0)), Repeated::Wavers);
    }

    #[test]
    fn an_effect_repeats_where_one_of_its_numbers_is_sharp_enough_to_tell() {
        let sure = (1.0, 1.0);
        let (sharp, loose) = (
            of((7.0, 0.1), (7.0, 0.1), sure),
            of((0.1, 1.0), (0.2, 1.0), sure),
        );
        let apart = of((7.0, 0.1), (8.0, 0.1), sure);
        let unseen = Repeat {
            z: None,
            ..loose.clone()
        };
        assert_eq!(
            Repeat::of_effect(&[loose.clone(), sharp.clone()]),
            Repeated::Repeats
        );
        assert_eq!(
            Repeat::of_effect(&[unseen.clone(), loose]),
            Repeated::TooLoose
        );
        assert_eq!(Repeat::of_effect(&[sharp, apart]), Repeated::Differs);
        assert_eq!(Repeat::of_effect(&[unseen]), Repeated::NotSeen);
        assert_eq!(Repeat::of_effect(&[]), Repeated::NotSeen);
        // A payload's tensor may be out of both halves; the payload is in.
        let (mass, tensor) = (
            of((1.7, 0.1), (1.7, 0.1), sure),
            of((0.2, 0.1), (0.2, 0.1), (0.4, 0.4)),
        );
        assert_eq!(Repeat::of_effect(&[mass, tensor]), Repeated::Repeats);
    }
}
