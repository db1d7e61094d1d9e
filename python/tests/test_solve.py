"""Problems and their answers."""

import json
import pickle
import threading

import numpy as np
import pytest
import seafix as sf

from conftest import motion, moved


def test_a_fix_has_the_true_pose_and_its_covariance(scene):
    answer = sf.solve(sf.Problem(scene.model, scene.cloud, sigma=scene.sigma))
    assert answer.outcome == "fix" and answer.is_fix and answer.reason is None
    np.testing.assert_array_equal(answer.pairs, scene.pairs)
    error = answer.object_from_camera[:3, 3] - scene.object_from_camera[:3, 3]
    # Three axes beyond five standard deviations of the position are one case in a million.
    assert np.linalg.norm(error) < 5 * answer.position_sigma < 0.1
    assert np.all(np.linalg.eigvalsh(answer.covariance) > 0)
    # Along and about one axis: the standard deviations that an isotropic prior of this covariance was given.
    sigmas = np.sqrt([np.trace(answer.covariance[3:, 3:]) / 3, np.trace(answer.covariance[:3, :3]) / 3])
    np.testing.assert_allclose([answer.position_sigma, answer.attitude_sigma], sigmas)
    integrity = answer.integrity
    assert integrity.redundancy == "excludable" and integrity.dof == 3 * len(answer.pairs) - 6
    assert 0 < integrity.chi2 < integrity.chi2_limit
    assert np.linalg.norm(error) < integrity.position_level and integrity.attitude_level > 0
    assert abs(integrity.scale_error) < 5 * integrity.scale_error_sigma
    assert abs(integrity.depth_error) < 5 * integrity.depth_error_sigma
    assert answer.p_wrong < 1e-3 and answer.best is None
    np.testing.assert_allclose(answer.camera_from_object @ answer.object_from_camera, np.eye(4), atol=1e-12)
    T, dst = answer.object_from_camera, scene.model[answer.pairs[:, 0]]
    src = scene.cloud[answer.pairs[:, 1]]
    np.testing.assert_allclose(answer.residuals, src @ T[:3, :3].T + T[:3, 3] - dst, atol=1e-12)


def test_an_absent_object_is_rejected_with_a_reason_and_a_remedy(scene):
    answer = sf.solve(sf.Problem(scene.model, scene.cloud[:12], sigma=scene.sigma))
    assert answer.outcome != "fix" and answer.object_from_camera is None and answer.pairs is None
    assert answer.reason and answer.explanation and answer.remedy
    assert answer.p_wrong > 1e-3


def test_three_statements_of_the_noise_are_one(scene):
    one = sf.solve(sf.Problem(scene.model, scene.cloud, sigma=scene.sigma))
    each = np.tile(np.eye(3) * scene.sigma**2, (20, 1, 1))
    for problem in [
        sf.Problem(scene.model, scene.cloud, np.eye(3) * scene.sigma**2),
        sf.Problem(scene.model, scene.cloud, each),
        sf.Problem(scene.model, scene.cloud, sigma=np.full(20, scene.sigma)),
        sf.Problem(scene.model, scene.cloud, sigma=np.full((20, 3), scene.sigma)),
    ]:
        np.testing.assert_array_equal(sf.solve(problem).object_from_camera, one.object_from_camera)
    derived = sf.Problem(scene.model, scene.cloud, delta=3 * 2**0.5 * scene.sigma)
    np.testing.assert_allclose(derived.covariances, each)


def test_priors_narrow_the_candidates(scene):
    T = scene.object_from_camera
    for prior in [
        sf.PosePrior(T, position_sigma=0.02, attitude_sigma=0.01),
        sf.PosePrior(T, covariance=np.diag([1e-4] * 3 + [4e-4] * 3)),
        sf.BoxPrior(T, half=0.1),
    ]:
        answer = sf.solve(sf.Problem(scene.model, scene.cloud, prior=prior, sigma=scene.sigma))
        np.testing.assert_array_equal(answer.pairs, scene.pairs)
    far = sf.BoxPrior(motion([0, 0, 1], 0.1, [5.0, 5.0, -3.0]), half=0.1)
    answer = sf.solve(sf.Problem(scene.model, scene.cloud, prior=far, sigma=scene.sigma))
    assert answer.reason == "too-few"


