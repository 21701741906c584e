//! What the reporting image printed. Its format stands in `firmware/report.rs`.

use std::error::Error;
use std::fs;
use std::path::Path;

use scenarios::{Case, Scenario, Visitor, play, visit_all, write_bits};

/// By how many instructions the clock may be wrong: the compiler places a few of its own around a call.
const CLOCK_MARGIN: u64 = 4;

/// Above these the meter is at its end: the timer wraps, the paint is used up.
const LARGEST_INSTRUCTIONS: u64 = 655_000;
const LARGEST_STACK: u64 = 8000;

/// One scenario's measurements.
pub(crate) struct Step {
    pub(crate) name: String,
    pub(crate) ram: u64,
    pub(crate) address: u64,
    detour: bool,
    /// Instructions of every step.
    typical: Vec<u64>,
    hard: Vec<u64>,
    /// The largest of all steps.
    pub(crate) stack: u64,
}

impl Step {
    /// The typical and the largest number of instructions, if the hard case went the longer way it promises.
    pub(crate) fn instructions(&self) -> Result<(u64, u64), String> {
        let (typical, worst) = (self.typical(), self.worst());
        if self.detour && worst <= typical {
            return Err(format!("{}: the hard case costs no more than the typical one", self.name));
        }
        Ok((typical, worst))
    }

    /// The median of the typical case.
    fn typical(&self) -> u64 {
        let mut sorted = self.typical.clone();
        sorted.sort_unstable();
        sorted.get(sorted.len() / 2).copied().unwrap_or_default()
    }

    /// The largest of both cases.
    fn worst(&self) -> u64 {
        self.typical.iter().chain(&self.hard).copied().max().unwrap_or_default()
    }
}

/// The output of the reporting image.
#[derive(Default)]
pub(crate) struct Log {
    bits: Vec<String>,
    pub(crate) steps: Vec<Step>,
}

impl Log {
    pub(crate) fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let text = fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let mut log = Log::default();
        for line in text.lines() {
            log.take(line).map_err(|error| format!("{error}: {line}"))?;
        }
        Ok(log)
    }

    fn take(&mut self, line: &str) -> Result<(), Box<dyn Error>> {
        match line.split(';').collect::<Vec<_>>()[..] {
            ["clock", known, measured] => {
                let (known, measured): (u64, u64) = (known.parse()?, measured.parse()?);
                if known.abs_diff(measured) > CLOCK_MARGIN {
                    return Err("the clock does not count instructions".into());
                }
            }
            ["step", name, ..] if self.steps.iter().any(|step| step.name == name) => {
                return Err("this step is there twice".into());
            }
            ["step", name, ram, address, detour] => self.steps.push(Step {
                name: name.to_owned(),
                ram: ram.parse()?,
                address: address.parse()?,
                detour: detour.parse()?,
                typical: Vec::new(),
                hard: Vec::new(),
                stack: 0,
            }),
            ["bits", ..] => self.bits.push(line.to_owned()),
            ["cost", name, case, _, instructions, stack] => {
                let step = self.steps.last_mut().filter(|step| step.name == name).ok_or("unknown step")?;
                let (instructions, stack): (u64, u64) = (instructions.parse()?, stack.parse()?);
                if instructions > LARGEST_INSTRUCTIONS || stack > LARGEST_STACK {
                    return Err("more than the firmware can measure".into());
                }
                step.stack = step.stack.max(stack);
                let case = if case == "Hard" { &mut step.hard } else { &mut step.typical };
                case.push(instructions);
            }
            _ => return Err("unknown line".into()),
        }
        Ok(())
    }

    /// The first line of bits that is not as expected.
    pub(crate) fn first_difference(&self, expected: &[String]) -> Option<String> {
        let lines = self.bits.iter().zip(expected);
        if let Some((firmware, host)) = lines.into_iter().find(|(firmware, host)| firmware != host) {
            return Some(format!("the bits differ.\nfirmware: {firmware}\nhost:     {host}"));
        }
        let (firmware, host) = (self.bits.len(), expected.len());
        (firmware != host).then(|| format!("the firmware printed {firmware} lines of bits, the host {host}"))
    }
}

/// The lines of bits that the same steps give on the host.
pub(crate) fn expected() -> Result<Vec<String>, Box<dyn Error>> {
    struct Host(Result<String, Box<dyn Error>>);

    impl Visitor for Host {
        fn visit<S: Scenario>(&mut self) {
            let Ok(text) = &mut self.0 else { return };
            let mut written = Ok(());
            let played = play::<S>(|case: Case, k, scenario, input| {
                let outcome = scenario.step(input);
                written = written.and_then(|()| write_bits(text, (case, k), scenario, &outcome));
            });
            if let Err(error) = played {
                self.0 = Err(format!("{}: {error}", S::NAME).into());
            } else if let Err(error) = written {
                self.0 = Err(error.into());
            }
        }
    }

    let mut host = Host(Ok(String::new()));
    visit_all(&mut host);
    Ok(host.0?.lines().map(str::to_owned).collect())
}
