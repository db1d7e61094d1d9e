//! The form of a value in a file.

use crate::choice::Choice;

/// A type whose form in files is known. `#[derive(Settings)]` implements it for structs and enums of serde.
///
/// The sentence of a setting is the documentation comment of its field; a field without one does not compile.
///
/// ```
/// use seafix_component::{Form, Settings};
///
/// #[derive(serde::Deserialize, Settings)]
/// #[serde(rename_all = "kebab-case")]
/// struct Lamp {
///     /// Electric power (W).
///     max_power: f64,
/// }
///
/// let Form::Table(fields) = Lamp::form() else { panic!("a struct is a table") };
/// assert_eq!((fields[0].key, fields[0].doc), ("max-power", "Electric power (W)."));
/// ```
///
/// ```compile_fail
/// #[derive(seafix_component::Settings)]
/// struct Lamp {
///     power: f64,
/// }
/// ```
///
/// A [`Choice`](crate::Choice) is of the kind that its field names, or of `#[setting(component = "KIND")]`. A value that
/// is written as another type has `#[setting(form = TYPE)]`.
pub trait Settings {
    /// The form of a value of this type.
    fn form() -> Form;

    /// The choices of components in the table's own settings, in the order of its fields.
    fn choices(&mut self) -> Vec<Chosen<'_>> {
        Vec::new()
    }
}

/// A choice of a component in a table of settings.
#[derive(Debug)]
pub struct Chosen<'a> {
    /// The key of the setting.
    pub key: &'static str,
    /// The kind of the component.
    pub kind: &'static str,
    /// The index in a list of choices.
    pub place: Option<usize>,
    /// The choice.
    pub choice: &'a mut Choice,
}

/// The form of a value in a file.
#[derive(Debug, Clone, PartialEq)]
pub enum Form {
    /// Any value.
    Any,
    /// `true` or `false`.
    Flag,
    /// An integer of at least `min` and, if there is a limit, at most `max`.
    Integer {
        /// The smallest integer of the type.
        min: i64,
        /// The largest integer of the type.
        max: i64,
    },
    /// A number.
    Number,
    /// A text.
    Text,
    /// One of these words, each with its meaning.
    Words(Vec<(&'static str, &'static str)>),
    /// A list.
    List {
        /// The form of an entry.
        of: Box<Form>,
        /// The number of entries, if it is fixed.
        length: Option<usize>,
    },
    /// A table with these settings.
    Table(Vec<Field>),
    /// A value of one of these forms.
    OneOf(Vec<Form>),
    /// The choice of a component.
    Component {
        /// The kind: `solver`, `search`, …
        kind: &'static str,
        /// Whether a table may omit the name.
        nameless: bool,
    },
}

impl Form {
    /// The choice of a component of this kind; `nameless` if its table may omit the name.
    pub fn component(kind: &'static str, nameless: bool) -> Self {
        Self::Component { kind, nameless }
    }

    /// A list of any length.
    pub fn list(of: Self) -> Self {
        Self::List { of: Box::new(of), length: None }
    }

    /// The form of a value that is known by its default only.
    pub(crate) fn of_default(value: &toml::Value) -> Self {
        match value {
            toml::Value::Boolean(_) => Self::Flag,
            toml::Value::Integer(_) => i64::form(),
            toml::Value::Float(_) => Self::Number,
            toml::Value::String(_) => Self::Text,
            toml::Value::Array(list) => Self::list(list.first().map_or(Self::Any, Self::of_default)),
            toml::Value::Table(_) | toml::Value::Datetime(_) => Self::Any,
        }
    }

    /// A value of this form, with the required settings only.
    pub(crate) fn sample(&self) -> toml::Value {
        match self {
            Self::Any | Self::Text | Self::Component { .. } => "x".into(),
            Self::Flag => false.into(),
            Self::Integer { min, .. } => (*min).max(1).into(),
            Self::Number => 1.0.into(),
            Self::Words(words) => words.first().map_or("", |(word, _)| *word).into(),
            Self::List { of, length } => (0..length.unwrap_or(0)).map(|_| of.sample()).collect::<Vec<_>>().into(),
            Self::Table(fields) => {
                let required = fields.iter().filter(|field| field.required);
                required.map(|field| (field.key.to_owned(), field.form.sample())).collect::<toml::Table>().into()
            }
            Self::OneOf(forms) => forms.first().map_or("x".into(), Self::sample),
        }
    }
}

/// A setting of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// The key.
    pub key: &'static str,
    /// The sentence: meaning, unit, and the reason of the default.
    pub doc: &'static str,
    /// The form of the value.
    pub form: Form,
    /// Whether a table without it is invalid.
    pub required: bool,
}

impl Field {
    /// A setting; an optional value is not required.
    pub fn new(key: &'static str, doc: &'static str, form: Form, required: bool) -> Self {
        Self { key, doc, form, required }
    }
}

impl Settings for f64 {
    fn form() -> Form {
        Form::Number
    }
}

impl Settings for f32 {
    fn form() -> Form {
        Form::Number
    }
}

impl Settings for bool {
    fn form() -> Form {
        Form::Flag
    }
}

impl Settings for String {
    fn form() -> Form {
        Form::Text
    }
}

impl Settings for toml::Value {
    fn form() -> Form {
        Form::Any
    }
}

impl Settings for toml::Table {
    fn form() -> Form {
        Form::Any
    }
}

macro_rules! integers {
    ($($integer:ty: $min:expr, $max:expr;)*) => {
        $(impl Settings for $integer {
            fn form() -> Form {
                Form::Integer { min: $min, max: $max }
            }
        })*
    };
}

// TOML has integers of 64 bits with sign.
integers! {
    u8: 0, u8::MAX.into();
    u16: 0, u16::MAX.into();
    u32: 0, u32::MAX.into();
    u64: 0, i64::MAX;
    usize: 0, i64::MAX;
    i32: i32::MIN.into(), i32::MAX.into();
    i64: i64::MIN, i64::MAX;
}

impl<T: Settings> Settings for Option<T> {
    fn form() -> Form {
        T::form()
    }
}

impl<T: Settings> Settings for Vec<T> {
    fn form() -> Form {
        Form::list(T::form())
    }
}

impl<T: Settings, const N: usize> Settings for [T; N] {
    fn form() -> Form {
        Form::List { of: Box::new(T::form()), length: Some(N) }
    }
}
