//! Complete enumeration of small domains: all small association graphs, and all orders of a few events of the
//! navigator.

use seafix_component::Choice;
use seafix_navigation::{Event, FUSIONS, Navigated, Navigator, State};
use seafix_proptests::{
    graphs::{ANY, Graph, MAX, Posts, TURNS, Which, graphs},
    orders::{BLIND, Did, Happening, Kind, Ledger, Listener, Must, OBJECTS, Site, happens, is_better},
    searches::{Tried, searches},
};
use seafix_referencing::{Correspondence, Kabsch, Observations, Problem, Rejected, Solver, Tolerance};

/// The minimum size of an answer.
const NEEDED: usize = 3;

/// The objective of a search.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Measure {
    /// The size of a coherent set.
    Size,
    /// The size of a coherent set that also passes a joint test of all distances, as each coherent set of [`Posts`]
    /// does.
    Jointly,
    /// The size of a coherent set that a rigid motion also explains.
    Rigidly,
}

/// The exact searches and their objectives.
fn exact() -> Vec<(Tried, Measure)> {
    let measure = |search: &Tried| match search.name.split(' ').next() {
        _ if search.claims.exact => Some(Measure::Size),
        Some("joint-compatibility") => Some(Measure::Jointly),
        Some("interpretation-tree") => Some(Measure::Rigidly),
        _ => None,
    };
    searches(1_000_000).into_iter().filter_map(|search| measure(&search).map(|measure| (search, measure))).collect()
}

/// Whether each pair is within the tolerance of its position by the least-squares pose of all.
fn is_rigid(problem: &Problem<'_>, set: &[Correspondence]) -> bool {
    let slack = |pair: &Correspondence| match problem.tolerance {
        Tolerance::Fixed(delta) => delta,
        Tolerance::Sigmas(k) => {
            k * (problem.cloud[pair.cloud].position.covariance.trace().sqrt() + problem.model[pair.model].sigma)
        }
    };
    let fitted = Kabsch::default().solve(&Observations::of(set, problem.model, problem.cloud, None));
    fitted.is_ok_and(|pose| {
        let off = |pair: &Correspondence| {
            (pose * problem.cloud[pair.cloud].position.at).distance(&problem.model[pair.model].at)
        };
        set.iter().all(|pair| off(pair) <= slack(pair))
    })
}

/// Compares searches with brute force over one graph, and over the same with a fixed Δ where one gives it.
fn hold<'a>(
    searches: impl Iterator<Item = &'a (Tried, Measure)> + Clone,
    posts: &Posts,
    graph: &Graph,
    turns: [usize; 2],
) {
    let planted = posts.realised(graph, turns);
    assert!(planted.cloud.iter().all(|point| point.position.covariance.cholesky().is_some()), "{graph:?}");
    hold_problem(searches.clone(), &planted.problem(), graph);
    if graph.all_agree() {
        hold_problem(searches, &Problem { tolerance: Tolerance::Fixed(ANY), ..planted.problem() }, graph);
    }
}

