//! The part of the text that is in memory.

use super::error::Error;
use super::source::Source;

/// Consecutive bytes of the text, from the start of a line on.
///
/// Two blocks take turns: while the rows of one are parsed, the other is filled with what follows.
#[derive(Default)]
pub(super) struct Block {
    /// Initialised memory, kept from one filling to the next: clearing it each time would cost as much as
    /// reading.
    memory: Vec<u8>,
    /// How much of the memory is text.
    length: usize,
    /// How much of the text was carried over from the block before.
    carried: usize,
    /// Whether the text ends with this block.
    last: bool,
    /// Whether the text ends without a line break: its last newline was added here.
    unended: bool,
}

impl Block {
    /// The bytes, with a newline after the last one of the whole text.
    pub(super) fn text(&self) -> &[u8] {
        &self.memory[..self.length]
    }

    /// The bytes as they were read.
    pub(super) fn raw(&self) -> &[u8] {
        &self.memory[..self.length - usize::from(self.unended)]
    }

    /// How many of the bytes were in the block before.
    pub(super) fn carried(&self) -> usize {
        self.carried
    }

    /// Whether nothing follows this block.
    pub(super) fn is_last(&self) -> bool {
        self.last
    }

    /// Whether the text ends in this block, and without a line break.
    pub(super) fn is_unended(&self) -> bool {
        self.unended
    }

    /// Starts over with the bytes that the block before left, and reads up to `amount` more.
    pub(super) fn fill(&mut self, left: &[u8], amount: usize, source: &mut Source) -> Result<(), Error> {
        let wanted = left.len() + amount;
        // One more for the newline below.
        if self.memory.len() <= wanted {
            self.memory.resize(wanted + 1, 0);
        }
        self.memory[..left.len()].copy_from_slice(left);
        let read = source.fill(&mut self.memory[left.len()..wanted])?;
        self.carried = left.len();
        self.length = left.len() + read;
        self.last = read < amount;
        self.unended = false;
        // So that every line ends alike.
        if self.last && self.text().last().is_some_and(|&byte| byte != b'\n') {
            self.memory[self.length] = b'\n';
            self.length += 1;
            self.unended = true;
        }
        Ok(())
    }

    /// Puts bytes that the block before left after all in front.
    pub(super) fn prepend(&mut self, left: &[u8]) {
        self.memory.truncate(self.length);
        self.memory.splice(..0, left.iter().copied());
        self.length += left.len();
        self.carried += left.len();
    }
}
