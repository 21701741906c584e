//! The topics of a log.

use crate::figures::short;
use crate::inspect::{TopicList, TopicSummary};
use crate::present::Layout;
use crate::text::harmless;

use super::tree::{Medium, Sections, columns, figure, word};

/// The topics with their rates, their fields, the warnings, and what to type next.
pub fn topics(list: &TopicList, layout: Layout) -> String {
    let on = &mut Sections::new(Medium::Text);
    let file = harmless(&list.file);
    on.line(format!("{file}: {} topics, each with a clock of its own", list.topics.len()));
    on.gap();
    let names = ["topic", "rows", "rate [Hz]", "duration [s]", "columns"];
    let mut table = columns("Topics", names).none("there is a single message, or all have the same time");
    for topic in &list.topics {
        let [rate, duration] = [topic.rate, Some(topic.duration)].map(|value| figure(value, short));
        table.row([word(&topic.name), word(topic.rows), rate, duration, word(topic.columns.len())]);
    }
    on.table(table);
    for topic in list.topics.iter().filter(|topic| topic.columns.len() > 1 || topic.columns[0] != topic.name)
    {
        on.line(format!("{}: {}", harmless(&topic.name), harmless(&fields(topic).join(", "))));
    }
    on.gap();
    for warning in &list.warnings {
        on.line(format!("warning: {}", harmless(warning)));
    }
    if !list.warnings.is_empty() {
        on.gap();
    }
    if let Some(command) = &list.command {
        on.command(command);
    }
    super::text::written(on, layout)
}

/// The columns as they are called within the topic; arrays in short.
fn fields(topic: &TopicSummary) -> Vec<String> {
    let mut fields: Vec<String> = Vec::new();
    // The name of the array at hand, and its last element.
    let mut array: Option<(&str, usize)> = None;
    for column in &topic.columns {
        let field =
            column.strip_prefix(&topic.name).map_or(column.as_str(), |field| field.trim_start_matches('.'));
        let element = field.strip_suffix(']').and_then(|field| field.rsplit_once('['));
        let element = element.and_then(|(name, index)| Some((name, index.parse::<usize>().ok()?)));
        match (element, &mut array, fields.last_mut()) {
            (Some((name, index)), Some((known, last)), Some(shown))
                if name == *known && index == *last + 1 =>
            {
                *last = index;
                *shown = format!("{name}[0..{index}]");
            }
            (element, array, _) => {
                *array = element.filter(|(_, index)| *index == 0);
                fields.push(field.to_owned());
            }
        }
    }
    fields
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_are_shown_in_short() {
        let columns = ["a.x", "a.q[0]", "a.q[1]", "a.q[2]", "a.esc[0].rpm", "a.esc[1].rpm", "a.r[0]", "a.z"];
        let columns = columns.iter().map(|&name| name.to_owned()).collect();
        let topic = TopicSummary { name: "a".into(), rows: 2, rate: None, duration: 0.0, columns };
        assert_eq!(fields(&topic), ["x", "q[0..2]", "esc[0].rpm", "esc[1].rpm", "r[0]", "z"]);
    }
}
