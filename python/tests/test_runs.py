"""Runs of experiments, their logs, and their parts."""

import multiprocessing
import os

import numpy as np
import pytest
import seafix as sf

EXPERIMENT = """
question = "How large is the error of two solvers?"

[source]
name = "virtual-points"
frames = 6

[pipeline]
solver = "kabsch"

[[vary]]
key = "pipeline.solver"
values = ["kabsch", "{}"]
"""


@pytest.fixture
def experiment(tmp_path):
    def write(solver="horn"):
        path = tmp_path / "experiment.toml"
        path.write_text(EXPERIMENT.format(solver))
        return path

    return write


def test_a_run_has_a_table_and_logs(experiment, tmp_path):
    reported = []
    run = sf.run(experiment(), tmp_path / "run", threads=2, progress=lambda done, total: reported.append((done, total)))
    assert reported[-1] == (12, 12) and len(run.trials) == 2
    log = run.log(run.trials[0])
    frame = log.frames[3]
    assert frame.frame == 3 and frame.cloud.shape[1] == 3 and frame.covariances.shape[1:] == (3, 3)
    assert len(log) == len(log.frames) and frame.truth.shape == (4, 4) and log.axes["pipeline.solver"] in ["kabsch", "horn"]
    fixes = [target for frame in log.frames for target in frame.targets if target.outcome == "fix"]
    assert fixes and fixes[0].covariance.shape == (6, 6) and fixes[0].pairs.shape[1] == 2
    pytest.importorskip("pyarrow")
    table = run.table()
    assert table.num_rows >= 12 and {"trial", "frame", "outcome", "position_error"} <= set(table.column_names)
    with pytest.raises(OSError, match='existing="overwrite"'):
        sf.run(tmp_path / "experiment.toml", tmp_path / "run")
    with pytest.raises(KeyError):
        run.log("missing")


def test_an_own_solver_takes_part_in_a_run(experiment, tmp_path):
    pytest.importorskip("pyarrow")

    @sf.solver("own-in-run", least_squares=True)
    def own(src, dst, covariances):
        return sf.register(src, dst)[0]

    table = sf.run(experiment("own-in-run"), tmp_path / "run", threads=2).table().to_pylist()
    rows = {solver: [row for row in table if row["solver"] == solver] for solver in ["kabsch", "own-in-run"]}
    assert len(rows["kabsch"]) == len(rows["own-in-run"]) > 0
    for one, other in zip(rows["kabsch"], rows["own-in-run"]):
        assert one["outcome"] == other["outcome"]
        if one["position_error"] is not None:
            assert one["position_error"] == pytest.approx(other["position_error"], rel=1e-6)

    @sf.solver("own-in-run")
    def broken(src, dst, covariances):
        raise RuntimeError("in my solver")

    with pytest.raises(RuntimeError, match="in my solver"):
        sf.run(experiment("own-in-run"), tmp_path / "again", threads=2)


def test_merged_parts_have_the_bytes_of_a_run(experiment, tmp_path):
    path = experiment()
    # Two sources are two pieces, so that each part has one.
    path.write_text(path.read_text() + '\n[[vary]]\nkey = "source.distance"\nvalues = [2.0, 3.0]\n')
    full = sf.run(path, tmp_path / "full", threads=1, timed=False)
    folders = [shard() for shard in sf.shards(path, 2, tmp_path / "parts", timed=False)]
    with pytest.raises(ValueError, match="missing|lack|piece"):
        sf.merge(folders[:1], tmp_path / "half")
    merged = sf.merge(folders, tmp_path / "merged")
    for trial in full.trials:
        name = f"{trial}.mcap"
        assert (full.folder / name).read_bytes() == (merged.folder / name).read_bytes()
    assert (full.folder / "results.parquet").read_bytes() == (merged.folder / "results.parquet").read_bytes()


def test_faults_of_an_experiment_are_stated(experiment, tmp_path):
    with pytest.raises(ValueError, match="did you mean `horn`"):
        sf.run(experiment("hron"), tmp_path / "run")
    with pytest.raises(ValueError, match="frames"):
        sf.run(experiment(), tmp_path / "run", settings={"source.frames": -1})
    with pytest.raises(FileNotFoundError):
        sf.read_log(tmp_path / "missing.mcap")
    (tmp_path / "no.mcap").write_bytes(b"no log")
    with pytest.raises(ValueError, match="MCAP"):
        sf.read_log(tmp_path / "no.mcap")
    with pytest.raises(FileNotFoundError, match="manifest"):
        sf.Run(tmp_path)
    assert np.all([part.count == 2 for part in sf.shards("e.toml", 2, tmp_path)])


def _run_in(arguments):
    experiment, out = arguments
    return len(sf.run(experiment, out, threads=2).table())


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_forked_process_has_threads_of_its_own(experiment, tmp_path):
    """Threads do not survive a fork: work on those of the parent would wait forever."""
    path = experiment()
    rows = _run_in((path, tmp_path / "parent"))
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply_async(_run_in, ((path, tmp_path / "child"),)).get(timeout=120) == rows


def test_settings_are_numbers_of_numpy_too(experiment, tmp_path):
    path = experiment()
    run = sf.run(path, tmp_path / "a", threads=1, settings={"source.frames": np.int64(2)})
    assert len(set(run.table()["frame"].to_pylist())) <= 2
    for value in (None, float("nan"), object()):
        with pytest.raises(ValueError, match="the setting `source.frames` is") as raised:
            sf.run(path, tmp_path / "b", threads=1, settings={"source.frames": value})
        assert raised.value.field == "source.frames"