def test_putative_pairs_are_the_only_candidates(scene):
    problem = sf.Problem(scene.model, scene.cloud, sigma=scene.sigma, putative=scene.pairs[:6])
    np.testing.assert_array_equal(sf.solve(problem).pairs, scene.pairs[:6])


def test_arrays_of_every_layout_give_the_same_answer(scene):
    expected = sf.solve(sf.Problem(scene.model, scene.cloud, sigma=scene.sigma)).object_from_camera
    double = np.repeat(scene.cloud, 2, axis=0)[::2]
    for cloud in [np.asfortranarray(scene.cloud), double, scene.cloud.tolist(), scene.cloud[:, ::-1][:, ::-1]]:
        answer = sf.solve(sf.Problem(scene.model, cloud, sigma=scene.sigma))
        np.testing.assert_array_equal(answer.object_from_camera, expected)


def test_a_problem_from_a_file_answers_as_the_program_prints(scene, tmp_path):
    written = {
        "format": "coherence-problem/1",
        "id": "eight",
        "model": scene.model.tolist(),
        "cloud": scene.cloud.tolist(),
        "sigma": scene.sigma,
        "delta": 3 * 2**0.5 * scene.sigma,
    }
    path = tmp_path / "eight.json"
    path.write_text(json.dumps(written))
    answer = sf.solve(sf.Problem.load(path))
    printed = answer.to_dict()
    assert printed["id"] == answer.target == "eight" and printed["file"] == str(path)
    assert printed["outcome"] == "fix" and printed["pairs"] == answer.pairs.tolist()
    assert printed["T_cam_obj"] == answer.camera_from_object.tolist()
    assert printed["covariance"] == answer.covariance.tolist()
    same = sf.Problem(scene.model, scene.cloud, sigma=scene.sigma, delta=written["delta"])
    np.testing.assert_array_equal(sf.solve(same).object_from_camera, answer.object_from_camera)


class Edged:
    """The object's first three points and four of its edges, measured as lines with clutter before them."""

    def __init__(self, scene):
        self.ends = [[0, 1], [1, scene.model[2].tolist()], [2, 0], [scene.model[0].tolist(), scene.model[3].tolist()]]
        self.places = np.array([[scene.model[[0, 1, 2, 0][k]], scene.model[[1, 2, 0, 3][k]]] for k in range(4)])
        self.arguments = {
            "model": scene.model[:3],
            "cloud": scene.cloud[12:15],
            "sigma": scene.sigma,
            "prior": sf.BoxPrior(scene.object_from_camera, half=0.1),
        }
        seen = [moved(np.linalg.inv(scene.object_from_camera), ends) for ends in self.places]
        # Micrometres, which a file holds to the last bit.
        self.lines = np.round([[[2.0, 2.0, 4.0], [2.0, 1.0, 4.5]], *seen], 6)
        self.covariance = np.eye(4) * 1e-6
        self.pairs = np.column_stack([np.arange(4), np.arange(1, 5)])


@pytest.fixture(scope="module")
def edged(scene):
    return Edged(scene)


def test_edges_sharpen_a_fix(scene, edged):
    alone = sf.solve(sf.Problem(**edged.arguments))
    assert alone.is_fix and alone.edges.shape == (0, 2)
    problem = sf.Problem(**edged.arguments, edges=edged.ends, lines=edged.lines, line_covariances=edged.covariance)
    np.testing.assert_array_equal(problem.edges, edged.places)
    np.testing.assert_array_equal(problem.lines, edged.lines)
    assert "4 edges, 5 lines" in repr(problem)
    answer = sf.solve(problem)
    assert answer.is_fix, answer.explanation
    np.testing.assert_array_equal(answer.edges, edged.pairs)
    error = answer.object_from_camera[:3, 3] - scene.object_from_camera[:3, 3]
    assert np.linalg.norm(error) < 5 * answer.position_sigma
    assert 5 * answer.position_sigma < alone.position_sigma


