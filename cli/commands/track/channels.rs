//! Which columns are tracked.

use thetahat::report::Report;
use thetahat::track::TrackOptions;

use crate::commands::experiments::usual_inputs;
use crate::log::listed;

/// The columns that a tracker follows.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Channels {
    pub(crate) inputs: Vec<String>,
    pub(crate) outputs: Vec<String>,
}

/// Those named, those of the report, or those called u, u1, u2, … and y; an error is a message.
pub(super) fn choose(
    options: &TrackOptions,
    report: Option<&Report>,
    header: &[String],
) -> Result<Channels, String> {
    let model = report.map(|report| &report.model);
    let outputs = match (options.outputs(), model) {
        (Some(names), _) => names,
        // A model of several outputs is refused where a tracker is made of it.
        (None, Some(model)) => model.outputs().iter().map(|output| output.name.clone()).collect(),
        (None, None) if header.iter().any(|name| name == "y") => vec!["y".to_owned()],
        (None, None) => {
            return Err(format!(
                "no column is called y; name the output with --output; there are: {}",
                listed(header)
            ));
        }
    };
    let inputs = match (options.inputs(), model) {
        (Some(names), _) => names,
        (None, Some(model)) => model.inputs().iter().map(|input| input.name.clone()).collect(),
        (None, None) if !options.has_inputs() => Vec::new(),
        (None, None) => usual_inputs(header),
    };
    if inputs.is_empty() && model.is_none() && options.has_inputs() {
        return Err(format!(
            "no column is called u, u1, u2, …; name the inputs with --input, or give --nb 0 for a model without; there \
             are: {}",
            listed(header)
        ));
    }
    Ok(Channels { inputs, outputs })
}
