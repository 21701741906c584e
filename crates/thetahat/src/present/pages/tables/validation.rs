//! What tests of residuals say.

use super::{in_sample, yes};
use crate::figures::{chance, fixed, number, short, three};
use crate::present::pages::page::Table;
use crate::present::pages::text::{or_dash, percent};
use crate::report::Validation;

/// Who, and of which output where there are several.
pub(in crate::present::pages) fn which(who: &str, validation: &Validation, output: &str) -> String {
    if validation.noise.len() > 1 { format!("{who}, {output}") } else { who.to_owned() }
}

/// The tests of what is left of several parts, or by several models: `who` says which.
pub(in crate::present::pages) fn tests(who: &str, parts: &[(String, &Validation)]) -> Table {
    let mut table = Table::new(
        "Tests of the residuals",
        &["test", who, "lags", "statistic", "degrees of freedom", "p-value"],
    );
    let each = parts.iter().flat_map(|(name, validation)| {
        validation.residuals.iter().map(move |residuals| (name, validation, residuals))
    });
    for (name, validation) in parts {
        if let Some(test) = &validation.portmanteau {
            table.row([
                format!("all outputs white together{}", asked(validation)),
                name.clone(),
                test.lags.to_string(),
                fixed(test.statistic, 2),
                short(test.degrees),
                or_dash(test.p_value, chance),
            ]);
        }
    }
    for (name, validation, residuals) in each {
        let name = which(name, validation, &residuals.output);
        let mut add = |label: String, test: &crate::validate::Test| {
            table.row([
                label,
                name.clone(),
                test.lags.to_string(),
                fixed(test.statistic, 2),
                short(test.degrees),
                or_dash(test.p_value, chance),
            ]);
        };
        add(format!("white (Ljung-Box){}", asked(validation)), &residuals.ljung_box);
        for independence in &residuals.independence {
            add(format!("independent of past {}", independence.input), &independence.past);
            add(format!("no feedback to {}", independence.input), &independence.feedback);
        }
        for one in validation.nonlinear.iter().filter(|one| one.output == residuals.output) {
            add(format!("no {}² in errors", one.input), &one.errors);
            add(format!("no {}² in squared errors", one.input), &one.squares);
        }
    }
    table
}

/// The remark where residuals that are not white are no fault.
pub(super) fn asked(validation: &Validation) -> &'static str {
    if validation.white_expected { "" } else { ", not asked" }
}

/// Anderson's test for each level.
pub(in crate::present::pages) fn anderson(who: &str, parts: &[(String, &Validation)]) -> Table {
    let mut table = Table::new(
        "Correlations outside of their band (Anderson)",
        &["alpha", who, "band", "lags", "outside", "fraction", "p-value", "white"],
    );
    let each = parts.iter().flat_map(|(name, validation)| {
        validation.residuals.iter().map(move |residuals| (name, validation, residuals))
    });
    for (name, validation, residuals) in each {
        for level in &residuals.anderson.levels {
            table.row([
                short(level.alpha),
                which(name, validation, &residuals.output),
                format!("± {}", three(level.band)),
                residuals.anderson.lags.to_string(),
                level.outside.to_string(),
                three(level.outside as f64 / residuals.anderson.lags as f64),
                chance(level.p_value),
                format!("{}{}", yes(level.white), asked(validation)),
            ]);
        }
    }
    table
}

/// How often the output lies in its prediction intervals.
pub(in crate::present::pages) fn coverage(who: &str, parts: &[(String, &Validation)]) -> Table {
    let all = || parts.iter().flat_map(|(_, validation)| &validation.coverage);
    let mut levels: Vec<f64> = all().map(|one| one.level).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let mut head = vec![who.to_owned(), "steps ahead".to_owned()];
    head.extend(levels.iter().map(|level| format!("{} interval", percent(*level))));
    head.push("samples".to_owned());
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let mut table = Table::new("How often the output lies in its prediction intervals", &head);
    for (name, validation) in parts {
        let same = |one: &crate::report::Coverage, other: &crate::report::Coverage| {
            (one.steps, &one.output) == (other.steps, &other.output)
        };
        for found in validation.coverage.chunk_by(same) {
            let at = |level: &f64| found.iter().find(|one| one.level == *level).and_then(|one| one.actual);
            let name = which(name, validation, &found[0].output);
            let mut cells = vec![name, found[0].steps.to_string()];
            cells.extend(levels.iter().map(|level| or_dash(at(level), percent)));
            cells.push(found[0].samples.to_string());
            table.row(cells);
        }
    }
    table
}

/// The level of the errors beside that of the model.
pub(in crate::present::pages) fn noise(who: &str, parts: &[(String, &Validation)]) -> Table {
    let head = [who, "mean of e²", "noise variance of the model", "ratio", "in-sample"];
    let mut table = Table::new("Errors one step ahead", &head);
    for (name, validation) in parts {
        for noise in &validation.noise {
            table.row([
                which(name, validation, &noise.output),
                or_dash(noise.mse, number),
                number(noise.model),
                or_dash(noise.ratio, three),
                in_sample(validation.in_sample).to_owned(),
            ]);
        }
    }
    table
}
