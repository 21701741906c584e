//! Words that stand for numbers or for missing values.

/// Two words for off and on, in lower case: 0 and 1.
const STATES: [[&[u8]; 2]; 13] = [
    [b"false", b"true"],
    [b"off", b"on"],
    [b"no", b"yes"],
    [b"closed", b"open"],
    [b"close", b"open"],
    [b"low", b"high"],
    [b"disabled", b"enabled"],
    [b"stopped", b"running"],
    [b"stop", b"run"],
    [b"inactive", b"active"],
    [b"aus", b"ein"],
    [b"falsch", b"wahr"],
    [b"nein", b"ja"],
];

/// What historians, spreadsheets and home automation write where a sensor gave no value, in lower case.
const STATUSES: [&[u8]; 48] = [
    b"bad",
    b"bad input",
    b"bad data",
    b"bad value",
    b"bad quality",
    b"i/o timeout",
    b"io timeout",
    b"timeout",
    b"scan off",
    b"scan timeout",
    b"no data",
    b"nodata",
    b"no value",
    b"no sample",
    b"no result",
    b"not available",
    b"not connected",
    b"pt created",
    b"intf shut",
    b"comm fail",
    b"comm error",
    b"calc failed",
    b"out of service",
    b"out of serv",
    b"arc off-line",
    b"off-line",
    b"offline",
    b"shutdown",
    b"configure",
    b"unavailable",
    b"unknown",
    b"undefined",
    b"none",
    b"invalid",
    b"fail",
    b"failed",
    b"fault",
    b"error",
    b"#n/a",
    b"#na",
    b"#value!",
    b"#div/0!",
    b"#ref!",
    b"#num!",
    b"#null!",
    b"#name?",
    b"-",
    b"--",
];

/// What printf of some systems writes for a number that is none.
const NO_NUMBERS: [&[u8]; 4] = [b"1.#qnan", b"1.#ind", b"-1.#ind", b"-nan(ind)"];

/// A not-a-number with a status in its lowest bits.
const NAN: u64 = f64::NAN.to_bits();

/// Two words that stand for 0 and 1 in a column.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) struct States(usize);

impl States {
    /// The pairs that a word belongs to.
    pub(super) fn of(word: &[u8]) -> impl Iterator<Item = Self> {
        (0..STATES.len()).map(Self).filter(move |states| states.read(word).is_some())
    }

    /// What a word stands for; none for any other.
    pub(super) fn read(self, word: &[u8]) -> Option<f64> {
        let place = STATES[self.0].iter().position(|state| word.eq_ignore_ascii_case(state))?;
        Some(place as f64)
    }

    /// Both words, the one for 0 first.
    pub(super) fn words(self) -> [&'static str; 2] {
        STATES[self.0].map(|word| std::str::from_utf8(word).unwrap_or_default())
    }
}

/// A missing value that remembers which status stands in its place; none for any other word.
pub(super) fn status(word: &[u8]) -> Option<f64> {
    let known = STATUSES.iter().chain(&NO_NUMBERS).position(|status| word.eq_ignore_ascii_case(status))?;
    Some(f64::from_bits(NAN | (known as u64 + 1)))
}

/// How often each status stands in a column.
#[derive(Clone, Debug, Default)]
pub(super) struct Tally(Vec<(usize, usize)>);

impl Tally {
    /// Counts the statuses among values, and makes them missing values like any other.
    pub(super) fn take(&mut self, values: &mut [f64]) {
        for value in values.iter_mut().filter(|value| value.is_nan()) {
            let status = (value.to_bits() ^ NAN) as usize;
            *value = f64::NAN;
            // A sign or another payload is no status.
            if !(1..=STATUSES.len() + NO_NUMBERS.len()).contains(&status) {
                continue;
            }
            match self.0.iter_mut().find(|(known, _)| *known == status) {
                Some((_, count)) => *count += 1,
                None => self.0.push((status, 1)),
            }
        }
    }

    /// What was counted, in words; none if nothing was.
    pub(super) fn words(&self) -> Option<String> {
        let mut all = self.0.clone();
        all.sort_unstable_by_key(|&(status, count)| (std::cmp::Reverse(count), status));
        let word =
            |status: usize| STATUSES.iter().chain(&NO_NUMBERS).nth(status - 1).copied().unwrap_or_default();
        let each = all.iter().map(|&(status, count)| {
            format!(
                "'{}' ({count} {})",
                String::from_utf8_lossy(word(status)),
                if count == 1 { "row" } else { "rows" }
            )
        });
        let each: Vec<String> = each.collect();
        (!each.is_empty()).then(|| each.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_are_known_in_any_case() {
        for (word, value) in [("True", 1.0), ("OFF", 0.0), ("Open", 1.0), ("ja", 1.0), ("falsch", 0.0)] {
            let states = States::of(word.as_bytes()).next().unwrap();
            assert_eq!(states.read(word.as_bytes()), Some(value), "{word}");
        }
        assert_eq!(States::of(b"open").count(), 2);
        assert_eq!(States::of(b"auto").count(), 0);
        assert_eq!(States::of(b"on").next().unwrap().words(), ["off", "on"]);
    }

    #[test]
    fn statuses_are_counted_and_then_missing_like_others() {
        let mut values = vec![1.0, status(b"Bad").unwrap(), f64::NAN, status(b"BAD").unwrap(), -f64::NAN];
        values.push(status(b"I/O Timeout").unwrap());
        assert!(values[1].is_nan());
        let mut tally = Tally::default();
        tally.take(&mut values);
        assert_eq!(tally.words().unwrap(), "'bad' (2 rows), 'i/o timeout' (1 row)");
        assert!(values[1..].iter().all(|value| value.to_bits() == f64::NAN.to_bits()));
        assert!(Tally::default().words().is_none() && status(b"good").is_none());
    }
}
