"""Solvers, searches and detectors written in Python."""

from pathlib import Path

import numpy as np
import pytest
import seafix as sf


@sf.solver("own-svd", source="Arun, Huang and Blostein, 1987", least_squares=True)
def own_svd(src, dst, covariances, *, min_ratio=1e-3):
    """Least squares by singular values."""
    a, b = dst - dst.mean(axis=0), src - src.mean(axis=0)
    if np.linalg.svd(b, compute_uv=False)[1] < min_ratio * np.linalg.svd(b, compute_uv=False)[0]:
        raise sf.DegenerateError("collinear points")
    u, _, vt = np.linalg.svd(a.T @ b)
    T = np.eye(4)
    T[:3, :3] = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    T[:3, 3] = dst.mean(axis=0) - T[:3, :3] @ src.mean(axis=0)
    return T


@sf.search("own-greedy")
def own_greedy(problem, *, least=3):
    """The most connected pairs first."""
    coherent, chosen = problem.compatibility(), []
    for k in np.argsort(-coherent.sum(axis=1), kind="stable"):
        if all(coherent[k, other] for other in chosen):
            chosen.append(k)
    return problem.pairs[chosen] if len(chosen) >= least else None


def test_an_own_solver_is_one_of_the_solvers(scene):
    assert "own-svd" in sf.solvers()
    about = sf.describe("own-svd")
    assert about["summary"] == "Least squares by singular values." and "min-ratio" in about["settings"]
    dst = scene.model[scene.pairs[:, 0]]
    mine, own_covariance = sf.register(scene.seen, dst, solver="own-svd")
    kabsch, covariance = sf.register(scene.seen, dst, solver="kabsch")
    np.testing.assert_allclose(mine, kabsch, atol=1e-12)
    # The numerical covariance includes the second derivatives that the residuals of a few millimetres weigh.
    assert np.trace(own_covariance) == pytest.approx(np.trace(covariance), rel=0.02)
    answer = sf.solve(sf.Problem(scene.model, scene.cloud, sigma=scene.sigma), solver="own-svd")
    assert answer.is_fix and answer.solver == "own-svd"
    line = np.outer(np.arange(5.0), [1.0, 2.0, 3.0])
    with pytest.raises(sf.DegenerateError, match="collinear points"):
        sf.register(line, line, solver="own-svd", sigma=0.01)


def test_an_own_search_is_one_of_the_searches(scene):
    problem = sf.Problem(scene.model, scene.cloud, sigma=scene.sigma)
    answer = sf.solve(problem, search="own-greedy")
    assert answer.is_fix and answer.search == "own-greedy"
    np.testing.assert_array_equal(answer.pairs, scene.pairs)
    none = sf.solve(problem, search={"name": "own-greedy", "least": 9})
    assert none.reason == "not-found"
    with pytest.raises(ValueError, match="no setting `last`, did you mean `least`"):
        sf.solve(problem, search={"name": "own-greedy", "last": 9})


def test_the_compatibility_is_that_of_the_distances(scene):
    seen = []

    @sf.search("own-witness")
    def witness(problem):
        seen.append(problem)

    delta = 0.02
    sf.solve(sf.Problem(scene.model, scene.cloud, sigma=scene.sigma, delta=delta), search="own-witness")
    problem = seen[0]
    np.testing.assert_array_equal(problem.cloud, scene.cloud)
    assert len(problem.candidates) == 8 and problem.prior is None
    i, j = problem.pairs.T
    model = np.linalg.norm(scene.model[i][:, None] - scene.model[i][None], axis=2)
    cloud = np.linalg.norm(scene.cloud[j][:, None] - scene.cloud[j][None], axis=2)
    different = (i[:, None] != i[None]) & (j[:, None] != j[None])
    np.testing.assert_array_equal(problem.compatibility(), different & (abs(model - cloud) <= delta))


def test_an_exception_of_a_component_is_raised(scene):
    @sf.solver("own-broken")
    def broken(src, dst, covariances):
        raise ZeroDivisionError("in my solver")

    @sf.search("own-broken")
    def twice(problem):
        return problem.pairs[:3]

    problem = sf.Problem(scene.model, scene.cloud, sigma=scene.sigma)
    with pytest.raises(ZeroDivisionError, match="in my solver"):
        sf.solve(problem, solver="own-broken")
    with pytest.raises(ZeroDivisionError):
        sf.register(scene.seen, scene.model, solver="own-broken")
    with pytest.raises(ValueError, match="two partners"):
        sf.solve(problem, search="own-broken")
    # The next call does not see the exception of an earlier one.
    assert sf.solve(problem).is_fix


def test_a_component_is_declared_anew(scene):
    for value in [1.0, 2.0]:

        @sf.solver("own-shift")
        def shift(src, dst, covariances, value=value):
            T = np.eye(4)
            T[:3, 3] = value
            return T

        T, _ = sf.register(scene.seen, scene.model, solver="own-shift")
        assert T[0, 3] == value


def test_a_name_is_new_and_in_kebab_case():
    for name, text in [("kabsch", "choose another"), ("Own", "kebab-case")]:
        with pytest.raises(ValueError, match=text):
            sf.solver(name)(lambda src, dst, covariances: np.eye(4))
    with pytest.raises(ValueError, match="no default"):

        @sf.solver("own-needy")
        def needy(src, dst, covariances, *, setting):
            return np.eye(4)


