use std::io::{self, Cursor, Read};
use std::sync::mpsc::{Receiver, sync_channel};

use super::{comma, gzip, plain};
use crate::reader::TextReader;
use crate::source::{Bytes, Source};
use crate::stream::TextStream;
use crate::{Event, Options, Selection};

/// What a stream gave: rows as they are, errors as they read.
fn all(mut stream: TextStream) -> Vec<String> {
    let mut events = Vec::new();
    loop {
        match stream.next() {
            Ok(Event::Row) => events.push(format!("{}: {:?}", stream.line(), stream.values())),
            Ok(Event::Malformed(error)) => events.push(error.to_string()),
            Ok(Event::Idle) => {}
            Ok(Event::Stopped) => events.push("stopped".to_owned()),
            Ok(Event::End) => return events,
            Err(error) => {
                events.push(error.to_string());
                return events;
            }
        }
    }
}

fn opened(origin: impl Read + Send + 'static, options: &Options) -> TextReader {
    let bytes = Bytes::new("log.csv", origin, None).unwrap();
    TextReader::start_live(Source::new(bytes, options.encoding), options).unwrap()
}

fn streamed(origin: impl Read + Send + 'static, options: &Options, whole_lines: bool) -> TextStream {
    let selection = Selection { columns: vec![1, 0], time: None, date: None };
    opened(origin, options).stream(&selection, whole_lines, None).unwrap()
}

/// A pipe of which the test writes each piece when it is time.
struct Pipe {
    pieces: Receiver<Vec<u8>>,
    rest: Cursor<Vec<u8>>,
}

impl Read for Pipe {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.rest.read(buffer)?;
        if count > 0 {
            return Ok(count);
        }
        match self.pieces.recv() {
            Ok(piece) => self.rest = Cursor::new(piece),
            Err(_) => return Ok(0),
        }
        self.rest.read(buffer)
    }
}

#[test]
fn rows_come_in_the_order_asked_for() {
    let text = "u,y\n1,2\n\n 3 , 4\r\n,6\n7,8";
    let events = all(streamed(Cursor::new(text), &plain(), false));
    assert_eq!(events, ["2: [2.0, 1.0]", "4: [4.0, 3.0]", "5: [6.0, NaN]", "6: [8.0, 7.0]"]);
    assert_eq!(all(streamed(Cursor::new(gzip(text.as_bytes())), &plain(), false)), events);
}

#[test]
fn a_row_is_there_as_soon_as_its_line_break() {
    let (write, pieces) = sync_channel(0);
    let pipe = Pipe { pieces, rest: Cursor::new(b"u,y\n1,2\n3".to_vec()) };
    let mut stream = streamed(pipe, &plain(), false);
    let mut next = || match stream.next().unwrap() {
        Event::Row => Some(stream.values().to_vec()),
        Event::Idle => None,
        other => panic!("{other:?}"),
    };
    assert_eq!(next(), Some(vec![2.0, 1.0]));
    assert_eq!(next(), None);
    // Nobody has ended the second row yet; it needs two more pieces.
    write.send(b",".to_vec()).unwrap();
    write.send(b"4\n5,6\n".to_vec()).unwrap();
    let rows: Vec<Vec<f64>> = std::iter::from_fn(|| Some(next())).flatten().take(2).collect();
    assert_eq!(rows, [[4.0, 3.0], [6.0, 5.0]]);
    drop(write);
    let event = loop {
        match stream.next().unwrap() {
            Event::Idle => {}
            event => break event,
        }
    };
    assert!(matches!(event, Event::End));
}

#[test]
fn a_header_waits_for_its_first_row_only() {
    let (write, pieces) = sync_channel(8);
    for piece in ["# made by x\nu,", "y\n# a comment\n", "\n1,2\n"] {
        write.send(piece.as_bytes().to_vec()).unwrap();
    }
    let options = Options { comment: Some(b'#'), ..plain() };
    // The pipe stays open: whoever asks for more than the first row waits for ever.
    let reader = opened(Pipe { pieces, rest: Cursor::default() }, &options);
    assert_eq!(reader.names(), ["u", "y"]);
    let mut stream =
        reader.stream(&Selection { columns: vec![0, 1], time: None, date: None }, false, None).unwrap();
    assert!(matches!(stream.next().unwrap(), Event::Row));
    assert_eq!((stream.values(), stream.line()), (&[1.0, 2.0][..], 5));
    drop(write);
}

