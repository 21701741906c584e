//! Which of the arguments are files.

use std::path::Path;

use super::{Command, EvaluationArguments, PredictArguments, SimulateArguments};
use crate::files::Files;

/// The name of a template, if a model is one.
pub(crate) fn template_name(model: &Path) -> Option<&str> {
    model.to_str()?.strip_prefix("template:")
}

impl Command {
    /// The files that a verb reads and writes.
    pub(crate) fn files(&self) -> Files {
        let mut files = Files::default();
        let Files { read, written, makes_folders } = &mut files;
        match self {
            Self::Fit(fit) => {
                let grey = fit.grey.iter().filter(|path| template_name(path).is_none());
                let documents = grey.chain(&fit.plan).chain(&fit.from);
                read.extend(documents.chain(&fit.logs).cloned());
                read.extend(fit.each.list.iter().cloned());
                written.extend(fit.report.iter().chain(&fit.html).chain(&fit.each.table).cloned());
            }
            Self::Inspect(inspect) => {
                read.extend(inspect.logs.iter().chain(&inspect.each.list).cloned());
                // With a table, nothing else is written.
                let out = Some(&inspect.out).filter(|_| !inspect.each.each);
                written.extend(out.into_iter().chain(&inspect.html).chain(&inspect.each.table).cloned());
            }
            Self::Spectrum(spectrum) => {
                read.extend(spectrum.paths.iter().cloned());
                written.extend([&spectrum.out].into_iter().chain(&spectrum.html).cloned());
            }
            Self::Predict(PredictArguments { respond, .. }) => {
                read.extend([respond.report.clone(), respond.path.clone()]);
                written.push(respond.out.clone());
            }
            Self::Simulate(SimulateArguments { respond, draws_file, .. }) => {
                read.extend([respond.report.clone(), respond.path.clone()]);
                written.extend([&respond.out].into_iter().chain(draws_file).cloned());
            }
            Self::Validate(validate) => {
                read.extend(
                    [&validate.report].into_iter().chain(&validate.logs).chain(&validate.each.list).cloned(),
                );
                let EvaluationArguments { out, html, .. } = &validate.evaluation;
                written.extend(out.iter().chain(html).chain(&validate.each.table).cloned());
            }
            Self::Compare(compare) => {
                read.extend(compare.reports.iter().chain([&compare.path]).chain(&compare.over).cloned());
                written.extend(compare.evaluation.out.iter().chain(&compare.evaluation.html).cloned());
            }
            Self::Track(track) => {
                read.extend([&track.path].into_iter().chain(&track.warm).cloned());
                // That a state is kept on standard output is refused by itself.
                let state = track.state.iter().filter(|path| path.as_path() != Path::new("-"));
                written
                    .extend([&track.lines.out].into_iter().chain(state).chain(&track.lines.summary).cloned());
            }
            Self::Filter(filter) => {
                read.extend([filter.model.clone(), filter.path.clone()]);
                written.extend([&filter.lines.out].into_iter().chain(&filter.lines.summary).cloned());
            }
            Self::Bode(bode) => {
                read.extend(bode.reports.iter().chain(&bode.over).cloned());
                written.extend([&bode.out].into_iter().chain(&bode.html).cloned());
            }
            Self::Step(step) => {
                read.push(step.path.clone());
                written.extend([&step.out].into_iter().chain(&step.report).chain(&step.html).cloned());
            }
            Self::Impulse(impulse) => {
                read.push(impulse.report.clone());
                written.extend([&impulse.out].into_iter().chain(&impulse.html).cloned());
            }
            Self::Reduce(reduce) => {
                read.push(reduce.report.clone());
                written.push(reduce.out.clone());
            }
            Self::Model(model) => written.extend(model.report.iter().cloned()),
            Self::Convert(convert) => {
                read.push(convert.report.clone());
                written.extend(convert.out.clone());
            }
            Self::Tune(tune) => {
                read.push(tune.report.clone());
                written.extend(tune.outputs.written().chain(&tune.html).cloned());
            }
            Self::Control(control) => {
                read.push(control.report.clone());
                written.extend(control.outputs.written().cloned());
            }
            Self::Export(export) => {
                read.extend([&export.report].into_iter().chain(&export.path).cloned());
                let names = export.plan().files(export.path.is_some());
                written.extend(names.iter().map(|name| export.out.join(name)));
                *makes_folders = true;
            }
            Self::Design(design) => {
                read.extend(design.model.clone());
                written.extend([&design.out].into_iter().chain(&design.spectrum).cloned());
            }
            Self::Templates(templates) => read.extend(templates.logs.iter().cloned()),
            Self::Demo(_) | Self::Schema { .. } | Self::Completions { .. } | Self::Man { .. } => {}
        }
        files
    }
}
