//! All searches, their claims and their inputs.

use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use seafix_geometry::Transform;
use seafix_referencing::{Correspondence, Identification, Prior, PriorBound, Problem, Rejected, SEARCHES, Search};

use crate::{
    problems::Planted,
    variants::{Variant, variants},
};

/// The answer of a search.
pub type Answer = Result<Identification, Rejected>;

/// The claims of a search beyond those of all: coherent, one-to-one sets without mirror images, valid bounds, and no
/// dependence on the order of the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Claims {
    /// The maximum admissible set, within its budget.
    pub exact: bool,
    /// All other sets of the same size, or a notice that they are not listed.
    pub ties: bool,
    /// A start at a prior, and rejection without one.
    pub prior: bool,
}

/// The claims by name; an unlisted search claims everything.
///
/// A search of the library that proves nothing has a line here. [`named`] asks no claims of a search.
const CLAIMS: [(&str, Claims); 16] = {
    const EXACT: Claims = Claims { exact: true, ties: true, prior: false };
    const RANKS: Claims = Claims { exact: false, ties: false, ..EXACT };
    const FROM_PRIOR: Claims = Claims { prior: true, ..RANKS };
    [
        ("complete-enumeration", Claims { ties: false, ..EXACT }),
        ("gicp", FROM_PRIOR),
        ("gnc-tls", RANKS),
        ("icp", FROM_PRIOR),
        ("interpretation-tree", RANKS),
        ("joint-compatibility", RANKS),
        ("k-core-gnc", RANKS),
        ("mac", RANKS),
        ("magsac", RANKS),
        ("pose-vote", FROM_PRIOR),
        ("ransac", RANKS),
        ("rigid-consensus", RANKS),
        ("sc2-pcr", RANKS),
        ("spectral", RANKS),
        ("structural-coherence", Claims { ties: false, ..EXACT }),
        ("weighted-clique", RANKS),
    ]
};

/// A search with chosen settings, and its claims.
#[derive(Debug)]
pub struct Tried {
    variant: Variant<dyn Search>,
    /// The name for failures.
    pub name: String,
    /// The claims.
    pub claims: Claims,
}

/// Every search with every combination of its switches, and with the given budget if it has one.
pub fn searches(budget: i64) -> Vec<Tried> {
    let max = Claims { exact: true, ties: true, prior: false };
    let claims = |name: &str| CLAIMS.iter().find(|(listed, _)| *listed == name).map_or(max, |(_, claims)| *claims);
    let tried = |variant: Variant<dyn Search>| {
        let component = variant.name.split(' ').next().unwrap_or_default();
        Tried { claims: claims(component), name: variant.name.clone(), variant }
    };
    variants(&SEARCHES, &[("budget", budget)]).into_iter().map(tried).collect()
}

/// All variants of the registered search `name`, one of the program or an added one, without any claim of a proof; empty
/// if there is none.
pub fn named(name: &str, budget: i64) -> Vec<Tried> {
    let of_name = |search: &Tried| search.name.split(' ').next() == Some(name);
    let prior = CLAIMS.iter().any(|(listed, claims)| *listed == name && claims.prior);
    let unproved = |search| Tried { claims: Claims { exact: false, ties: false, prior }, ..search };
    searches(budget).into_iter().filter(of_name).map(unproved).collect()
}

impl Tried {
    /// Whether it rejects mirror images; a search without the switch must do so.
    pub fn rejects_mirrors(&self) -> bool {
        self.variant.switch("orientation").unwrap_or(true)
    }

    /// Whether it has a budget.
    pub fn has_budget(&self) -> bool {
        self.variant.has("budget")
    }

    /// The value of a switch; `None` if it has none.
    pub fn switch(&self, key: &str) -> Option<bool> {
        self.variant.switch(key)
    }

    /// The answer; a search that starts at a prior gets the true pose, within 10 m.
    pub fn answer(&self, planted: &Planted) -> Answer {
        let prior = Prior { object_from_camera: planted.pose, bound: PriorBound::Box(10.0) };
        let prior = self.claims.prior.then_some(&prior);
        self.answer_to(&Problem { prior, ..planted.problem() })
    }

    /// The answer to an unchanged problem.
    pub fn answer_to(&self, problem: &Problem<'_>) -> Answer {
        self.variant.component.search(problem, &mut ChaCha8Rng::seed_from_u64(7))
    }
}

/// All sets of an answer.
pub fn sets(answer: &Answer) -> impl Iterator<Item = &Vec<Correspondence>> {
    answer.iter().flat_map(|found| std::iter::once(&found.pairs).chain(&found.alternatives))
}

/// The pose of a problem without one.
pub fn nowhere() -> Transform<seafix_geometry::Object, seafix_geometry::Camera> {
    Transform::identity()
}

/// Whether a set is claimed to be maximum; a search by likelihood claims it to be most probable.
pub fn is_proved_largest(found: &Identification) -> bool {
    found.optimal && found.posterior.is_none()
}