#[test]
fn lines_that_are_no_rows_are_told_and_left_out() {
    let events = all(streamed(Cursor::new("u,y\n1,2\n3\nx,4\n5,\"6\n7,8\n9,inf\n"), &comma(), false));
    assert_eq!(events[0], "2: [2.0, 1.0]");
    assert!(
        events[1].starts_with("log.csv:3:2: this row has 1 field, but there are 2 columns"),
        "{}",
        events[1]
    );
    assert!(events[2].starts_with("log.csv:4:1: column 'u': \"x\" is not a number"), "{}", events[2]);
    assert!(events[3].starts_with("log.csv:5:3: this quote is not closed before the end of its line"));
    assert_eq!(events[4], "6: [8.0, 7.0]");
    assert!(events[5].starts_with("log.csv:7:3: column 'y': \"inf\" is infinite"), "{}", events[5]);
    assert_eq!(events.len(), 6);
}

#[test]
fn a_last_line_without_a_line_break_may_wait() {
    for text in ["u,y\n1,2\n3,4", "u,y\n1,2\n3,4\n"] {
        let stream = streamed(Cursor::new(text), &plain(), true);
        let expected: &[&str] =
            if text.ends_with('\n') { &["2: [2.0, 1.0]", "3: [4.0, 3.0]"] } else { &["2: [2.0, 1.0]"] };
        assert_eq!(all(stream), expected);
    }
    // The first row too.
    let mut stream = streamed(Cursor::new("u,y\n1,2"), &plain(), true);
    while matches!(stream.next().unwrap(), Event::Idle) {}
    assert!(stream.is_unfinished());
}

#[test]
fn a_stream_can_be_ended_from_outside() {
    let (write, pieces) = sync_channel(0);
    let pipe = Pipe { pieces, rest: Cursor::new(b"u,y\n1,2\n".to_vec()) };
    let mut stream = streamed(pipe, &plain(), false);
    let waker = stream.waker();
    assert!(matches!(stream.next().unwrap(), Event::Row));
    std::thread::scope(|scope| {
        scope.spawn(|| waker.wake());
        let event = loop {
            match stream.next().unwrap() {
                Event::Idle => {}
                event => break event,
            }
        };
        assert!(matches!(event, Event::Stopped));
    });
    drop(write);
}

#[test]
fn times_are_those_of_a_whole_log() {
    let text = "t,y\n2024-03-01T12:00:00Z,1\n2024-03-01T12:00:00.5Z,2\n,3\n";
    let selection = Selection { columns: vec![1], time: Some(0), date: None };
    let mut stream = opened(Cursor::new(text), &plain()).stream(&selection, false, None).unwrap();
    let mut times = Vec::new();
    loop {
        match stream.next().unwrap() {
            Event::Row => times.push(stream.time().unwrap()),
            Event::Malformed(error) => {
                assert!(error.to_string().contains("the time is missing"), "{error}");
            }
            Event::End => break,
            _ => {}
        }
    }
    assert_eq!(times, [0.0, 0.5]);
}

#[test]
fn a_log_without_rows_or_that_breaks_off_says_so() {
    let refused = |text: &'static [u8]| {
        let source = Source::new(Bytes::new("log.csv", Cursor::new(text), None).unwrap(), None);
        TextReader::start_live(source, &plain()).map(drop).unwrap_err().to_string()
    };
    assert!(refused(b"").ends_with("the file is empty; record at least one row"));
    assert!(refused(b"u,y\n").contains("there are no data rows below the header"));
    let text = format!("u,y\n{}", "1,2\n".repeat(5000));
    let mut packed = gzip(text.as_bytes());
    packed.truncate(packed.len() - 9);
    let events = all(streamed(Cursor::new(packed), &plain(), false));
    assert!(events.last().unwrap().contains("the gzip stream ends too early"), "{:?}", events.last());
}

/// A row that ends with a carriage return does not wait for the next one.
#[test]
fn a_carriage_return_ends_a_row_at_once() {
    let (write, pieces) = sync_channel(8);
    let pipe = Pipe { pieces, rest: Cursor::new(b"u,y\r1,2\r".to_vec()) };
    let mut stream = streamed(pipe, &plain(), true);
    let mut next = || {
        loop {
            match stream.next().unwrap() {
                Event::Row => break (stream.line(), stream.values().to_vec()),
                Event::Idle => {}
                other => panic!("{other:?}"),
            }
        }
    };
    assert_eq!(next(), (2, vec![2.0, 1.0]));
    // The newline that belongs to it may come later.
    write.send(b"\n".to_vec()).unwrap();
    write.send(b"3,4\r\n".to_vec()).unwrap();
    assert_eq!(next(), (3, vec![4.0, 3.0]));
}
