use serde_json::{Map, Number, Value};

use crate::Error;
use crate::data::{Detrend, Rows};

/// How often an option may stand on a command line, and what its value is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Once, without a value.
    Flag,
    /// Once, with a value.
    Single,
    /// One list of values between commas, or several.
    List,
    /// Lists of names, of which one may hold a comma.
    Names,
    /// Once for each value.
    Repeated,
}

/// A value that an option may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Word {
    /// As it is written.
    pub word: &'static str,
    /// How it may be written too.
    pub alias: Option<&'static str>,
    /// What it means.
    pub help: &'static str,
}

/// The value of an option, and whether there is one.
pub(crate) trait OptionValue: Default {
    const FORM: Form;
    /// Its type in Python.
    const PYTHON: &'static str;
    /// Whether it may begin with a minus sign.
    const SIGNED: bool;
    /// What it may be, where that is a list.
    fn words() -> Vec<Word>;
    /// Whether it was given.
    fn is_given(&self) -> bool;
    /// Reads it.
    fn read(option: &str, value: &Value) -> Result<Self, Error>;
    /// As it is written in a plan.
    fn write(&self) -> Value;
    /// What JSON may hold, as a JSON Schema.
    fn schema() -> Value {
        let one = match &*Self::words() {
            [] => serde_json::json!({ "type": ["string", "number"] }),
            words => serde_json::json!({ "enum": words.iter().map(|own| own.word).collect::<Vec<_>>() }),
        };
        match Self::FORM {
            Form::Flag => serde_json::json!({ "type": "boolean" }),
            Form::Single => one,
            Form::List | Form::Names | Form::Repeated => {
                serde_json::json!({ "anyOf": [one, { "type": "array" }, { "type": "object" }] })
            }
        }
    }
}

/// One value, written as text.
pub(crate) trait OptionText: Sized {
    /// Of a list of them.
    const LIST: Form = Form::Repeated;
    /// Its type in Python.
    const PYTHON: &'static str;
    /// The type of a list of them.
    const PYTHON_LIST: &'static str = "Sequence[str]";
    /// Whether it may begin with a minus sign.
    const SIGNED: bool = false;
    fn words() -> Vec<Word> {
        Vec::new()
    }
    /// Reads it; else what is wrong with it.
    fn of(text: &str) -> Result<Self, String>;
    fn text(&self) -> String;
}

impl OptionValue for bool {
    const FORM: Form = Form::Flag;
    const PYTHON: &'static str = "bool";
    const SIGNED: bool = false;

    fn words() -> Vec<Word> {
        Vec::new()
    }

    fn is_given(&self) -> bool {
        *self
    }

    fn read(option: &str, value: &Value) -> Result<Self, Error> {
        value.as_bool().ok_or_else(|| Error::argument(option, format!("{value} is neither true nor false")))
    }

    fn write(&self) -> Value {
        Value::Bool(*self)
    }
}

impl<T: OptionText> OptionValue for Option<T> {
    const FORM: Form = Form::Single;
    const PYTHON: &'static str = T::PYTHON;
    const SIGNED: bool = T::SIGNED;

    fn words() -> Vec<Word> {
        T::words()
    }

    fn is_given(&self) -> bool {
        self.is_some()
    }

    fn read(option: &str, value: &Value) -> Result<Self, Error> {
        T::of(&text(option, value)?).map(Some).map_err(|message| Error::argument(option, message))
    }

    fn write(&self) -> Value {
        self.as_ref().map_or(Value::Null, |value| plain(&value.text()))
    }
}

impl<T: OptionText> OptionValue for Vec<T> {
    const FORM: Form = T::LIST;
    const PYTHON: &'static str = T::PYTHON_LIST;
    const SIGNED: bool = T::SIGNED;

    fn words() -> Vec<Word> {
        T::words()
    }

    fn is_given(&self) -> bool {
        !self.is_empty()
    }

