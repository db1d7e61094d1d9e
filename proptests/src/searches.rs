//! All searches, what each claims, and what it is given.

use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};
use seafix_geometry::Transform;
use seafix_referencing::{Correspondence, Identification, Prior, PriorBound, Problem, Rejected, SEARCHES, Search};

use crate::{
    problems::Planted,
    variants::{Variant, variants},
};

/// What a search says.
pub type Answer = Result<Identification, Rejected>;

/// What a search claims beyond what all do: coherent, one-to-one sets without mirror images, honest bounds, and no
/// dependence on the order of the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Claims {
    /// Within its budget, that no admissible set is larger.
    pub exact: bool,
    /// That it names every other set of the same size, or says that it does not.
    pub ties: bool,
    /// That it begins at a prior, and refuses without one.
    pub prior: bool,
}

/// The claims by name. One that is not listed claims the most.
const CLAIMS: [(&str, Claims); 12] = {
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
        ("pose-vote", FROM_PRIOR),
        ("ransac", RANKS),
        ("rigid-consensus", RANKS),
        ("spectral", RANKS),
        ("structural-coherence", Claims { ties: false, ..EXACT }),
        ("weighted-clique", RANKS),
    ]
};

/// A search with settings chosen, and its claims.
#[derive(Debug)]
pub struct Tried {
    variant: Variant<dyn Search>,
    /// What a failure calls it.
    pub name: String,
    /// What it claims.
    pub claims: Claims,
}

/// Every search with every combination of its switches; its budget, if it has one, as given.
pub fn searches(budget: i64) -> Vec<Tried> {
    let max = Claims { exact: true, ties: true, prior: false };
    let claims = |name: &str| CLAIMS.iter().find(|(listed, _)| *listed == name).map_or(max, |(_, claims)| *claims);
    let tried = |variant: Variant<dyn Search>| {
        let component = variant.name.split(' ').next().unwrap_or_default();
        Tried { claims: claims(component), name: variant.name.clone(), variant }
    };
    variants(&SEARCHES, &[("budget", budget)]).into_iter().map(tried).collect()
}

impl Tried {
    /// Whether it refuses mirror images. One without the switch is held to it.
    pub fn refuses_mirrors(&self) -> bool {
        self.variant.switch("orientation").unwrap_or(true)
    }

    /// Whether it has a budget.
    pub fn has_budget(&self) -> bool {
        self.variant.has("budget")
    }

    /// The value of a switch; `None` where it has none.
    pub fn switch(&self, key: &str) -> Option<bool> {
        self.variant.switch(key)
    }

    /// Its answer; a search that begins at a prior is given the pose that was planted, within 10 m.
    pub fn answer(&self, planted: &Planted) -> Answer {
        let prior = Prior { object_from_camera: planted.pose, bound: PriorBound::Box(10.0) };
        let prior = self.claims.prior.then_some(&prior);
        self.answer_to(&Problem { prior, ..planted.problem() })
    }

    /// Its answer to a problem as it is.
    pub fn answer_to(&self, problem: &Problem<'_>) -> Answer {
        self.variant.component.search(problem, &mut ChaCha8Rng::seed_from_u64(7))
    }
}

/// All sets that an answer names.
pub fn sets(answer: &Answer) -> impl Iterator<Item = &Vec<Correspondence>> {
    answer.iter().flat_map(|found| std::iter::once(&found.pairs).chain(&found.alternatives))
}

/// The pose of a problem that has none.
pub fn nowhere() -> Transform<seafix_geometry::Object, seafix_geometry::Camera> {
    Transform::identity()
}

/// Whether a set is called the largest; a search by likelihood calls it the likeliest.
pub fn is_proved_largest(found: &Identification) -> bool {
    found.optimal && found.posterior.is_none()
}
