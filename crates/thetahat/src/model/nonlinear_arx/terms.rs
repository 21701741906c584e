//! Products of regressors, as they are written: y(k-1)^2*u(k).

use crate::Error;

/// Factors of a product, at most.
const LONGEST: usize = 100;

/// A product by its factors, which are places of regressors in rising order; 1 of none.
pub(super) fn written(term: &[usize], regressors: &[String]) -> String {
    let mut parts: Vec<String> = Vec::new();
    let mut rest = term;
    while let Some(factor) = rest.first() {
        let power = rest.iter().take_while(|other| *other == factor).count();
        let name = regressors.get(*factor).map_or("?", String::as_str);
        parts.push(if power == 1 { name.to_owned() } else { format!("{name}^{power}") });
        rest = &rest[power..];
    }
    if parts.is_empty() { "1".to_owned() } else { parts.join("*") }
}

/// The factors of a product, of regressors with these names.
fn read(text: &str, regressors: &[String]) -> Result<Vec<usize>, Error> {
    let wrong = |what: String| Err(Error::argument("term", format!("'{text}': {what}")));
    let mut rest = text.trim();
    if rest == "1" {
        return Ok(Vec::new());
    }
    let mut factors = Vec::new();
    loop {
        // The longest name: one may begin with another.
        let named = regressors.iter().enumerate().filter(|(_, name)| rest.starts_with(name.as_str()));
        let Some((place, name)) = named.max_by_key(|(_, name)| name.len()) else {
            return wrong(format!("'{rest}' begins with none of the regressors {}", regressors.join(", ")));
        };
        rest = rest[name.len()..].trim_start();
        let mut power = 1;
        if let Some(after) = rest.strip_prefix('^') {
            let after = after.trim_start();
            let digits = after.len() - after.trim_start_matches(|digit: char| digit.is_ascii_digit()).len();
            power = match after[..digits].parse() {
                Ok(power @ 1..=LONGEST) => power,
                _ => return wrong(format!("after ^ comes a whole number from 1 to {LONGEST}")),
            };
            rest = after[digits..].trim_start();
        }
        factors.extend(std::iter::repeat_n(place, power));
        if factors.len() > LONGEST {
            return wrong(format!("it has more than {LONGEST} factors"));
        }
        if rest.is_empty() {
            factors.sort_unstable();
            return Ok(factors);
        }
        match rest.strip_prefix('*') {
            Some(after) => rest = after.trim_start(),
            None => return wrong(format!("'{rest}' is no product; write it as y(k-1)^2*u(k-1)")),
        }
    }
}

/// The factors of products that are written, of regressors with these names.
///
/// # Errors
/// [`Error::Argument`] for one that names none of the regressors, is written in another way, or is there twice.
pub(super) fn factors(terms: &[String], regressors: &[String]) -> Result<Vec<Vec<usize>>, Error> {
    let terms: Vec<Vec<usize>> = terms.iter().map(|text| read(text, regressors)).collect::<Result<_, _>>()?;
    for (place, term) in terms.iter().enumerate() {
        if terms[..place].contains(term) {
            return Err(Error::argument("term", format!("{} is given twice", written(term, regressors))));
        }
    }
    Ok(terms)
}

#[cfg(test)]
mod tests;
