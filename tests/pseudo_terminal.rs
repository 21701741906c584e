//! The program with standard error on a terminal, and what that shows as it comes.
#![cfg(unix)]

use std::ffi::OsStr;
use std::fs::File;
use std::io::Read;
use std::os::unix::ffi::OsStrExt;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};

use rustix::process::{Pid, Signal, kill_process};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};

use crate::harness::{HANGS, Run};

/// A program that runs on a terminal; its standard output is a pipe.
pub(crate) struct Terminal {
    pub(crate) child: Child,
    pieces: Receiver<Vec<u8>>,
    shown: Vec<u8>,
}

impl Terminal {
    pub(crate) fn start(mut command: Command) -> Self {
        let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("there is a pseudo-terminal");
        grantpt(&ours).and_then(|()| unlockpt(&ours)).expect("it is ours");
        let size = Winsize { ws_row: 24, ws_col: 80, ws_xpixel: 0, ws_ypixel: 0 };
        tcsetwinsize(&ours, size).expect("it has a size");
        let name = ptsname(&ours, Vec::new()).expect("it has a name");
        let theirs = File::options().read(true).write(true).open(OsStr::from_bytes(name.as_bytes()));
        command.env("TERM", "xterm").stdin(Stdio::piped()).stdout(Stdio::piped());
        command.stderr(theirs.expect("its other side opens"));
        let child = command.spawn().expect("the program starts");
        // With its other side: reading ends when nobody holds that any more.
        drop(command);
        let (sender, pieces) = channel();
        std::thread::spawn(move || {
            let (mut ours, mut piece) = (File::from(ours), [0; 4096]);
            // Linux says with an error that the other side is closed.
            while let Ok(length @ 1..) = ours.read(&mut piece) {
                if sender.send(piece[..length].to_vec()).is_err() {
                    break;
                }
            }
        });
        Self { child, pieces, shown: Vec::new() }
    }

    /// Waits until the terminal has shown this.
    pub(crate) fn wait_for(&mut self, word: &str) {
        while !self.text().contains(word) {
            let piece = self.pieces.recv_timeout(HANGS);
            assert!(piece.is_ok(), "{word} is not shown ({piece:?}): {:?}", self.text());
            self.shown.extend(piece.into_iter().flatten());
        }
    }

    pub(crate) fn press_control_c(&self) {
        kill_process(Pid::from_child(&self.child), Signal::INT).expect("the program runs");
    }

    /// Waits for the end; standard error is what the terminal has shown.
    pub(crate) fn end(mut self) -> Run {
        self.shown.extend(self.pieces.iter().flatten());
        let stderr = self.text();
        let run = Run::from(self.child.wait_with_output().expect("the program ends"));
        Run { stderr, ..run }
    }

    fn text(&self) -> String {
        String::from_utf8_lossy(&self.shown).into_owned()
    }
}
