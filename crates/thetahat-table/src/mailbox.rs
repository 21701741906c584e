//! What the thread that reads a log tells the one that takes its rows.

use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};

use super::error::Error;

/// How many pieces may wait.
const WAITING: usize = 4;

/// What comes next.
#[derive(Debug)]
pub enum Event {
    /// A row: what the stream gives is its own.
    Row,
    /// A line that is no row. It was left out.
    Malformed(Error),
    /// There is nothing more at the moment: the next call waits. Told once each time.
    Idle,
    /// The log ends here.
    End,
    /// The program was asked to end.
    Stopped,
}

/// What the thread that reads, and whoever ends the stream, tell the one that takes the rows.
pub(super) enum Message<Piece> {
    Piece(Piece),
    Failed(Error),
    End,
    Stop,
}

/// Where the pieces of a log arrive.
pub(super) struct Mailbox<Piece> {
    messages: Receiver<Message<Piece>>,
    sender: SyncSender<Message<Piece>>,
    /// Whether it was told that there is nothing at the moment.
    told: bool,
}

impl<Piece: Send + 'static> Mailbox<Piece> {
    pub(super) fn new() -> Self {
        let (sender, messages) = sync_channel(WAITING);
        Self { messages, sender, told: false }
    }

    /// For the thread that reads.
    pub(super) fn sender(&self) -> SyncSender<Message<Piece>> {
        self.sender.clone()
    }

    /// What ends the stream early.
    pub(super) fn waker(&self) -> Waker {
        let sender = self.sender.clone();
        // If that many pieces wait, then nobody waits for one.
        Waker(Box::new(move || drop(sender.try_send(Message::Stop))))
    }

    /// A row came: that there is nothing is told again.
    pub(super) fn forget(&mut self) {
        self.told = false;
    }

    /// The next message, or None if there is nothing at the moment; the next call then waits.
    pub(super) fn take(&mut self) -> Option<Message<Piece>> {
        match self.messages.try_recv() {
            Err(TryRecvError::Empty) if !self.told => {
                self.told = true;
                None
            }
            Err(TryRecvError::Empty) => Some(self.messages.recv().unwrap_or(Message::End)),
            Err(TryRecvError::Disconnected) => Some(Message::End),
            Ok(message) => Some(message),
        }
    }
}

/// Ends a stream from another thread: it wakes if it waits.
pub struct Waker(Box<dyn Fn() + Send + Sync>);

impl Waker {
    /// Ends the stream: what waits for a row gets [`Event::Stopped`].
    pub fn wake(&self) {
        self.0();
    }
}