    fn read(option: &str, value: &Value) -> Result<Self, Error> {
        let texts = match value {
            Value::Array(each) => each.iter().map(|one| text(option, one)).collect::<Result<_, _>>()?,
            Value::Object(named) => named
                .iter()
                .map(|(name, one)| Ok(format!("{name}={}", text(option, one)?)))
                .collect::<Result<Vec<_>, Error>>()?,
            one if T::LIST == Form::List => text(option, one)?.split(',').map(str::to_owned).collect(),
            one => vec![text(option, one)?],
        };
        if texts.is_empty() {
            return Err(Error::argument(option, "there is none; give one at least, or leave it out"));
        }
        let read = |text: &String| T::of(text).map_err(|message| Error::argument(option, message));
        texts.iter().map(read).collect()
    }

    fn write(&self) -> Value {
        let texts: Vec<String> = self.iter().map(OptionText::text).collect();
        let named = |text: &String| {
            let (name, value) = text.rsplit_once('=').filter(|_| T::PYTHON_LIST.contains("Mapping"))?;
            Some((name.to_owned(), plain(value)))
        };
        match texts.iter().map(named).collect::<Option<Map<_, _>>>() {
            Some(named) if !named.is_empty() => Value::Object(named),
            _ => Value::Array(texts.iter().map(|text| plain(text)).collect()),
        }
    }
}

/// One value as text: a range of two ends may be a list of them, either of which may be null.
fn text(option: &str, value: &Value) -> Result<String, Error> {
    let number = |number: &Number| match number.as_f64() {
        // Whole numbers have no point: 2.0 is the order 2, and the norm.
        Some(whole) if number.is_f64() && whole == whole.trunc() && whole.abs() < 1e15 => format!("{whole}"),
        _ => number.to_string(),
    };
    match value {
        Value::String(text) => Ok(text.clone()),
        Value::Number(one) => Ok(number(one)),
        Value::Array(ends) if ends.len() == 2 => {
            let end = |end: &Value| match end {
                Value::Null => Ok(String::new()),
                end => text(option, end),
            };
            Ok(format!("{}..{}", end(&ends[0])?, end(&ends[1])?))
        }
        _ => Err(Error::argument(option, format!("{value} is neither a text nor a number"))),
    }
}

/// A number where the text is one.
fn plain(text: &str) -> Value {
    let whole = text.parse::<u64>().ok().map(Value::from);
    let number = || text.parse::<f64>().ok().filter(|number| number.is_finite()).map(Value::from);
    whole.or_else(number).unwrap_or_else(|| Value::from(text))
}

impl OptionText for String {
    const LIST: Form = Form::Repeated;
    const PYTHON: &'static str = "str";
    const SIGNED: bool = true;

    fn of(text: &str) -> Result<Self, String> {
        Ok(text.to_owned())
    }

    fn text(&self) -> String {
        self.clone()
    }
}

/// The name of a column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ColumnName(pub String);

impl ColumnName {
    /// Those of a list, if there are any.
    pub(crate) fn all(names: &[Self]) -> Option<Vec<String>> {
        (!names.is_empty()).then(|| names.iter().map(|name| name.0.clone()).collect())
    }
}

impl OptionText for ColumnName {
    const LIST: Form = Form::Names;
    const PYTHON: &'static str = "str";

    fn of(text: &str) -> Result<Self, String> {
        Ok(Self(text.to_owned()))
    }

    fn text(&self) -> String {
        self.0.clone()
    }
}

impl OptionText for usize {
    const LIST: Form = Form::List;
    const PYTHON: &'static str = "int";
    const PYTHON_LIST: &'static str = "Union[int, Sequence[int]]";

    fn of(text: &str) -> Result<Self, String> {
        text.trim().parse().map_err(|_| format!("'{text}' is not a whole number; give one such as 2"))
    }

    fn text(&self) -> String {
        self.to_string()
    }
}

impl OptionText for u64 {
    const PYTHON: &'static str = "int";

    fn of(text: &str) -> Result<Self, String> {
        text.trim().parse().map_err(|_| format!("'{text}' is not a whole number; give one such as 2"))
    }

    fn text(&self) -> String {
        self.to_string()
    }
}

impl OptionText for f64 {
    const LIST: Form = Form::List;
    const PYTHON: &'static str = "float";
    const PYTHON_LIST: &'static str = "Sequence[float]";
    const SIGNED: bool = true;

