use super::*;

/// Words and queries alternate; options, extremes and quoted values are read.
///
/// Seen to fail where options are separated by commas, as conditions are.
#[test]
fn a_template_has_words_and_queries() {
    let text = r#"Yes: {fix-rate: method="a, b", altitude=2.5|3.5; interval; bare} of
        {largest median position_error: method=any}."#;
    let answer = Answer::parse(text, &["wrong: all = 0"]).expect("it is an answer");
    let [Piece::Words(first), Piece::Query(rate), Piece::Words(of), Piece::Query(error), Piece::Words(end)] =
        &answer.pieces[..]
    else {
        panic!("{answer:?}")
    };
    assert_eq!([first.as_str(), of, end], ["Yes: ", " of ", "."]);
    assert_eq!(rate.shown, Shown { part: Part::Interval, bare: true });
    let Expression::Term(term) = &rate.expression else { panic!("{rate:?}") };
    assert_eq!(term.quantity, Quantity::Rate(Group::Fixes));
    let values: Vec<_> = term.selection.conditions.iter().map(|c| (c.key.as_str(), c.values.join("/"))).collect();
    assert_eq!(values, [("method", "a, b".to_owned()), ("altitude", "2.5/3.5".to_owned())]);
    let Expression::Term(term) = &error.expression else { panic!("{error:?}") };
    assert_eq!((term.extreme, term.selection.conditions[0].values.len()), (Some(Extreme::Largest), 0));
    assert_eq!(answer.claims[0].text, "wrong: all = 0");
}

#[test]
fn expressions_and_claims_have_two_sides() {
    let parsed = |query: &str| Query::parse(query).map(|query| query.expression);
    let Ok(Expression::Change(quantity, [a, b])) = parsed(r#"change fix-rate: m=new - m="old - older""#) else {
        panic!("no change")
    };
    assert_eq!(quantity, Quantity::Rate(Group::Fixes));
    assert_eq!([a.text.as_str(), &b.text], ["m=new", r#"m="old - older""#]);
    assert!(matches!(parsed("percent fixes: m=a / attempts: m=b"), Ok(Expression::Combined(Operation::Percent, _))));
    assert!(matches!(parsed("common fix-rate: a=5 & a=any"), Ok(Expression::Common(..))));
    let relation = |claim: &str| Claim::parse(claim).map(|claim| claim.relation);
    let significant = relation("not significant(median tre_rms: m=a - m=b; of 4)");
    assert!(matches!(significant, Ok(Relation::Significant { is: false, cases: 4, .. })), "{significant:?}");
    let Ok(Relation::Compared(sides, sign)) = relation("fix-rate: m=a; low >= 50") else { panic!("no comparison") };
    assert!(sides[1] == Side::Number(50.0) && sign.holds(50.0, 50.0) && !sign.holds(49.0, 50.0));
}

/// Each fault names its query and a remedy.
#[test]
fn faults_have_a_place_and_a_remedy() {
    let faulty = |text: &str, claims: &[&str]| Answer::parse(text, claims).expect_err(text).to_string();
    assert!(
        faulty("{fixrate: m=a}", &[])
            .starts_with("unknown quantity `fixrate` in `fixrate: m=a`; did you mean `fix-rate`")
    );
    assert!(faulty("{median position_eror: all}", &[]).contains("did you mean `median position_error`"));
    assert!(faulty("{fix-rate}", &[]).contains("no selection of trials in `fix-rate`"));
    assert!(faulty("{fix-rate: new}", &[]).contains("`new` selects no trial"));
    assert!(faulty("{fix-rate: all; wide}", &[]).contains("there are interval, low, high and bare"));
    assert!(faulty("a {fix-rate: all", &[]).contains("no closing brace"));
    assert!(faulty("a } b", &[]).contains("no opening brace"));
    assert!(faulty(" ", &[]).contains("an empty answer"));
    assert!(faulty("{ratio fixes: all}", &[]).contains("not two sides of `/`"));
    assert!(faulty("Yes.", &["fix-rate: all"]).contains("no relation in `fix-rate: all`"));
    assert!(faulty("Yes.", &["significant(fix-rate: m=a - m=b; of 1)"]).contains("no number of cases"));
    assert!(faulty("Yes.", &["significant(fix-rate: m=a - m=b"]).contains("no closing parenthesis"));
}
