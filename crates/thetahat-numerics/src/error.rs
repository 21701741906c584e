use thiserror::Error;

use crate::text;

/// What went wrong, in which place, and what to do about it.
///
/// Rows are 1-based positions in the log. The command line adds the file and the line.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument does not make sense, whatever the data.
    #[error("{argument}: {message}")]
    Argument {
        /// The argument's name.
        argument: String,
        /// What is wrong with it and what to do.
        message: String,
    },
    /// A model that is written as text has something wrong in it.
    #[error("line {line}, column {column}: {message}")]
    Model {
        /// The line, counted from 1.
        line: usize,
        /// The column, counted from 1 in characters.
        column: usize,
        /// What is wrong and what to do.
        message: String,
    },
    /// The log does not have what was asked of it.
    #[error("{message}")]
    Data {
        /// The channel concerned, where there is one.
        channel: Option<String>,
        /// The 1-based row concerned, where there is one.
        row: Option<usize>,
        /// What is wrong and what to do.
        message: String,
    },
    /// The data cannot determine the model.
    #[error("{message}")]
    Undetermined {
        /// The parameters that the data leave open; empty when all of them are.
        parameters: Vec<String>,
        /// Why, and what to do.
        message: String,
    },
    /// Whoever watched the search ended it.
    #[error("interrupted")]
    Interrupted,
    /// A stored report cannot be used.
    #[error("{message}")]
    Report {
        /// What is wrong with it and what to do.
        message: String,
    },
}

impl Error {
    /// An argument does not make sense.
    pub fn argument(argument: &str, message: impl Into<String>) -> Self {
        Self::Argument { argument: argument.to_owned(), message: message.into() }
    }

    /// The log as a whole does not have what was asked of it.
    pub fn data(message: impl Into<String>) -> Self {
        Self::Data { channel: None, row: None, message: message.into() }
    }

    /// A channel, at a 1-based row where there is one, does not have what was asked of it.
    pub fn in_channel(channel: &str, row: Option<usize>, message: impl Into<String>) -> Self {
        Self::Data { channel: Some(channel.to_owned()), row, message: message.into() }
    }

    /// The data leave these parameters open; all of them where the list is empty.
    pub fn undetermined(parameters: Vec<String>, message: impl Into<String>) -> Self {
        Self::Undetermined { parameters, message: message.into() }
    }

    /// A stored report cannot be used. The message may repeat parts of a damaged document.
    pub fn report(message: impl AsRef<str>) -> Self {
        Self::Report { message: text::message(message.as_ref()) }
    }
}
