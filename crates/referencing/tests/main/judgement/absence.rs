//! The probability that decides, depending on evidence, clutter and the setting.

use seafix_referencing::MaxPWrong;

use super::*;

/// The attempt at an object of seventeen points, six of them visible, beside 120 clutter points.
///
/// `max_p_wrong` is the setting; `ln_evidence` (nats) is that of the object, `alone` that of a repeated pattern
/// without the object. `clutter` maps three numbers uniform in 0…1 to a position.
fn with_evidence(
    max_p_wrong: MaxPWrong,
    ln_evidence: f64,
    alone: Option<f64>,
    clutter: impl Fn([f64; 3]) -> Point<Camera>,
) -> Attempt {
    let acceptance = Acceptance { max_p_wrong, ..Acceptance::default() };
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut uniform = || [(); 3].map(|()| rng.random_range(0.0..1.0));
    let more: Vec<[f64; 3]> = (0..10).map(|_| uniform().map(|x| 4.0 * x - 2.0)).collect();
    let model = model_of(&[&MODEL[..], &more].concat());
    let mut cloud = cloud_of(&model[..6], &mut ChaCha8Rng::seed_from_u64(8));
    let measured = |at| MeasuredPoint { position: UncertainPoint::isotropic(at, SIGMA), pixels: None };
    cloud.extend((0..120).map(|_| measured(clutter(uniform()))));
    let candidates = Candidates::all(model.len(), cloud.len());
    let problem = Problem {
        model: &model,
        cloud: &cloud,
        candidates: &candidates,
        tolerance: Tolerance::Sigmas(4.0),
        prior: None,
        edges: Default::default(),
    };
    let pairs: Vec<Correspondence> = (0..6).map(|i| Correspondence { model: i, cloud: i }).collect();
    let best = Explanation {
        pairs: pairs.clone(),
        edges: Vec::new(),
        object_from_camera: motion(),
        ln_evidence,
        ln_clutter_density: 0.0,
    };
    let posterior = Some(Posterior { explanations: vec![best], pattern_alone: alone, ..Posterior::default() });
    let found = MaximumClique::default().search(&problem, &mut ChaCha8Rng::seed_from_u64(0)).expect("a set");
    let found = Identification { pairs, posterior, undecided: None, ..found };
    judge(&problem, Ok(found), &Kabsch::default(), &acceptance, None)
}

fn space([u, v, w]: [f64; 3]) -> Point<Camera> {
    Point::new(4.0 * u - 2.0, 4.0 * v - 2.0, 3.0 + 2.0 * w)
}

fn line([u, v, _]: [f64; 3]) -> Point<Camera> {
    Point::new(4.0 * u - 2.0, (4.0 * v).floor() - 2.0, 4.0)
}

/// One setting decides by one number, and does not change it. A rejected answer has its pose, with covariance.
///
/// Fails if another limit rejects, if the setting enters the probability, and if the best pose is dropped.
#[test]
fn the_setting_decides_and_changes_no_probability() {
    let settings = MaxPWrong::PRESETS.into_iter().chain([0.3, 1.0].map(MaxPWrong::Number));
    let (mut fixes, mut rejected) = (0, 0);
    for ln_evidence in [0.0, 4.0, 6.0, 8.0, 10.0, 12.0, 16.0, 20.0] {
        let p_wrong = with_evidence(MaxPWrong::Balanced, ln_evidence, None, space).p_wrong.expect("a posterior");
        for max in settings.clone() {
            let attempt = with_evidence(max, ln_evidence, None, space);
            assert_eq!(attempt.p_wrong, Some(p_wrong), "{max} {ln_evidence}");
            assert!(attempt.p_absent.is_some_and(|p_absent| p_absent <= p_wrong));
            match &attempt.outcome {
                Outcome::Fix(_) => {
                    assert!(max.allows(p_wrong) && attempt.best.is_none(), "{max}: {p_wrong}");
                    fixes += 1;
                }
                Outcome::Rejected(rejection @ RejectionReason::Absent { identified: 6, model: 17, .. }) => {
                    assert!(!max.allows(p_wrong) && rejection.reason() == "absent", "{max}: {p_wrong}");
                    let best = attempt.best.as_ref().expect("the rejected pose");
                    let xi = best.object_from_camera.error_to(&motion());
                    let sigma = best.covariance.expect("a covariance").matrix.cholesky().expect("positive");
                    assert!(best.pairs.len() == 6 && xi.dot(&sigma.solve(&xi)) < 22.5, "within its covariance");
                    rejected += 1;
                }
                other => panic!("{other:?}"),
            }
        }
    }
    assert!(fixes >= 10 && rejected >= 10, "{fixes} {rejected}");
}

/// A repeated pattern has the same probability for every distribution of the clutter: the limit 1e-3 is reached 6.9 nats
/// below the object's evidence.
#[test]
fn a_pattern_counts_alike_in_every_clutter() {
    for clutter in [&space as &dyn Fn([f64; 3]) -> Point<Camera>, &line] {
        let fixed = |alone| {
            let attempt = with_evidence(MaxPWrong::Balanced, 40.0, Some(alone), clutter);
            matches!(attempt.outcome, Outcome::Fix(_))
        };
        assert!(fixed(32.6) && !fixed(33.6));
    }
    assert!(matches!(with_evidence(MaxPWrong::Number(1.0), 0.0, None, line).outcome, Outcome::Fix(_)));
}
