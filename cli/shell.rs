//! Command lines as one types them.

use std::ffi::OsString;

/// The line that gave the program these words, the program's own name first.
pub(crate) fn line(words: &[OsString]) -> String {
    let given = words.iter().skip(1).map(|word| quoted(&word.to_string_lossy()));
    std::iter::once("thetahat".to_owned()).chain(given).collect::<Vec<_>>().join(" ")
}

/// A word for a POSIX shell: as it is where that is safe, else between single quotes, in which nothing is special.
pub(crate) fn quoted(word: &str) -> String {
    let safe = |character: char| character.is_alphanumeric() || "_-./,:=@+".contains(character);
    if !word.is_empty() && word.chars().all(safe) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_survive_a_shell() {
        for word in ["log.csv", "a/b-c_1,2:3=@+", "Temp_°C"] {
            // The degree sign is no letter.
            assert_eq!(quoted(word), if word.contains('°') { format!("'{word}'") } else { word.to_owned() });
        }
        assert_eq!(quoted(""), "''");
        assert_eq!(quoted("two words"), "'two words'");
        assert_eq!(quoted("it's $HOME"), r"'it'\''s $HOME'");
        assert_eq!(quoted("~/a*"), "'~/a*'");
        let words = ["target/debug/thetahat", "fit", "my log.csv"].map(OsString::from);
        assert_eq!(line(&words), "thetahat fit 'my log.csv'");
    }
}
