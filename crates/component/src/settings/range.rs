//! The range of a setting, from the check that enforces it.

use super::{
    form::{Field, Form},
    probe::{Probe, Step},
};

/// A limit of a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bound {
    /// The limit is permitted.
    Included(f64),
    /// The limit is not permitted.
    Excluded(f64),
}

/// The range of a setting.
///
/// The words are those of the check's message. The limits are the numbers in it at which the check begins to refuse;
/// a limit that depends on another setting is in the words only.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Range {
    /// The range in words.
    pub words: String,
    /// The lower limit, if it is fixed.
    pub min: Option<Bound>,
    /// The upper limit, if it is fixed.
    pub max: Option<Bound>,
    /// Whether a text may not be empty.
    pub filled: bool,
}

/// The range of the setting that `probe` tries; `siblings` are the settings of its table.
pub(super) fn range(probe: &Probe<'_>, form: &Form, siblings: &[Field]) -> Range {
    match form {
        Form::Flag => Range { words: "true or false".to_owned(), ..Range::default() },
        Form::Text => text(probe),
        Form::Words(words) => {
            let words: Vec<String> = words.iter().map(|(word, _)| format!("`{word}`")).collect();
            Range { words: words.join(", "), ..Range::default() }
        }
        Form::Integer { min, max } => {
            let smallest = if *min == i64::MIN { "any whole number".to_owned() } else { format!("{min} or more") };
            let own = if *max < i64::from(u32::MAX) { format!("{min} to {max}") } else { smallest };
            let values = [*min, *max].map(toml::Value::Integer);
            let value = |number: f64, up: i64| toml::Value::Integer((number as i64).saturating_add(up));
            let mut found = number(probe, &values, value, siblings);
            // The type's own limits hold in any case; Excluded(3) is 4 or more.
            let low = found.min.map(|bound| bound.integer(1)).unwrap_or(*min).max(*min);
            found.min = (low != i64::MIN).then_some(Bound::Included(low as f64));
            let high = found.max.map(|bound| bound.integer(-1)).unwrap_or(*max).min(*max);
            found.max = (high != i64::MAX).then_some(Bound::Included(high as f64));
            found.words = if found.words.is_empty() { own } else { found.words };
            found
        }
        Form::Number => {
            let values = [f64::MIN, f64::MAX].map(toml::Value::Float);
            let value = |number: f64, up: i64| {
                toml::Value::Float(match up {
                    0 => number,
                    1 => number.next_up(),
                    _ => number.next_down(),
                })
            };
            let mut found = number(probe, &values, value, siblings);
            if found.words.is_empty() {
                let nan = probe.rejected(&toml::Value::Float(f64::NAN), None);
                found.words = nan.as_deref().and_then(remedy).unwrap_or("any number").to_owned();
            }
            found
        }
        Form::List { of, length } => {
            let path: Vec<Step> = probe.path.iter().cloned().chain([Step::Entry]).collect();
            let each = range(&Probe { path: &path, ..*probe }, of, &[]);
            let count = length.map_or("a list".to_owned(), |length| format!("{length} values"));
            // The words of a check may be those of the complete list.
            let words = if each.words.starts_with("the ") { &each.words } else { &format!("each {}", each.words) };
            Range { words: format!("{count}, {words}"), ..each }
        }
        Form::Component { kind, .. } => {
            let article = if kind.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
            Range { words: format!("{article} {kind}"), ..Range::default() }
        }
        Form::OneOf(forms) => {
            let all: Vec<Range> = forms.iter().map(|form| range(probe, form, siblings)).collect();
            let mut words: Vec<String> = all.iter().map(|range| range.words.clone()).collect();
            words.dedup();
            let own = all.into_iter().zip(forms).find(|(_, form)| matches!(form, Form::Number)).map(|(range, _)| range);
            match own {
                // The message of a number with words beside it names both.
                Some(range) if range.words != "any number" => range,
                own => Range { words: words.join(", or "), ..own.unwrap_or_default() },
            }
        }
        Form::Table(_) => Range { words: "a table".to_owned(), ..Range::default() },
        Form::Any => Range { words: "any value".to_owned(), ..Range::default() },
    }
}

impl Bound {
    /// The limit of an integer; an excluded one is moved by `inside`.
    fn integer(self, inside: i64) -> i64 {
        match self {
            Self::Included(limit) => limit as i64,
            Self::Excluded(limit) => limit as i64 + inside,
        }
    }
}

