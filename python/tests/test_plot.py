"""Figures of runs, tables and arrays."""

import sys

import numpy as np
import pytest
import seafix as sf

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")
pytest.importorskip("pyarrow")

NOISE = """
question = "How do the errors of two solvers grow with the noise?"
seed = 1

[source]
name = "virtual-layouts"
layouts = 2
frames = 24

[[vary]]
key = "source.sigma-px"
values = [0.1, 0.4]

[[vary]]
key = "pipeline.solver"
values = ["kabsch", "mahalanobis"]
"""


@pytest.fixture(autouse=True)
def closed():
    yield
    matplotlib.pyplot.close("all")


@pytest.fixture(scope="module")
def noise(tmp_path_factory):
    folder = tmp_path_factory.mktemp("noise")
    (folder / "noise.toml").write_text(NOISE)
    return sf.run(folder / "noise.toml", folder / "run", threads=2)


POINTS = """
question = "Where is the camera?"
seed = 1

[source]
name = "virtual-points"
frames = 6
"""


def labels(ax):
    return ax.get_xlabel(), ax.get_ylabel()


def test_errors_grow_with_the_noise_above_the_bound(noise):
    ax = sf.plot.errors(noise, "source.sigma-px")
    assert labels(ax) == ("sigma (px)", "RMS TRE (mm)")
    *methods, bound = ax.lines
    assert [line.get_label() for line in methods] == ["kabsch", "mahalanobis"]
    assert bound.get_label() == "Cramér–Rao bound"
    # One bar for each method and value.
    assert sum(len(bars.get_segments()) for bars in ax.collections) == 4
    assert all(np.diff(line.get_ydata())[0] > 0 for line in ax.lines)
    rows = [row for row in noise.table().to_pylist() if row["outcome"] == "fix" and row["trial"].startswith("001")]
    expected = 1e3 * np.sqrt(np.mean([row["tre_rms"] ** 2 for row in rows]))
    assert methods[0].get_ydata()[0] == pytest.approx(expected)
    ax.figure.canvas.draw()


def test_a_mapping_of_arrays_is_a_table():
    error = np.array([0.001, 0.003, 0.002, 0.004, 9.0])
    results = {
        "solver": ["a", "a", "b", "b", "b"],
        "outcome": ["fix"] * 5,
        "wrong": [False] * 4 + [True],
        "attitude_error": error,
        "visible": [5, 9, 5, 9, 9],
    }
    ax = sf.plot.errors(results, "visible", error="attitude_error", label="visible points")
    assert labels(ax) == ("visible points", "RMS attitude error (deg)") and len(ax.lines) == 2
    # The wrong fix does not count.
    np.testing.assert_allclose(ax.lines[1].get_ydata(), np.degrees([0.002, 0.004]))
    with pytest.raises(ValueError, match="`distance`; there are solver"):
        sf.plot.errors(results, "distance")
    with pytest.raises(ValueError, match="no number"):
        sf.plot.errors(results, "solver", error="attitude_error")
    with pytest.raises(ValueError, match="nothing to draw"):
        sf.plot.errors({**results, "outcome": ["rejected"] * 5}, "visible", error="attitude_error")


def test_a_roc_counts_right_and_false_fixes():
    present = {"outcome": ["fix"] * 3 + ["rejected"], "wrong": [0, 0, True, 0], "p_wrong": [1e-4, 0.2, 0.1, 0.5]}
    absent = {"outcome": ["fix", "rejected"], "wrong": [True, False], "p_wrong": [0.1, 0.9]}
    ax = sf.plot.roc(present, absent, label="mine")
    curve, marked = ax.lines
    # Limits 0, 1e-4, 0.1 and 0.2: right fixes of four attempts, false ones of two.
    np.testing.assert_array_equal(curve.get_ydata(), [0.0, 0.25, 0.25, 0.5])
    np.testing.assert_array_equal(curve.get_xdata(), [0.0, 0.0, 0.5, 0.5])
    assert marked.get_xydata().tolist() == [[0.0, 0.25]] and marked.get_label() == "p_wrong ≤ 0.001"
    assert sf.plot.roc(present, absent, series=1, label="other", ax=ax) is ax and len(ax.lines) == 4
    assert labels(ax)[1] == "right fixes (fraction)"
    with pytest.raises(ValueError, match="no attempts"):
        sf.plot.roc(present, {"outcome": [], "wrong": [], "p_wrong": []})