    fn of(text: &str) -> Result<Self, String> {
        let number = text.trim().parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| format!("'{text}' is not a finite number"))
    }

    fn text(&self) -> String {
        self.to_string()
    }
}

/// The two ends of a range of numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ends(pub [f64; 2]);

impl OptionText for Ends {
    const PYTHON: &'static str = "tuple[float, float]";
    const SIGNED: bool = true;

    fn of(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|end| end.is_finite());
        let ends = text.split_once("..").and_then(|(low, high)| Some([number(low)?, number(high)?]));
        ends.map(Self).ok_or_else(|| format!("'{text}': write it as LOW..HIGH, such as 0.1..3"))
    }

    fn text(&self) -> String {
        format!("{}..{}", self.0[0], self.0[1])
    }
}

/// A number for a channel.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedValue {
    /// The channel.
    pub name: String,
    /// Its number.
    pub value: f64,
}

impl OptionText for NamedValue {
    const PYTHON: &'static str = "str";
    const PYTHON_LIST: &'static str = "Mapping[str, float]";

    fn of(text: &str) -> Result<Self, String> {
        let (name, value) = text.rsplit_once('=').unwrap_or_default();
        let value = value.trim().parse().ok().filter(|value: &f64| value.is_finite());
        let value = value.ok_or_else(|| format!("'{text}': write it as NAME=VALUE, such as u=4.5"))?;
        Ok(Self { name: name.to_owned(), value })
    }

    fn text(&self) -> String {
        format!("{}={}", self.name, self.value)
    }
}

/// Values that read and write themselves, how a list of them stands on a command line, and their types in Python.
macro_rules! texts {
    (signed) => { true };
    ($($own:ty, $list:ident, $python:literal, $python_list:literal $(, $signed:ident)?;)*) => {$(
        impl $crate::options::OptionText for $own {
            const LIST: $crate::options::Form = $crate::options::Form::$list;
            const PYTHON: &'static str = $python;
            const PYTHON_LIST: &'static str = $python_list;
            $(const SIGNED: bool = $crate::options::texts!($signed);)?

            fn of(text: &str) -> Result<Self, String> {
                text.parse().map_err(|error| match error {
                    $crate::Error::Argument { message, .. } => message,
                    other => other.to_string(),
                })
            }

            fn text(&self) -> String {
                self.to_string()
            }
        }
    )*};
}

pub(crate) use texts;

texts! {
    Detrend, Repeated, "Union[Literal[\"mean\", \"linear\", \"none\"], str]", "Sequence[str]";
    Rows, List, "str", "Rows";
}

/// What is wrong with a word that is none of these.
pub(crate) fn none_of(text: &str, words: &[Word]) -> String {
    let words: Vec<&str> = words.iter().map(|own| own.word).collect();
    format!("'{text}' is none of {}", words.join(", "))
}

/// The words of a type, one for each of its variants.
macro_rules! words {
    ($own:ty { $($variant:ident $word:literal $(| $alias:literal)? $help:literal,)* }) => {
        impl $own {
            /// As it is written.
            pub(crate) fn word(self) -> &'static str {
                match self { $(Self::$variant => $word,)* }
            }
        }
        $crate::options::words!(of $own { $($variant $word $(| $alias)? $help,)* });
    };
    (alias) => { None };
    (alias $alias:literal) => { Some($alias) };
    (of $own:ty { $($variant:ident $word:literal $(| $alias:literal)? $help:literal,)* }) => {
        impl $crate::options::OptionText for $own {
            const PYTHON: &'static str = "";

            fn words() -> Vec<$crate::options::Word> {
                vec![$($crate::options::Word { word: $word, alias: $crate::options::words!(alias $($alias)?), help: $help },)*]
            }

            fn of(text: &str) -> Result<Self, String> {
                match text {
                    $($word $(| $alias)? => Ok(Self::$variant),)*
                    other => Err($crate::options::none_of(other, &Self::words())),
                }
            }

            fn text(&self) -> String {
                match self { $(Self::$variant => $word,)* }.to_owned()
            }
        }
    };
}

pub(crate) use words;