def test_the_laws_hold_for_a_right_solver_and_find_a_wrong_one(capsys):
    assert sf.check_laws("own-svd")
    assert "BROKEN" not in capsys.readouterr().out

    @sf.solver("own-reflecting", least_squares=True)
    def reflecting(src, dst, covariances):
        a, b = dst - dst.mean(axis=0), src - src.mean(axis=0)
        u, _, vt = np.linalg.svd(a.T @ b)
        # Without the sign of the determinant a reflection may fit best; the nearest rotation of it is a wrong one.
        R = u @ vt
        if np.linalg.det(R) < 0:
            R = -R
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R, dst.mean(axis=0) - R @ src.mean(axis=0)
        return T

    assert not sf.check_laws("own-reflecting")
    printed = capsys.readouterr().out
    assert "BROKEN" in printed and "own-reflecting" in printed and "Scene" in printed
    with pytest.raises(ValueError, match="no solver is called"):
        sf.check_laws("own-nothing")
    with pytest.raises(ValueError, match="needs pixels"):
        sf.check_laws("stereo-reprojection")


def test_the_laws_of_searches_hold_for_a_library_search_and_find_a_wrong_one(capsys):
    assert sf.check_laws("spectral")
    assert capsys.readouterr().out.count("holds") == 5

    @sf.search("own-first")
    def first(problem):
        """The first coherent pairs: it accepts mirror images, and depends on the order of the points."""
        coherent, chosen = problem.compatibility(), []
        for k in range(len(problem.pairs)):
            if all(coherent[k, other] for other in chosen):
                chosen.append(k)
        return problem.pairs[chosen] if len(chosen) >= 3 else None

    assert not sf.check_laws("own-first")
    printed = capsys.readouterr().out
    assert "holds   no point serves twice" in printed and "BROKEN  a mirror image is rejected" in printed
    assert sf.check_laws("irls") and not sf.check_laws("own-first", kind="search")
    with pytest.raises(ValueError, match="no search is called `kabsch`"):
        sf.check_laws("kabsch", kind="search")
    with pytest.raises(ValueError, match="'solver' or 'search'"):
        sf.check_laws("kabsch", kind="detector")


@sf.detector("own-brightest", scale=2.0)
def own_brightest(image, *, features=50):
    """The pixels of the largest grey levels."""
    v, u = np.unravel_index(np.argsort(-image, axis=None, kind="stable")[:features], image.shape)
    return np.column_stack([u, v, image[v, u]])


def test_an_own_detector_is_one_of_the_detectors():
    assert {"own-brightest", "harris"} <= set(sf.detectors())
    assert "features" in sf.describe("own-brightest")["settings"]
    image = np.zeros((30, 40), np.uint8)
    image[7, 11], image[20, 5] = 200, 250
    points = sf.detect(image, {"name": "own-brightest", "features": 2})
    np.testing.assert_array_equal(points, [[5, 20, 250], [11, 7, 200]])
    assert sf.detect(image).shape[1] == 3
    with pytest.raises(ValueError, match="did you mean `own-brightest`"):
        sf.detect(image, "own-brightes")
    with pytest.raises(ValueError, match="above 0"):
        sf.detector("own-flat", scale=0.0)(own_brightest)


def test_bad_key_points_are_refused():
    image = np.zeros((30, 40), np.uint8)
    cases = [
        (lambda image: [[40.0, 3.0, 1.0]], "not in the image"),
        (lambda image: [[4.0, np.nan, 1.0]], "not in the image"),
        (lambda image: np.zeros((3, 2)), r"\(n, 3\)"),
        (lambda image: {}["a"], "a"),
    ]
    for function, text in cases:
        sf.detector("own-bad")(function)
        with pytest.raises((ValueError, KeyError), match=text):
            sf.detect(image, "own-bad")
    sf.detector("own-bad")(lambda image: [])
    assert sf.detect(image, "own-bad").shape == (0, 3)


def test_an_own_detector_finds_what_the_library_finds(tmp_path):
    """A detector that passes on the points of `harris` gives the fixes of `harris`."""
    pytest.importorskip("pyarrow")

    @sf.detector("own-harris")
    def harris(image):
        return sf.detect(image, "harris")

    folder = Path(__file__).parents[2] / "datasets" / "virtual-sample"
    rig, site = sf.Rig.load(folder), sf.Site.load(folder / "site.toml")
    images = folder / "left000.png", folder / "right000.png"
    mine, known = (sf.Localizer(site, rig, f'detector = "{name}"') for name in ("own-harris", "harris"))
    answers = list(zip(mine.localize(*images), known.localize(*images)))
    assert any(one.is_fix for one, _ in answers)
    for one, other in answers:
        assert one.outcome == other.outcome
        if one.is_fix:
            np.testing.assert_array_equal(one.object_from_camera, other.object_from_camera)
    runs = [
        sf.run(folder, tmp_path / f"{name}-{threads}", threads=threads, timed=False, settings={"pipeline.detector": name})
        for name, threads in [("own-harris", 1), ("own-harris", 2), ("harris", 2)]
    ]
    tables = [(run.folder / "results.parquet").read_bytes() for run in runs]
    assert tables[0] == tables[1] == tables[2]

    @sf.detector("own-harris")
    def broken(image):
        raise RuntimeError("in my detector")

    with pytest.raises(RuntimeError, match="in my detector"):
        sf.Localizer(site, rig, 'detector = "own-harris"').localize(*images)
    with pytest.raises(RuntimeError, match="in my detector"):
        sf.run(folder, tmp_path / "broken", settings={"pipeline.detector": "own-harris"})


def test_a_solver_that_returns_nothing_is_named(scene):
    @sf.solver("own-nothing")
    def nothing(src, dst, covariances):
        pass

    with pytest.raises(ValueError, match="the solver `own-nothing` returned None"):
        sf.register(scene.seen, scene.seen, solver="own-nothing")
