use super::Inspection;
use crate::{Cell, Row};

impl Inspection {
    /// What a table of many inspections says of this one: its rows and clock, of each channel its mean, its standard
    /// deviation and how much is missing or far off, and of each input how much it excites, its delay and whether it
    /// follows the output. Cells without a value are left out; names end with that of the channel.
    pub fn row(&self) -> Row {
        let mut row = Row::default();
        row.count("rows", self.rows);
        row.number("sample_time", self.clock.sample_time);
        row.count("gaps", self.clock.gaps);
        row.add("irregular", Cell::Flag(self.clock.irregular));
        row.count("channels", self.channels.len());
        for channel in &self.channels {
            let name = |figure: &str| format!("{figure}_{}", channel.name);
            row.number(&name("mean"), channel.mean);
            row.number(&name("sd"), channel.standard_deviation);
            row.count(&name("missing"), channel.missing);
            row.count(&name("outliers"), channel.outlier_count);
        }
        for excitation in &self.excitation {
            row.count(&format!("excitation_{}", excitation.input), excitation.order);
        }
        for delay in &self.delays {
            if let Some(nk) = delay.nk {
                row.count(&format!("delay_{}", delay.input), nk);
            }
        }
        for feedback in &self.feedback {
            row.add(&format!("feedback_{}", feedback.input), Cell::Flag(feedback.found));
        }
        row
    }
}
