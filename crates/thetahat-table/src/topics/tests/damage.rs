//! Whatever the bytes are, there is a table or an error, in little time and memory.

use super::*;
use crate::tests::dice::Dice;

fn logs() -> [Vec<u8>; 3] {
    [ulog::flight(), dataflash::flight(), wpilog::flight()]
}

#[test]
fn a_log_that_is_cut_anywhere_is_read_up_to_there() {
    for log in logs() {
        let all = whole(&log).unwrap();
        let mut rows = 0;
        for end in 0..log.len() {
            match whole(&log[..end]) {
                Ok(table) => {
                    // Rows never get fewer, and are those of the whole log.
                    assert!(table.rows >= rows, "{end}");
                    rows = table.rows;
                    // Before it is said what tells sensors apart, they are one.
                    let known = ["middle of a message", "the time of the one that follows"];
                    let damage = |words: &String| !known.iter().any(|known| words.contains(known));
                    assert!(!table.words.iter().any(damage), "{end}: {:?}", table.words);
                }
                Err(error) => {
                    let error = error.to_string();
                    assert!(rows == 0 || error.contains("has no clock"), "{end}: {error}");
                    assert!(error.starts_with("flight.log: "), "{error}");
                }
            }
        }
        // The last byte may be the last row's.
        assert!(rows + 1 >= all.rows);
    }
}

#[test]
fn damaged_logs_do_no_harm() {
    let mut dice = Dice(88_172_645_463_325_252);
    let (mut read, mut refused) = (0, 0);
    for log in logs() {
        for _ in 0..3000 {
            let mut bytes = log.clone();
            for _ in 0..1 + dice.below(4) {
                let at = dice.below(bytes.len());
                match dice.below(4) {
                    0 => bytes[at] = dice.below(256) as u8,
                    1 => bytes[at] ^= 1 << dice.below(8),
                    2 => drop(bytes.remove(at)),
                    _ => {
                        let end = bytes.len().min(at + dice.below(40));
                        bytes[at..end].fill([0, 0xff][dice.below(2)]);
                    }
                }
            }
            match whole(&bytes) {
                Ok(table) => {
                    read += 1;
                    let clocks = table.clocks.iter().map(|clock| &clock.time).chain(&table.time);
                    assert!(clocks.into_iter().all(|time| time.windows(2).all(|pair| pair[0] < pair[1])));
                }
                Err(error) => {
                    refused += 1;
                    assert!(!error.to_string().contains('\n'));
                }
            }
        }
    }
    assert!(read > 1000 && refused > 10, "{read} {refused}");
}

#[test]
fn many_columns_are_refused_before_they_take_memory() {
    let members: String = (0..1500).map(|member| format!("uint8_t[30] m{member};")).collect();
    let format = format!("wide:uint64_t timestamp;{members}");
    let mut log = [ulog::head(), ulog::message(b'F', format.as_bytes())].concat();
    for id in 0..20 {
        log.extend(ulog::subscribe(id as u8, id, "wide"));
        log.extend(ulog::data(id, 1, &vec![0; 45_000]));
    }
    let error = error(&log);
    assert!(error.contains("more than 262144 columns"), "{error}");
}