fn hold_problem<'a>(searches: impl Iterator<Item = &'a (Tried, Measure)>, problem: &Problem<'_>, graph: &Graph) {
    for (v, w) in (0..graph.models.len()).flat_map(|v| (0..v).map(move |w| (v, w))) {
        let agree = problem.coherent(graph.correspondence(v), graph.correspondence(w));
        assert_eq!(agree, graph.adjacent(v, w), "vertices {v} and {w} of {graph:?}");
    }
    let mut cliques = graph.cliques();
    let max = cliques[0].len();
    let rigid = cliques.iter().find(|set| set.len() >= NEEDED && is_rigid(problem, set)).map_or(0, Vec::len);
    cliques.retain(|set| set.len() >= max.min(rigid));
    for (search, measure) in searches {
        let message = || format!("{} of {graph:?}", search.name);
        let size = if *measure == Measure::Rigidly { rigid } else { max };
        match search.answer_to(problem) {
            Ok(found) => {
                assert!(
                    found.pairs.len() == size && cliques.contains(&found.pairs),
                    "{}: {:?}",
                    message(),
                    found.pairs
                );
                assert!(
                    *measure != Measure::Rigidly || is_rigid(problem, &found.pairs),
                    "{}: {:?}",
                    message(),
                    found.pairs
                );
                assert!(found.undecided.is_none(), "{}: {:?}", message(), found.undecided);
                let bound = if search.claims.exact { max } else { graph.model_points() };
                assert!((max..=bound).contains(&found.consensus_bound), "{}: {}", message(), found.consensus_bound);
                assert_eq!(found.optimal, search.claims.exact, "{}", message());
                if search.claims.ties {
                    let mut sets = found.alternatives;
                    sets.push(found.pairs);
                    sets.sort_unstable();
                    let all = cliques.iter().take_while(|set| set.len() == max);
                    assert!(found.alternatives_complete && all.eq(&sets), "{}: {sets:?}", message());
                }
            }
            Err(Rejected::TooFew { with_candidates, .. }) => {
                assert!(with_candidates == graph.model_points() && with_candidates < NEEDED, "{}", message());
            }
            Err(Rejected::NoConsensus { best, .. }) => assert!(best == size && size < NEEDED, "{}: {best}", message()),
            Err(Rejected::NotFound { bound, .. }) => {
                assert!(!search.claims.exact && size < NEEDED && bound >= max, "{}: {bound}", message());
            }
            Err(other) => panic!("{}: {other}", message()),
        }
    }
}

/// P22, P23, P34 over a complete domain. For every association graph of up to six vertices, with every assignment of
/// its vertices to model points, every exact search returns a maximum clique, and one with a tie rule all of them.
/// Graphs and assignments that differ only by the names of vertices count once. The same holds for graphs of up to five
/// vertices and four model points with shared cloud points, for every relation of cloud points.
#[test]
fn every_graph_of_six_vertices_is_searched_right() {
    let (searches, posts) = (exact(), Posts::default());
    let all = (0..=MAX)
        .flat_map(|n| graphs(n, Which::Own, false))
        .chain((0..MAX).flat_map(|n| graphs(n, Which::Shared, false)));
    for (number, graph) in all.enumerate() {
        for model in 0..TURNS {
            // All searches once; those that list ties, for which the order of vertices matters, in every order.
            let some = searches.iter().filter(|(search, _)| model == 0 || search.claims.ties);
            hold(some, &posts, &graph, [(model + number) % TURNS, number / TURNS % TURNS]);
        }
    }
}

/// The long form of the law above: all numberings of vertices, several rotations of model and cloud, and up to six
/// vertices that share cloud points.
#[test]
#[ignore = "long: 2.5 million graphs"]
fn every_graph_is_searched_right_whatever_its_vertices_are_called() {
    let (searches, posts) = (exact(), Posts::default());
    for (number, graph) in (0..=MAX).flat_map(|n| graphs(n, Which::Own, true)).enumerate() {
        (0..TURNS).for_each(|model| hold(searches.iter(), &posts, &graph, [model, number % TURNS]));
    }
    for (number, graph) in graphs(MAX, Which::Shared, false).into_iter().enumerate() {
        hold(searches.iter(), &posts, &graph, [number % TURNS, number / TURNS % TURNS]);
    }
}

/// All orders of some events, up to a number of them.
struct Orders<'a> {
    site: &'a Site,
    listener: &'a Listener,
    alphabet: &'a [Happening],
    longest: usize,
    /// Number of instants.
    count: usize,
    /// Counts of each event of a fix: taken, left, doubted, relocated, disputed, displaced.
    seen: [usize; 6],
}

/// The part of the past that the laws need.
#[derive(Clone, Copy, Default)]
struct Past {
    /// The wrong fixes so far, and whether one came without a known pose.
    lies: usize,
    believed: bool,
    /// Whether a pose was accepted since odometry was lost.
    taken: bool,
    /// Whether one was accepted at this instant.
    now: bool,
    /// Whether a fix was last due, with an object in view and none accepted since.
    sought: bool,
}