def test_a_trajectory_has_truth_estimate_and_fixes(tmp_path):
    (tmp_path / "points.toml").write_text(POINTS)
    run = sf.run(tmp_path / "points.toml", tmp_path / "run", threads=2)
    log = run.log(run.trials[0])
    ax = sf.plot.trajectory(log)
    assert [line.get_label() for line in ax.lines] == ["truth", "fixes"]
    assert labels(ax) == ("north (m)", "east (m)") and ax.get_aspect() == 1.0
    truth = {frame.frame: frame.truth for frame in log.frames}
    fixed = [frame.frame for frame in log.frames for target in frame.targets if target.outcome == "fix"]
    # A fix by the survey is within the errors of fix and survey.
    places = np.array([truth[frame][:2, 3] for frame in fixed])
    np.testing.assert_allclose(ax.lines[1].get_xydata(), places, atol=0.3)
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, 2, 3] = np.arange(5.0)
    ax = sf.plot.trajectory(poses, truth=poses[:, :3, 3], plane=(0, 2))
    assert labels(ax)[1] == "down (m)" and ax.yaxis.get_inverted() and len(ax.lines) == 2
    with pytest.raises(ValueError, match="shape"):
        sf.plot.trajectory(np.zeros((5, 2)))
    with pytest.raises(ValueError, match="no pose"):
        sf.plot.trajectory()
    with pytest.raises(ValueError, match="plane"):
        sf.plot.trajectory(poses, plane=(0, 3))


def test_a_forest_shows_the_intervals_of_the_reports(noise):
    rng = np.random.default_rng(0)
    differences = {"a – b": rng.normal(0.01, 0.001, 50), "a – c": rng.normal(0.0, 0.001, 50)}
    ax = sf.plot.forest(differences)
    names = [text.get_text() for text in ax.get_yticklabels()]
    assert names == ["a – c", "a – b"] and labels(ax)[0] == "median difference of TRE (mm)"
    _, lowest, highest = ax.lines
    assert lowest.get_xdata()[0] == pytest.approx(1e3 * np.median(differences["a – c"]))
    # A significant difference has another colour.
    assert highest.get_color() != lowest.get_color()
    spans = [segment for bars in ax.collections for segment in bars.get_segments()]
    assert len(spans) == 2 and spans[1][0][0] > 0 > spans[0][0][0]
    ax = sf.plot.forest(noise, over="source.sigma-px")
    names = [text.get_text() for text in ax.get_yticklabels()]
    assert names == [f"sigma (px) {sigma}: kabsch – mahalanobis" for sigma in ("0.4", "0.1")]
    assert all(line.get_xdata()[0] > 0 for line in ax.lines[1:])
    with pytest.raises(ValueError, match="two attempts"):
        sf.plot.forest(noise, by="solver")
    with pytest.raises(ValueError, match="confidence"):
        sf.plot.forest(differences, confidence=95)


def test_the_interval_of_a_median_is_that_of_a_block_bootstrap():
    from seafix._seafix import median_interval

    values = np.random.default_rng(1).normal(size=64)
    middle, low, high = median_interval(values, 0.95)
    assert middle == np.median(values) and low < middle < high and median_interval(values, 0.95) == (middle, low, high)
    # The standard deviation of the median of 64 independent normal values is √(π/2)/8; an interval has 2 · 1.96 of them.
    samples = np.random.default_rng(2).normal(size=(50, 64))
    widths = [high - low for _, low, high in (median_interval(sample, 0.95) for sample in samples)]
    assert np.mean(widths) / (2 * 1.96) == pytest.approx(np.sqrt(np.pi / 2) / 8, rel=0.15)
    # A wider confidence has a wider interval, and a failure moves one end only.
    assert median_interval(values, 0.99)[2] > high
    failed = np.where(np.arange(64) < 40, np.inf, values)
    assert median_interval(failed, 0.95)[2] == np.inf
    with pytest.raises(ValueError, match="NaN"):
        median_interval([np.nan], 0.95)


def test_without_matplotlib_the_remedy_is_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match="pip install matplotlib") as raised:
        sf.plot.forest({"a": np.ones(3)})
    assert "\n" not in str(raised.value)
