//! End-to-end tests of the binary: one file a subject.

mod bad_input;
mod bad_report;
mod clock;
mod csv_dialects;
mod demo_and_help;
mod fit_reference;
mod harness;
mod identities;
mod output_files;
mod predict_simulate;
mod report;
mod signals;
mod terminal;