def test_putative_edges_are_the_only_candidates(edged):
    noise = {"line_covariances": edged.covariance, "putative_edges": edged.pairs[:3]}
    answer = sf.solve(sf.Problem(**edged.arguments, edges=edged.places, lines=edged.lines, **noise))
    np.testing.assert_array_equal(answer.edges, edged.pairs[:3])


def test_edges_from_a_file_give_the_same_answer(scene, edged, tmp_path):
    delta = 3 * 2**0.5 * scene.sigma
    written = {
        "format": "coherence-problem/1.1",
        "id": "edges",
        "model": edged.arguments["model"].tolist(),
        "cloud": edged.arguments["cloud"].tolist(),
        "sigma": scene.sigma,
        "delta": delta,
        "edges": edged.ends,
        "lines": [{"ends": ends, "covariance": edged.covariance.tolist()} for ends in edged.lines.tolist()],
    }
    path = tmp_path / "edges.json"
    path.write_text(json.dumps(written))
    each = np.tile(edged.covariance, (5, 1, 1))
    given = {key: edged.arguments[key] for key in ["model", "cloud", "sigma"]}
    same = sf.Problem(**given, delta=delta, edges=edged.ends, lines=edged.lines, line_covariances=each)
    for search in ["rigid-consensus", "complete-enumeration"]:
        loaded, made = (sf.solve(problem, search=search).to_dict() for problem in [sf.Problem.load(path), same])
        assert {key: loaded[key] for key in loaded if key not in ["id", "file", "time_ms"]} == {
            key: made[key] for key in made if key not in ["id", "file", "time_ms"]
        }


@pytest.mark.parametrize(
    ("field", "arguments"),
    [
        ("edges", {"edges": [[0, 3]]}),
        ("edges", {"edges": [[0]]}),
        ("edges", {"edges": [[0, [1.0, 2.0]]]}),
        ("edges", {"edges": 3}),
        ("edges", {"edges": [[[0.0, 0.0, 0.0], [0.001, 0.0, 0.0]]]}),
        ("edges", {"edges": [[-1, 0]]}),
        ("lines", {"lines": np.zeros((1, 2, 2))}),
        ("lines", {"lines": np.zeros((1, 2, 3))}),
        ("line_covariances", {"line_covariances": None}),
        ("line_covariances", {"line_covariances": np.zeros((2, 4, 4))}),
        ("lines", {"line_covariances": -np.eye(4)}),
        ("putative_edges", {"putative_edges": [[4, 0]]}),
        ("putative_edges", {"putative_edges": [[0.5, 0]]}),
    ],
)
def test_bad_edges_name_their_field_and_the_remedy(edged, field, arguments):
    given = {"edges": edged.ends, "lines": edged.lines, "line_covariances": edged.covariance}
    with pytest.raises(ValueError, match=";") as raised:
        sf.Problem(**edged.arguments, **{**given, **arguments})
    assert raised.value.field == field and raised.value.remedy
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("field", "arguments"),
    [
        ("model", {"model": np.zeros((4, 2))}),
        ("model", {"model": [[0, 0, 0], [1, 0, np.nan], [0, 1, 0]]}),
        ("model", {"model": [[0, 0, 0], [0, 0, 0], [0, 1, 0]]}),
        ("cloud", {"cloud": "a cloud"}),
        ("cloud", {"cloud": [[0.0, 0.0, np.inf]]}),
        ("sigma", {"sigma": -1.0}),
        ("sigma", {"sigma": 0.01, "covariances": np.eye(3)}),
        ("covariances", {"sigma": None}),
        ("covariances", {"sigma": None, "covariances": -np.eye(3)}),
        ("covariances", {"sigma": None, "covariances": np.zeros((3, 3, 3))}),
        ("delta", {"delta": -0.1}),
        ("delta", {"delta": 100.0}),
        ("prior", {"prior": np.eye(4)}),
        ("putative", {"putative": [[0, 20]]}),
        ("putative", {"putative": [[0.5, 1]]}),
    ],
)
def test_bad_input_names_its_field_and_the_remedy(scene, field, arguments):
    given = {"model": scene.model, "cloud": scene.cloud, "sigma": scene.sigma, **arguments}
    with pytest.raises(ValueError, match=";") as raised:
        sf.Problem(**given)
    assert raised.value.field == field and raised.value.remedy
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"search": "rigid-consensu"}, "did you mean `rigid-consensus`"),
        ({"search": {"name": "rigid-consensus", "budgt": 3}}, "no setting `budgt`"),
        ({"search": 3}, "give a name"),
        ({"solver": "stereo-reprojection"}, "use `mahalanobis`"),
        ({"max_p_wrong": 2.0}, "at most 1"),
        ({"max_p_wrong": "lax"}, "strict, balanced or permissive"),
        ({"acceptance": {"min_points": 2}}, "3 or more"),
        ({"acceptance": {"min_pionts": 3}}, "min-pionts"),
    ],
)
def test_bad_settings_say_what_is_allowed(scene, arguments, text):
    problem = sf.Problem(scene.model, scene.cloud, sigma=scene.sigma)
    with pytest.raises(ValueError, match=text):
        sf.solve(problem, **arguments)


