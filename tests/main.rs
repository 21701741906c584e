//! End-to-end tests of the binary: one file a subject.

mod bad_input;
mod bad_options;
mod bad_report;
mod bode;
mod clock;
mod criterion;
mod csv_dialects;
mod demo_and_help;
mod fit_reference;
mod forecast;
mod harness;
mod identities;
mod interrupt;
mod output_files;
mod predict_simulate;
mod prediction_error;
mod report;
mod several_logs;
mod signals;
mod terminal;