impl Orders<'_> {
    fn go(&mut self, navigator: &Navigator<'_>, ledger: &Ledger, past: Past, trail: &mut Vec<Happening>) {
        if trail.len() == self.longest {
            return;
        }
        for &happening in self.alphabet {
            let (mut navigator, mut ledger, mut past) = (navigator.clone(), ledger.clone(), past);
            trail.push(happening);
            self.hold(&mut navigator, &mut ledger, &mut past, happening, trail);
            self.go(&navigator, &ledger, past, trail);
            trail.pop();
        }
    }

    fn hold(
        &mut self,
        navigator: &mut Navigator<'_>,
        ledger: &mut Ledger,
        past: &mut Past,
        happening: Happening,
        trail: &[Happening],
    ) {
        let (before, places) = (navigator.pose().cloned(), navigator.places().to_vec());
        let better = match happening {
            Happening::Settle(well) => is_better(well, navigator.pose_at(0).as_ref()),
            _ => false,
        };
        let did = happens(navigator, self.site, ledger.steps, happening);
        let must = ledger.enter(happening, better);
        assert!(must.is(&did, self.site), "{trail:?}: {did:?}, not {must:?}");
        self.count += 1;
        self.remembers(navigator, past, happening, &did, trail);

        // An event without information moves nothing and gains no information.
        let reported = matches!(did, Did::Fix(Event::Doubted(_) | Event::LessAccurate) | Did::Said(_)) && !better;
        if reported {
            assert!(navigator.pose() == before.as_ref() && navigator.places() == places, "{trail:?}");
        } else {
            self.knows(navigator, ledger, trail);
        }
        assert_eq!(navigator.state(), ledger.state, "{trail:?}");
        if let (Some(before), Some(after)) = (&before, navigator.pose()) {
            self.learns(before, after, happening, &did, trail);
        }
        let moved = (0..OBJECTS).filter(|&object| navigator.places()[object] != places[object]);
        let named = match &did {
            Did::Fix(Event::Displaced(found)) => Some(found.object),
            _ => None,
        };
        assert!(moved.eq(named), "{trail:?}: {did:?}");

        // Right fixes give a right pose and right object poses; so do two wrong fixes of a known pose.
        if !past.believed && past.lies < 3 {
            if let Some(Must::Displaced(object, shifts)) = named.map(|_| must) {
                assert_eq!((object, shifts), (1, seafix_proptests::orders::DISPLACED), "{trail:?}");
            }
            let right = |pose: &Navigated| {
                let place = self
                    .site
                    .place(pose.object, if pose.object == 1 { seafix_proptests::orders::DISPLACED } else { 0 });
                let camera = self.site.place(0, 0) * self.site.camera(0, ledger.steps, 0);
                (place * pose.object_pose.object_from_camera).error_to(&camera).norm() < 1e-9
            };
            assert!(navigator.pose().is_none_or(right), "{trail:?}: {:?}", navigator.pose());
        }

        // The policy receives the true situation.
        if let (Happening::Due(in_view) | Happening::Blind(in_view), Some(reported)) =
            (happening, self.listener.reported())
        {
            let ahead = if matches!(happening, Happening::Blind(_)) { BLIND } else { 0.0 };
            let (seconds, metres) = ledger.since.map_or((f64::INFINITY, f64::INFINITY), |(seconds, steps)| {
                (seconds + ahead, self.site.step.motion.translation().norm() * steps as f64)
            });
            let near = |a: f64, b: f64| a == b || (a - b).abs() < 1e-9;
            assert!(
                near(reported.seconds, seconds) && near(reported.metres, metres) && reported.in_view == in_view,
                "{trail:?}: {reported:?}"
            );
            let sigma = navigator.pose().map_or(f64::INFINITY, |pose| {
                let position = pose.object_pose.covariance.matrix.fixed_view::<3, 3>(3, 3).into_owned();
                position.symmetric_eigenvalues().max().sqrt()
            });
            assert!(near(reported.sigma, sigma), "{trail:?}: {reported:?}, {sigma}");
        }
    }

    /// The navigator's state equals that of the integer model.
    fn knows(&self, navigator: &Navigator<'_>, ledger: &Ledger, trail: &[Happening]) {
        let sound = |pose: &Navigated| pose.object_pose.covariance.matrix.cholesky().is_some();
        assert!(navigator.pose().is_none_or(sound), "{trail:?}: {:?}", navigator.pose());
        assert_eq!(navigator.pose().map(|pose| pose.object), ledger.known.map(|known| known.0), "{trail:?}");
        for object in 0..OBJECTS {
            assert_eq!(navigator.is_disputed(object), ledger.is_disputed(object), "{trail:?}: {object}");
            let place = navigator.places()[object].world_from_object;
            let off = place.error_to(&self.site.place(object, ledger.places[object])).norm();
            assert!(off < 1e-9, "{trail:?}: object {object} is off by {off}");
            let pose = navigator.pose_at(object);
            assert_eq!(pose.is_some(), ledger.known.is_some(), "{trail:?}");
            if let Some((pose, shifts)) = pose.zip(ledger.known_at(object)) {
                let expected = self.site.camera(object, ledger.steps, shifts);
                let off = pose.object_pose.object_from_camera.error_to(&expected).norm();
                assert!(pose.object == object && off < 1e-9, "{trail:?}: the pose at {object} is off by {off}");
            }
        }
    }

    /// The state is the reported one, and every change of it is reported.
    fn remembers(
        &mut self,
        navigator: &Navigator<'_>,
        past: &mut Past,
        happening: Happening,
        did: &Did,
        trail: &[Happening],
    ) {
        let kinds = |event: &Event| match event {
            Event::Taken => 0,
            Event::LessAccurate => 1,
            Event::Doubted(_) => 2,
            Event::Relocated => 3,
            Event::Disputed { .. } => 4,
            Event::Displaced(_) => 5,
        };
        if let (Happening::Fix(Kind::Wrong | Kind::Otherwise), false) = (happening, past.taken) {
            past.believed = true;
        }
        past.lies += usize::from(matches!(happening, Happening::Fix(Kind::Wrong | Kind::Otherwise)));
        match did {
            Did::Fix(event) => {
                self.seen[kinds(event)] += 1;
                if !matches!(event, Event::Doubted(_) | Event::LessAccurate) {
                    *past = Past { taken: true, now: true, sought: false, ..*past };
                }
            }
            Did::Said(yes) => match happening {
                Happening::Due(in_view) => past.sought = *yes && in_view,
                Happening::Blind(in_view) => {
                    past.now = false;
                    past.sought &= *yes && in_view;
                }
                _ if *yes => *past = Past { taken: true, now: true, sought: false, ..*past },
                _ => {}
            },
            Did::Went => {
                past.now = false;
                if happening == Happening::Lost {
                    (past.taken, past.sought) = (false, false);
                }
            }
        }
        let state = match (past.sought, past.now, past.taken) {
            (true, ..) => State::Searching,
            (_, true, _) => State::Fixed,
            (.., true) => State::DeadReckoning,
            _ => State::Prior,
        };
        assert_eq!((navigator.state(), navigator.pose().is_some()), (state, past.taken), "{trail:?}");
        let changes = navigator.changes();
        let first = std::iter::once(State::Prior).chain(changes.iter().map(|change| change.to));
        let chained = first.zip(changes).all(|(from, change)| change.from == from && change.to != from);
        let reported =
            changes.iter().all(|change| !change.why.is_empty()) && changes.is_sorted_by(|a, b| a.seconds <= b.seconds);
        assert!(chained && reported && changes.last().is_none_or(|last| last.to == state), "{trail:?}: {changes:?}");
    }

    /// The covariance does not decrease without a fix, and does not increase with a fix of its object.
    fn learns(&self, before: &Navigated, after: &Navigated, happening: Happening, did: &Did, trail: &[Happening]) {
        let [old, new] = [before, after].map(|pose| pose.object_pose.covariance.matrix.determinant());
        match (happening, did) {
            (Happening::Step, _) => assert!(new > old, "{trail:?}: {old:e} {new:e}"),
            (_, Did::Fix(Event::Taken)) if before.object == after.object => {
                // Covariance intersection determines its weight ω to 0.618⁴⁰ = 4.4e-9. If the pose alone (ω = 1) is
                // best, d log det / dω = 6 − tr(A⁻¹B) is between 0 and 6 there.
                assert!(new <= old * (1.0 + 6.0 * 4.4e-9), "{trail:?}: {old:e} {new:e}");
            }
            _ => {}
        }
    }
}

