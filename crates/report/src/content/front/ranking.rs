//! A clause on named cases in order of a measured value, and on the differences that their intervals show.

use super::measured::Measured;
use crate::{
    document::{Text, text},
    format::quoted,
};

/// Maximum number of cases that a clause lists, as many as one reads at a glance.
const LISTED: usize = 4;

/// A case of a ranking.
pub(super) struct Case {
    pub(super) name: String,
    pub(super) value: Measured,
    /// The trials that the value pools.
    pub(super) members: Vec<usize>,
    /// The words after the value: its number of attempts.
    pub(super) tail: Text,
}

/// The words of a ranking: its quantity, and the adjectives for the best and the other values.
pub(super) struct Words<'a> {
    pub(super) quantity: &'a str,
    pub(super) best: &'static str,
    pub(super) worst: &'static str,
    pub(super) worse: &'static str,
}

/// The clause on `cases`, the best first; two at least.
///
/// A case whose difference from the best is significant by `differs` is named with its value, or the worst of them if they
/// are many.
pub(super) fn clause(cases: &[Case], words: &Words<'_>, differs: &dyn Fn(&Case, &Case) -> bool) -> Text {
    let [best, .., last] = cases else { return Text::new() };
    let Words { quantity, best: superlative, worst, worse } = words;
    let ties =
        |of: &Case| -> Vec<&Case> { cases.iter().filter(|case| case.value.value() == of.value.value()).collect() };
    let firsts = ties(best);
    let (apart, close): (Vec<&Case>, Vec<&Case>) = cases[firsts.len()..].iter().partition(|case| differs(case, best));
    let named = |case: &Case| {
        let mut message = case.value.text();
        message.extend(case.tail.clone());
        message
    };
    let mut message = Text::new();
    if firsts.len() == cases.len() {
        message.push(format!("the {quantity} is the same in all {} cases, ", cases.len()).into());
        message.extend(named(best));
        return message;
    }
    if apart.is_empty() {
        let mut ends = [(last, ties(last)), (best, firsts)];
        ends.sort_by(|a, b| a.0.value.value().total_cmp(&b.0.value.value()));
        let (begin, between) = if cases.len() == 2 { ("is ", " and ") } else { ("ranges from ", " to ") };
        message.push(format!("no difference of the {quantity} is significant: it {begin}").into());
        for (place, (case, own)) in ends.iter().enumerate() {
            message.push(if place > 0 { between } else { "" }.into());
            message.extend(named(case));
            message.push(format!(" with {}", some_names(own)).into());
        }
        return message;
    }
    message.push(format!("the {quantity} is {superlative} with {}, ", some_names(&firsts)).into());
    message.extend(named(best));
    if !close.is_empty() {
        message.push(format!(", not significantly different from {}", some_names(&close)).into());
    }
    if apart.len() <= LISTED {
        message.push(format!(", and {worse} with ").into());
        for (place, case) in apart.iter().enumerate() {
            message.push(separator(place, apart.len()).into());
            message.push(format!("{} (", quoted(&case.name)).into());
            message.extend(case.value.text());
            message.push(")".into());
        }
    } else {
        message.push(format!(", and {worst} with {}, ", some_names(&ties(last))).into());
        message.extend(named(last));
    }
    message
}

/// The words before an item of a list.
fn separator(place: usize, count: usize) -> &'static str {
    match place {
        0 => "",
        _ if place + 1 == count => " and ",
        _ => ", ",
    }
}

/// The names of cases in a sentence, or the first of many.
fn some_names(cases: &[&Case]) -> String {
    match cases {
        [first, ..] if cases.len() > LISTED => format!("{} and {} others", quoted(&first.name), cases.len() - 1),
        _ => names(cases.iter().map(|case| case.name.as_str())),
    }
}

/// Names in a sentence: `a, b and c`.
pub(super) fn names<'a>(names: impl ExactSizeIterator<Item = &'a str>) -> String {
    let count = names.len();
    names.enumerate().map(|(place, name)| format!("{}{}", separator(place, count), quoted(name))).collect()
}

/// Cases in decreasing order of their values.
pub(super) fn decreasing(mut cases: Vec<Case>) -> Vec<Case> {
    cases.sort_by(|a, b| b.value.value().total_cmp(&a.value.value()));
    cases
}

/// The text of a number of attempts: ` of 41 attempts`.
pub(super) fn of_attempts(n: crate::number::Number) -> Text {
    text![" of ", n, " attempts"]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        document::Span,
        number::{Key, Number},
    };

    fn case(name: &str, value: f64, [low, high]: [f64; 2]) -> Case {
        let number = |value| {
            let key = Key { what: String::new(), topic: String::new(), span: [0; 2], logs: Vec::new() };
            Number::new(Some(value), 0, key)
        };
        let value = Measured::new([value, low, high].map(number), " %");
        Case { name: name.to_owned(), value, members: Vec::new(), tail: Text::new() }
    }

    fn read(cases: Vec<Case>) -> String {
        let words = Words { quantity: "rate", best: "highest", worst: "lowest", worse: "lower" };
        clause(&decreasing(cases), &words, &|a, b| a.value.differs(&b.value)).iter().map(Span::plain).collect()
    }

    /// Each test of this sentence was seen to fail where the values alone decide.
    #[test]
    fn small_differences_are_not_significant() {
        let cases = vec![case("a", 70.0, [50.0, 85.0]), case("b", 73.0, [53.0, 88.0]), case("c", 56.0, [37.0, 74.0])];
        assert_eq!(
            read(cases),
            "no difference of the rate is significant: it ranges from 56 % [37, 74] with c to 73 % [53, 88] with b"
        );
    }

    #[test]
    fn cases_near_the_best_are_named() {
        let cases = vec![
            case("a b", 74.0, [69.0, 80.0]),
            case("c", 74.0, [69.0, 80.0]),
            case("d", 72.0, [67.0, 78.0]),
            case("e", 17.0, [13.0, 22.0]),
            case("f", 60.0, [52.0, 68.0]),
        ];
        assert_eq!(
            read(cases),
            "the rate is highest with “a b” and c, 74 % [69, 80], not significantly different from d, and lower with f (60 % [52, \
             68]) and e (17 % [13, 22])"
        );
    }

    #[test]
    fn of_many_lower_cases_the_lowest_are_named() {
        let low = |name| case(name, 20.0, [15.0, 25.0]);
        let mut cases: Vec<Case> = ["b", "c", "d", "e"].map(low).into();
        cases.extend([case("a", 74.0, [69.0, 80.0]), case("f", 10.0, [8.0, 12.0])]);
        assert_eq!(read(cases), "the rate is highest with a, 74 % [69, 80], and lowest with f, 10 % [8, 12]");
        let alike = vec![case("a", 20.0, [15.0, 25.0]), low("b")];
        assert_eq!(read(alike), "the rate is the same in all 2 cases, 20 % [15, 25]");
    }
}
