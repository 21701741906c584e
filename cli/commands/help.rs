//! What the program says of itself: the report's schema, shell completions, manual pages.

use clap::CommandFactory;
use thetahat::Document;
use thetahat::control::Control;
use thetahat::design::ExperimentDesign;
use thetahat::filter::FilterSummary;
use thetahat::inspect::{Inspection, TopicList};
use thetahat::options::Options;
use thetahat::plan::FitOptions;
use thetahat::report::{Comparison, NormalEquations, Report, Validation};
use thetahat::spectrum::MeasuredResponse;
use thetahat::step_test::StepTest;
use thetahat::track::TrackSummary;
use thetahat::tune::Tuning;

use crate::args::{Arguments, DocumentArgument};
use crate::failure::Failure;
use crate::output;

/// `thetahat schema [DOCUMENT]`.
pub(crate) fn schema(document: DocumentArgument) -> Result<(), Failure> {
    let schema = match document {
        DocumentArgument::Report => Report::json_schema(),
        DocumentArgument::Validation => Validation::json_schema(),
        DocumentArgument::Comparison => Comparison::json_schema(),
        DocumentArgument::Inspection => Inspection::json_schema(),
        DocumentArgument::Topics => TopicList::json_schema(),
        DocumentArgument::Response => MeasuredResponse::json_schema(),
        DocumentArgument::Step => StepTest::json_schema(),
        DocumentArgument::Tuning => Tuning::json_schema(),
        DocumentArgument::Control => Control::json_schema(),
        DocumentArgument::Track => TrackSummary::json_schema(),
        DocumentArgument::Filter => FilterSummary::json_schema(),
        DocumentArgument::Design => ExperimentDesign::json_schema(),
        DocumentArgument::Plan => FitOptions::schema(),
        DocumentArgument::NormalEquations => NormalEquations::json_schema(),
    };
    output::print(&format!("{schema:#}\n"))
}

/// `thetahat completions SHELL`.
pub(crate) fn completions(shell: clap_complete::Shell) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "thetahat", &mut script);
    output::print(&String::from_utf8_lossy(&script))
}

/// `thetahat man [VERB]`.
pub(crate) fn manual(verb: Option<&str>) -> Result<(), Failure> {
    let mut command = Arguments::command();
    command.build();
    let page = match verb {
        None => clap_mangen::Man::new(command),
        Some(verb) => match command.find_subcommand(verb) {
            Some(found) => clap_mangen::Man::new(found.clone().name(format!("thetahat-{verb}"))),
            None => {
                let verbs: Vec<&str> = command.get_subcommands().map(clap::Command::get_name).collect();
                return Err(Failure::usage(format!(
                    "there is no verb '{verb}'; there are: {}",
                    verbs.join(", ")
                )));
            }
        },
    };
    let mut text = Vec::new();
    page.render(&mut text).map_err(|error| Failure::stdout(&error))?;
    output::print(&String::from_utf8_lossy(&text))
}
