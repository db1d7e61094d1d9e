"""Registration of corresponding points."""

import numpy as np
import pytest
import seafix as sf

from conftest import motion, moved

TRUTH = motion([1.0, 2.0, -0.5], 0.9, [0.4, -1.0, 2.0])
RNG = np.random.default_rng(3)
SRC = RNG.normal(size=(13, 3)) + [0.0, 0.0, 4.0]


def test_every_solver_finds_an_exact_motion():
    found = set()
    # Other tests add solvers of their own.
    for solver in [name for name in sf.solvers() if name != "mean-translation" and not name.startswith("own-")]:
        try:
            T, covariance = sf.register(SRC, moved(TRUTH, SRC), solver=solver, sigma=1e-3)
        except ValueError as error:
            assert "pixels" in str(error) and error.remedy == "use `mahalanobis`"
            continue
        # A general-purpose optimiser ends a small fraction of a standard deviation from the minimum.
        np.testing.assert_allclose(T, TRUTH, atol=1e-5, err_msg=solver)
        assert covariance.shape == (6, 6) and np.all(np.linalg.eigvalsh(covariance) > 0), solver
        found.add(solver)
    assert {"kabsch", "weighted-kabsch", "horn", "umeyama", "mahalanobis", "gnc-tls", "irls", "triad"} <= found


def test_kabsch_is_that_of_scipy():
    spatial = pytest.importorskip("scipy.spatial.transform")
    dst = moved(TRUTH, SRC) + RNG.normal(scale=0.02, size=SRC.shape)
    weights = RNG.uniform(0.5, 2.0, size=13)
    for given, mean in [(None, np.full(13, 1 / 13)), (weights, weights / weights.sum())]:
        T, _ = sf.register(SRC, dst, given)
        a, b = dst - mean @ dst, SRC - mean @ SRC
        expected, _ = spatial.Rotation.align_vectors(a, b, weights=given)
        np.testing.assert_allclose(T[:3, :3], expected.as_matrix(), atol=1e-12)
        np.testing.assert_allclose(T[:3, 3], mean @ dst - T[:3, :3] @ (mean @ SRC), atol=1e-12)


def test_the_covariance_is_that_of_the_scatter():
    """Over 400 draws the normalised squared error has mean 6; its mean has a standard deviation of √(12/400) = 0.17."""
    sigma, squares, estimated = 0.01, [], []
    for draw in range(400):
        rng = np.random.default_rng(draw)
        noisy = SRC + rng.normal(scale=sigma, size=SRC.shape)
        T, covariance = sf.register(noisy, moved(TRUTH, SRC), sigma=sigma)
        error = np.linalg.inv(T) @ TRUTH
        # The logarithm of a small motion: the antisymmetric part of the rotation, and the translation.
        R = error[:3, :3]
        phi = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
        xi = np.concatenate([phi, error[:3, 3]])
        squares.append(xi @ np.linalg.solve(covariance, xi))
        estimated.append(np.trace(sf.register(noisy, moved(TRUTH, SRC))[1]) / np.trace(covariance))
    assert abs(np.mean(squares) - 6) < 4 * 0.17
    # The estimated variance has 33 degrees of freedom, so its mean over the draws has 1.2 % of error.
    assert abs(np.mean(estimated) - 1) < 4 * 0.0123


def test_weights_are_inverse_variances():
    weights = np.full(13, 4.0)
    T, covariance = sf.register(SRC, moved(TRUTH, SRC), weights, sigma=0.02)
    _, half = sf.register(SRC, moved(TRUTH, SRC), sigma=0.01)
    np.testing.assert_allclose(covariance, half, rtol=1e-9)
    with pytest.raises(ValueError, match="weighted-kabsch"):
        sf.register(SRC, SRC, np.arange(1.0, 14.0), solver="kabsch")


def test_degenerate_points_raise_with_a_remedy():
    line = np.outer(np.arange(5.0), [1.0, 2.0, 3.0])
    for src in [SRC[:2], line]:
        with pytest.raises(sf.DegenerateError) as raised:
            sf.register(src, src)
        assert isinstance(raised.value, ValueError) and raised.value.remedy


@pytest.mark.parametrize(
    ("field", "arguments"),
    [
        ("src", {"src": SRC[0]}),
        ("dst", {"dst": SRC[:5]}),
        ("weights", {"weights": np.ones(3)}),
        ("weights", {"weights": np.zeros(13)}),
        ("weights", {"weights": np.full(13, np.nan)}),
        ("sigma", {"sigma": -1.0}),
        ("solver", {"solver": "kabsh"}),
    ],
)
def test_bad_input_names_its_field(field, arguments):
    with pytest.raises(ValueError) as raised:
        sf.register(**{"src": SRC, "dst": SRC, **arguments})
    assert raised.value.field == field and raised.value.remedy


def test_points_that_are_not_finite_are_refused():
    src = SRC.copy()
    src[4, 1] = np.nan
    with pytest.raises(ValueError, match="finite"):
        sf.register(src, SRC)


def test_numbers_of_another_meaning_are_refused():
    points = np.arange(12.0).reshape(4, 3)
    masked = np.ma.array(points, mask=np.eye(4, 3, dtype=bool))
    times = np.zeros((4, 3), "datetime64[ns]")
    for given, what in [(points + 1j, "complex"), (times, "times"), (points.astype(str), "texts"), (masked, "masked")]:
        with pytest.raises(ValueError, match=what) as raised:
            sf.register(given, points)
        assert raised.value.field == "src" and raised.value.remedy
    plain = np.random.default_rng(1).normal(size=(5, 3))
    expected, _ = sf.register(plain, plain)
    for same in (plain.tolist(), np.ma.array(plain), plain.astype(object)):
        np.testing.assert_array_equal(sf.register(same, plain)[0], expected)
