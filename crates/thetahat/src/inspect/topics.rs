use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Document;
use crate::document::GENERATOR;
use crate::document::document_methods;

/// The topics of a log in which each has a clock of its own, as those of flights and robots. The JSON document
/// `thetahat.topics/1`.
///
/// ```
/// use thetahat::Document;
/// use thetahat::inspect::{TopicList, TopicSummary};
///
/// let columns = vec!["rates.roll".to_owned()];
/// let rates = TopicSummary { name: "rates".into(), rows: 501, rate: Some(250.0), duration: 2.0, columns };
/// let list = TopicList::new("flight.ulg".into(), vec![rates], None, vec![]);
/// assert_eq!(TopicList::from_json(&list.to_json()?)?, list);
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TopicList {
    /// `thetahat.topics/1`.
    pub schema: String,
    /// The program and version that wrote it.
    pub generator: String,
    /// The file name as it was given.
    pub file: String,
    /// The topics, in the order of the log.
    pub topics: Vec<TopicSummary>,
    /// A command that inspects some of their columns, as an example.
    pub command: Option<String>,
    /// What a careful reader should know, in plain words.
    pub warnings: Vec<String>,
}

/// A topic of a log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TopicSummary {
    /// Its name.
    pub name: String,
    /// The number of messages.
    pub rows: usize,
    /// How many messages a second it has on average; none of a single one.
    pub rate: Option<f64>,
    /// Seconds from the first message to the last.
    pub duration: f64,
    /// The names of its columns.
    pub columns: Vec<String>,
}

impl TopicList {
    /// The document about a file.
    pub fn new(
        file: String,
        topics: Vec<TopicSummary>,
        command: Option<String>,
        warnings: Vec<String>,
    ) -> Self {
        let generator = GENERATOR.to_owned();
        Self { schema: Self::SCHEMA.to_owned(), generator, file, topics, command, warnings }
    }
}

impl Document for TopicList {
    const NAME: &'static str = "list of topics";
    const SCHEMA: &'static str = "thetahat.topics/1";
    const REMEDY: &'static str = "give a file that inspect wrote of a log of topics";

    document_methods!();
}