/// All orders of these events up to a number of them, with a fusion; returns the counts of each event of a fix.
fn hold_orders(alphabet: &[Happening], longest: usize, fusion: &str) -> [usize; 6] {
    let (site, listener) = (Site::new(longest), Listener::default());
    let fusion = FUSIONS.build(&Choice::named(fusion)).unwrap();
    let navigator = Navigator::new(site.surveyed.clone(), &listener, &*fusion);
    let mut orders = Orders { site: &site, listener: &listener, alphabet, longest, count: 0, seen: [0; 6] };
    orders.go(&navigator, &Ledger::default(), Past::default(), &mut Vec::new());
    assert_eq!(orders.count, (1..=longest as u32).map(|length| alphabet.len().pow(length)).sum::<usize>());
    orders.seen
}

use Happening::{Blind, Due, Fix, Lost, Settle, Step};

/// Every order of up to five right and wrong fixes of three objects, with a motion between them, without one, or with
/// odometry lost. Events, pose, object poses, disputes and state agree with the integer model. An event without
/// information moves nothing, the covariance grows without a fix and not with one, and two wrong fixes move no known
/// pose.
#[test]
fn every_order_of_five_fixes_is_judged_right() {
    let kinds = [Kind::Right, Kind::Wrong, Kind::Otherwise, Kind::Moved, Kind::Third, Kind::Imprecise];
    let alphabet: Vec<Happening> = kinds.into_iter().map(Fix).chain([Step, Lost]).collect();
    let seen = hold_orders(&alphabet, 5, "fuse");
    assert!(seen.iter().all(|&count| count > 12), "{seen:?}");
}

