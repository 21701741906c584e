//! `thetahat reduce`: a model with fewer states.

use thetahat::Document;
use thetahat::present::tables;

use super::stored;
use crate::args::ReduceArguments;
use crate::failure::Failure;
use crate::messages::warn;
use crate::output;
use crate::wrap::stdout_layout;

pub(crate) fn reduce(arguments: &ReduceArguments) -> Result<(), Failure> {
    let path = &arguments.report;
    let report = stored::report(path)?;
    let failed = |error: thetahat::Error| match error {
        thetahat::Error::Argument { ref argument, .. } if argument == "order" => Failure::option(&error),
        _ => Failure::data(format!("{}: {error}", path.display())),
    };
    let values = report.hankel_singular_values().map_err(failed)?;
    if let Some(order) = arguments.order {
        let (reduced, _) = report.reduced(order as usize).map_err(failed)?;
        let json = reduced.to_json().map_err(|error| Failure::data(error.to_string()))?;
        reduced.warnings.iter().for_each(|warning| warn(warning));
        return output::write(&arguments.out, |file| file.write_all(json.as_bytes()));
    }
    output::write(&arguments.out, |file| {
        file.write_all(tables::hankel_singular_values(&values, stdout_layout()).as_bytes())
    })
}