/// The range of a text: an empty one may be refused.
fn text(probe: &Probe<'_>) -> Range {
    let empty = probe.rejected(&"".into(), None);
    let filled = empty.is_some() && probe.rejected(&"x".into(), None) != empty;
    let own = if filled { "a text, not empty" } else { "a text" };
    let words = empty.as_deref().and_then(remedy).unwrap_or(own).to_owned();
    Range { words, filled, ..Range::default() }
}

/// The range of a number with these extreme values; `value` is the number, or its neighbour above or below.
fn number(
    probe: &Probe<'_>,
    extremes: &[toml::Value; 2],
    value: impl Fn(f64, i64) -> toml::Value,
    siblings: &[Field],
) -> Range {
    let [low, high] = extremes.each_ref().map(|value| probe.rejected(value, None));
    let mut words: Vec<&str> = [&low, &high].into_iter().flatten().filter_map(|message| remedy(message)).collect();
    words.dedup();
    let words = words.join("; ");
    let others: Vec<&Field> = siblings.iter().filter(|field| mentions(&words, field.key)).collect();
    // A value may be refused for another reason than the range, such as a product of two settings.
    let out = |value: &toml::Value, other, extreme: &str| {
        probe.rejected(value, other).is_some_and(|message| remedy(&message) == remedy(extreme))
    };
    // The limit is independent of the settings in the message if it stays when they change.
    let fixed = |inside: toml::Value, outside: toml::Value| {
        others.iter().flat_map(|field| changed(probe, field)).all(|(key, other)| {
            let rejected = |value: &toml::Value| probe.rejected(value, Some((key, other.clone()))).is_some();
            rejected(&outside) && !rejected(&inside)
        })
    };
    let in_list = probe.path.last() == Some(&Step::Entry);
    let bound = |rejected: &Option<String>, inside: i64| {
        let extreme = rejected.as_ref()?;
        let mut candidates = numbers(&words, in_list);
        // The outermost number; a number that is not a limit is rejected on both sides.
        candidates.sort_by(|a, b| if inside > 0 { a.total_cmp(b) } else { b.total_cmp(a) });
        let out = |number: f64, up: i64| out(&value(number, up), None, extreme);
        candidates.into_iter().find_map(|c| match (out(c, 0), out(c, -inside), out(c, inside)) {
            (false, true, _) if fixed(value(c, 0), value(c, -inside)) => Some(Bound::Included(c)),
            (true, _, false) if fixed(value(c, inside), value(c, 0)) => Some(Bound::Excluded(c)),
            _ => None,
        })
    };
    Range { min: bound(&low, 1), max: bound(&high, -1), words, filled: false }
}

/// Other valid values of a number.
fn changed(probe: &Probe<'_>, field: &Field) -> Vec<(&'static str, toml::Value)> {
    let Some((_, above)) = probe.path.split_last() else { return Vec::new() };
    let steps = above.iter().try_fold(toml::Value::Table(probe.defaults.clone()), |here, step| match step {
        Step::Key(key) | Step::Only(key) => here.get(key).cloned(),
        Step::Entry => here.get(0).cloned(),
    });
    let values = match steps.as_ref().and_then(|table| table.get(field.key)) {
        Some(toml::Value::Integer(number)) => vec![(number * 2 + 1).into(), (number / 2).into()],
        Some(toml::Value::Float(number)) => vec![(number * 2.0 + 1.0).into(), (number / 2.0).into()],
        _ => Vec::new(),
    };
    values.into_iter().map(|value| (field.key, value)).collect()
}

/// The range in a message `name = value; give RANGE`.
fn remedy(message: &str) -> Option<&str> {
    message.rsplit_once("; give ").map(|(_, range)| range)
}

/// Whether the words contain the key of another setting.
fn mentions(words: &str, key: &str) -> bool {
    words.split(|c: char| !(c.is_alphanumeric() || c == '-')).any(|word| word == key)
}

/// The numbers in a range; and zero and one, which a positive number and a fraction imply.
///
/// The words of a list may be those of one entry, as in `two angles and a positive height`.
fn numbers(words: &str, in_list: bool) -> Vec<f64> {
    let implied: &[f64] = if in_list { &[] } else { &[0.0, 1.0] };
    let written = words.split(|c: char| !(c.is_ascii_alphanumeric() || ".-+".contains(c)));
    let written = written.filter_map(|word| word.trim_end_matches('.').parse::<f64>().ok());
    written.filter(|number| number.is_finite()).chain(implied.iter().copied()).collect()
}