def test_a_pose_that_is_no_motion_is_refused():
    with pytest.raises(ValueError, match="orthonormal"):
        sf.PosePrior(np.diag([2.0, 2.0, 2.0, 1.0]), 0.1, 0.1)
    with pytest.raises(ValueError, match="reflection|determinant"):
        sf.BoxPrior(np.diag([1.0, 1.0, -1.0, 1.0]), 0.1)
    with pytest.raises(ValueError, match="uncertainty"):
        sf.PosePrior(np.eye(4))
    with pytest.raises(ValueError, match="positive"):
        sf.BoxPrior(np.eye(4), 0.0)


def test_a_missing_file_and_an_invalid_one(tmp_path):
    with pytest.raises(FileNotFoundError):
        sf.Problem.load(tmp_path / "missing.json")
    path = tmp_path / "bad.json"
    path.write_text('{"format": "coherence-problem/1", "modle": []}')
    with pytest.raises(ValueError, match="did you mean `model`"):
        sf.Problem.load(path)


def test_every_search_answers_or_says_why_not(scene):
    prior = sf.PosePrior(scene.object_from_camera, 0.02, 0.01)
    problem = sf.Problem(scene.model, scene.cloud, prior=prior, sigma=scene.sigma)
    names = [name for name in sf.searches() if not name.startswith("own-")]
    assert "rigid-consensus" in names and len(names) >= 10
    for name in names:
        answer = sf.solve(problem, search=name)
        assert answer.search == name
        assert answer.is_fix or (answer.reason and answer.remedy), name
        if answer.is_fix:
            np.testing.assert_allclose(answer.object_from_camera, scene.object_from_camera, atol=0.02)


def test_settings_change_the_answer(scene):
    problem = sf.Problem(scene.model, scene.cloud, sigma=scene.sigma)
    assert sf.solve(problem, max_p_wrong="strict").is_fix
    few = sf.solve(problem, acceptance={"min_points": 9})
    assert few.reason == "too-few" and few.best is not None
    np.testing.assert_array_equal(few.best.pairs, scene.pairs)
    settings = sf.describe("rigid-consensus")["settings"]
    assert "budget" in settings
    spent = sf.solve(problem, search={"name": "complete-enumeration", "budget": 1})
    assert spent.reason == "budget"


def test_threads_solve_at_the_same_time(scene):
    problem = sf.Problem(scene.model, scene.cloud, sigma=scene.sigma)
    expected, found = sf.solve(problem).object_from_camera, []

    def work():
        for _ in range(5):
            found.append(sf.solve(problem).object_from_camera)

    threads = [threading.Thread(target=work) for _ in range(4)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert len(found) == 20
    for pose in found:
        np.testing.assert_array_equal(pose, expected)


def test_shards_can_be_sent_to_other_processes(tmp_path):
    parts = sf.shards(tmp_path / "experiment.toml", 3, tmp_path / "parts", settings={"source.frames": 2})
    assert pickle.loads(pickle.dumps(parts)) == parts
    assert [part.number for part in parts] == [1, 2, 3] and parts[0].settings == ("source.frames=2",)
