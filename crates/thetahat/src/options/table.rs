use schemars::JsonSchema;
use serde_json::{Map, Value};

use super::kind::Kind;
use super::value::{Form, Word};
use crate::Error;

/// What is known of an option.
#[derive(Debug, Clone, Copy)]
pub struct OptionRow {
    /// Its name as a field: `dc_gain`, which is an option `dc-gain` on a command line.
    pub field: &'static str,
    /// What it does. Other options are named between backticks.
    pub help: &'static str,
    /// How a value is written, in short.
    pub notation: &'static str,
    /// The default value; empty: none, or the help has it.
    pub default: &'static str,
    /// Under which heading it stands.
    pub heading: &'static str,
    /// The kinds that take it; none: all.
    pub kinds: &'static [Kind],
    /// How often it may be given, and what its value is.
    pub form: Form,
    /// Whether its value may begin with a minus sign.
    pub signed: bool,
    /// The values that it may have, where that is a list.
    pub words: fn() -> Vec<Word>,
    /// The type of its value in Python; empty: one of the words.
    pub python: &'static str,
    /// What JSON may hold, as a JSON Schema.
    pub schema: fn() -> Value,
}

impl OptionRow {
    /// Its name as an option, such as `dc-gain`.
    pub fn name(&self) -> String {
        self.field.replace('_', "-")
    }

    /// Whether a kind takes it.
    pub fn is_for(&self, kind: Kind) -> bool {
        self.kinds.is_empty() || self.kinds.contains(&kind)
    }

    /// The JSON Schema of its value, with what it does.
    pub(crate) fn described(&self) -> Value {
        let mut schema = (self.schema)();
        schema["description"] = match self.default {
            "" => self.help.trim().into(),
            default => format!("{} [default: {default}]", self.help.trim()).into(),
        };
        schema
    }
}

/// Options that were given, of a table.
pub trait Options: Default + JsonSchema {
    /// All of them.
    const TABLE: &'static [OptionRow];

    /// Sets one option.
    ///
    /// # Errors
    /// [`Error::Argument`] for an option that is none, and for a value that it cannot have.
    fn set(&mut self, name: &str, value: &Value) -> Result<(), Error>;

    /// Those that were given, in the order of the table, each with its value as it is written.
    fn given(&self) -> Vec<(&'static OptionRow, Value)>;

    /// These, and in their place others where those were given.
    #[must_use]
    fn or(self, others: Self) -> Self;

    /// Those of an object, such as a plan that was read.
    ///
    /// # Errors
    /// As for [`set`](Self::set).
    fn of(values: &Map<String, Value>) -> Result<Self, Error> {
        let mut options = Self::default();
        for (name, value) in values {
            if !value.is_null() {
                options.set(name, value)?;
            }
        }
        Ok(options)
    }

    /// What JSON may hold, as a JSON Schema.
    fn schema() -> Value {
        schemars::schema_for!(Self).to_value()
    }

    /// Refuses an option that this kind does not take. `because` is the option that asks for it.
    ///
    /// # Errors
    /// [`Error::Argument`] that names the first one.
    fn check_kind(&self, kind: Kind, because: Option<&str>) -> Result<(), Error> {
        let given = self.given();
        let Some((foreign, _)) = given.iter().find(|(option, _)| !option.is_for(kind)) else { return Ok(()) };
        let message = match because {
            Some(because) => format!("does not work with {because}; leave one of the two out"),
            None => format!("it is for {}; leave it out, or give that", Kind::list(foreign.kinds)),
        };
        Err(Error::argument(&foreign.name(), message))
    }
}

/// A table of options, and the struct of those that were given, each where it was.
///
/// A row is: what it does, as its doc; its name and the type of its value; how that is written; the default; the
/// heading; the kinds that take it, in brackets, or nothing where all do.
macro_rules! options {
    ($(#[$about:meta])* $name:ident of $what:literal {
        $($(#[doc = $doc:literal])+ $field:ident: $kind:ty, $notation:literal, $default:literal, $heading:ident
            $(, [$($of:ident)+])?;)*
    }) => {
        $(#[$about])*
        #[derive(Debug, Clone, PartialEq, Default)]
        pub struct $name {
            $($(#[doc = $doc])+ pub $field: $kind,)*
        }

        impl $crate::options::Options for $name {
            const TABLE: &'static [$crate::options::OptionRow] = &[$($crate::options::OptionRow {
                field: stringify!($field),
                help: concat!($($doc),+),
                notation: $notation,
                default: $default,
                heading: $heading,
                kinds: &[$($($of),+)?],
                form: <$kind as $crate::options::OptionValue>::FORM,
                signed: <$kind as $crate::options::OptionValue>::SIGNED,
                words: <$kind as $crate::options::OptionValue>::words,
                python: <$kind as $crate::options::OptionValue>::PYTHON,
                schema: <$kind as $crate::options::OptionValue>::schema,
            },)*];

            fn set(&mut self, name: &str, value: &serde_json::Value) -> Result<(), $crate::Error> {
                let option = name.replace('_', "-");
                match &*name.replace('-', "_") {
                    $(stringify!($field) => self.$field = $crate::options::OptionValue::read(&option, value)?,)*
                    _ => {
                        let names: Vec<String> = Self::TABLE.iter().map($crate::options::OptionRow::name).collect();
                        let meant = $crate::text::suggestion(&option, names.iter().map(String::as_str));
                        return Err($crate::Error::argument(&option, format!("{} has no such option{meant}", $what)));
                    }
                }
                Ok(())
            }

            fn given(&self) -> Vec<(&'static $crate::options::OptionRow, serde_json::Value)> {
                let values =
                    [$($crate::options::OptionValue::is_given(&self.$field).then(|| $crate::options::OptionValue::write(&self.$field)),)*];
                Self::TABLE.iter().zip(values).filter_map(|(option, value)| Some((option, value?))).collect()
            }

            fn or(self, others: Self) -> Self {
                Self {
                    $($field: match $crate::options::OptionValue::is_given(&self.$field) {
                        true => self.$field,
                        false => others.$field,
                    },)*
                }
            }
        }

        impl serde::Serialize for $name {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                let given = $crate::options::Options::given(self);
                serializer.collect_map(given.into_iter().map(|(option, value)| (option.field, value)))
            }
        }

        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let values = serde_json::Map::deserialize(deserializer)?;
                $crate::options::Options::of(&values).map_err(serde::de::Error::custom)
            }
        }

        impl schemars::JsonSchema for $name {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($name).into()
            }

            fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
                let rows = <Self as $crate::options::Options>::TABLE.iter();
                let properties: serde_json::Map<String, serde_json::Value> =
                    rows.map(|option| (option.field.to_owned(), option.described())).collect();
                schemars::json_schema!({ "type": "object", "properties": properties, "additionalProperties": false })
            }
        }
    };
}

pub(crate) use options;
