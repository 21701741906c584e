//! What the loop of an unknown plant shall be like.

use crate::control::polynomial::product;
use crate::{Error, Real};

/// The response that is wanted of a plant that is not known yet.
///
/// ```text
/// A_m = 1 - 2 e^(-ζω) cos(ω √(1 - ζ²)) q⁻¹ + e^(-2ζω) q⁻²,   A_o = 1 - p q⁻¹
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "T: Real"))]
pub struct ResponseWanted<T> {
    /// ω, the natural frequency of the response to the set point, in rad a sample; a response that settles within n
    /// samples has about 4/(ζ n).
    pub frequency: T,
    /// ζ, above 0 and at most 1. 0.7 passes by a few per cent, 1 not at all.
    pub damping: T,
    /// p, from 0 to below 1: how fast loads and errors of the model are forgotten, from one sample to slowly. Near to 1
    /// the loop bears more error of the model, and is quieter.
    pub observer: T,
}

impl<T: Real> ResponseWanted<T> {
    pub(super) fn check(&self) -> Result<(), Error> {
        let (zero, one) = (T::zero(), T::one());
        let checks = [
            ("frequency", self.frequency > zero && self.frequency <= T::pi(), "above 0 and at most pi"),
            ("damping", self.damping > zero && self.damping <= one, "above 0 and at most 1"),
            ("observer", self.observer >= zero && self.observer < one, "0 or more and below 1"),
        ];
        for (argument, holds, range) in checks {
            if !holds {
                return Err(Error::OutOfRange { argument, range });
            }
        }
        Ok(())
    }

    /// A_m.
    pub fn response(&self) -> [T; 3] {
        let two = T::one() + T::one();
        let decay = (-self.damping * self.frequency).exponential();
        let turn = self.frequency * (T::one() - self.damping * self.damping).sqrt();
        let (_, cosine) = turn.sine_and_cosine();
        [T::one(), -two * decay * cosine, decay * decay]
    }

    /// A_o.
    pub fn observer(&self) -> [T; 2] {
        [T::one(), -self.observer]
    }

    /// What is tried in its place where a model does not bear it: slower and more damped responses; at last, where `a`
    /// is stable, its own poles, with a slow integral. `None` where there are no more.
    ///
    /// Last because the response to a set point is the plant's then. But where poles are faster than the response that
    /// is wanted, and hardly damped, it takes a model that is nearly right to damp them.
    ///
    /// Where the model has a C, each is tried with it as a factor of A_o, and then without.
    pub(super) fn candidate<'a>(&self, index: usize, a: &'a [T], c: &'a [T]) -> Option<Candidate<'a, T>> {
        // In hundredths: of the frequency; the least damping and the least pole of A_o.
        const SLOWER: [(usize, usize, usize); 11] = [
            (100, 0, 0),
            (100, 70, 50),
            (70, 70, 0),
            (70, 80, 60),
            (50, 80, 30),
            (50, 90, 70),
            (35, 90, 50),
            (35, 100, 80),
            (25, 100, 60),
            (25, 100, 85),
            (12, 100, 90),
        ];
        const INTEGRAL: [usize; 4] = [50, 75, 90, 97];
        let (index, noise) = match c {
            [first, _, ..] if !index.is_multiple_of(2) => (index / 2, core::slice::from_ref(first)),
            [_, _, ..] => (index / 2, c),
            _ => (index, c),
        };
        let part = |hundredths| T::from_count(hundredths) / T::from_count(100);
        if let Some((slower, damping, observer)) = SLOWER.get(index) {
            let wanted = ResponseWanted {
                frequency: self.frequency * part(*slower),
                damping: self.damping.max(part(*damping)),
                observer: self.observer.max(part(*observer)),
            };
            let (response, observer) = (wanted.response(), wanted.observer());
            return Some(Candidate { own: None, response, observer, noise });
        }
        let observer = part(*INTEGRAL.get(index - SLOWER.len())?);
        Some(Candidate { own: Some(a), response: [T::one(); 3], observer: [T::one(), -observer], noise })
    }
}

/// Poles that are tried.
pub(super) struct Candidate<'a, T> {
    /// A of the model, where its own poles stay.
    pub(super) own: Option<&'a [T]>,
    response: [T; 3],
    observer: [T; 2],
    /// C of the model, or 1.
    noise: &'a [T],
}

impl<T: Real> Candidate<'_, T> {
    /// A_m.
    pub(super) fn response(&self) -> &[T] {
        self.own.unwrap_or(&self.response)
    }

    /// A_o, in a buffer. A pole at 0 takes no coefficient.
    pub(super) fn observer<'b>(&self, buffer: &'b mut [T]) -> &'b [T] {
        let observer = match &self.observer {
            [first, pole] if pole.is_zero() => core::slice::from_ref(first),
            both => both,
        };
        let powers = self.noise.len() + observer.len() - 1;
        let whole = buffer.get_mut(..powers).unwrap_or_default();
        for (power, entry) in whole.iter_mut().enumerate() {
            *entry = product(self.noise, observer, power);
        }
        whole
    }
}