/// Every order of up to six questions, instants and poses: the state is the reported one, and each change is reported.
#[test]
fn every_order_of_six_questions_is_answered_right() {
    let alphabet = [Step, Lost, Fix(Kind::Right), Due(true), Due(false), Blind(true), Settle(true)];
    hold_orders(&alphabet, 6, "fuse");
}

/// Sequences of more than six events, with fewer kinds. An unconfirmed object is the displaced one, although it was
/// fixed first. Doubted fixes of a disputed object are forgotten with a consistent fix, and a dispute with the next one
/// of the same two. A recognised key frame also clears doubted fixes.
#[test]
fn every_order_of_a_few_more_events_is_judged_right() {
    let [right, wrong] = [Kind::Right, Kind::Wrong].map(Fix);
    hold_orders(&[Lost, right, Fix(Kind::Moved), Fix(Kind::Third)], 7, "fuse");
    hold_orders(&[right, wrong, Fix(Kind::Moved)], 8, "fuse");
    hold_orders(&[right, wrong, Step, Settle(true)], 6, "fuse");
}

/// The long form of the laws above: every order of up to six of all events except `Settle(false)`. After a pose with a
/// large covariance, answers depend on covariances, which the integer model does not have.
#[test]
#[ignore = "long: 10 million instants"]
fn every_order_of_six_events_is_judged_right() {
    let kinds = [Kind::Right, Kind::Wrong, Kind::Otherwise, Kind::Moved, Kind::Third, Kind::Imprecise];
    let others = [Step, Lost, Due(true), Due(false), Blind(true), Blind(false), Settle(true)];
    let alphabet: Vec<Happening> = kinds.into_iter().map(Fix).chain(others).collect();
    for fusion in ["fuse", "intersect"] {
        let seen = hold_orders(&alphabet, 6, fusion);
        assert!(seen.iter().all(|&count| count > 100), "{fusion}: {seen:?}");
    }
}

/// Every order of up to nine fixes of three objects: a displaced object is detected, and confirms a third, which is
/// then displaced.
#[test]
#[ignore = "long: 350 000 instants"]
fn every_order_of_nine_fixes_is_judged_right() {
    hold_orders(&[Kind::Right, Kind::Wrong, Kind::Moved, Kind::Third].map(Fix), 9, "fuse");
}
