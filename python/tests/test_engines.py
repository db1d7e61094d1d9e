"""Runs on local clusters whose workers are killed."""

import multiprocessing
import os
import signal
import time
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from threading import Thread

import pytest
import seafix as sf

pytestmark = pytest.mark.long

#: A part takes seconds and has some dozen pieces, so that it is killed in its midst.
SWEEP = """
question = "How do the errors of two solvers grow with the distance?"
seed = 1

[source]
name = "virtual-points"
frames = 300

[[vary]]
key = "source.distance"
values = [2.0, 2.4, 2.8, 3.2, 3.6, 4.0]

[[vary]]
key = "pipeline.solver"
values = ["kabsch", "mahalanobis"]
"""

#: The longest wait for a worker to begin (s).
PATIENCE = 120


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "sweep.toml").write_text(SWEEP)
    return sf.run(folder / "sweep.toml", folder / "one", threads=2, timed=False), folder / "sweep.toml"


def process_of(folder):
    """The process of this user that holds a file below the folder open, if there is one."""
    for process in Path("/proc").glob("[0-9]*"):
        try:
            files = [os.readlink(file) for file in (process / "fd").iterdir()]
        except OSError:
            continue
        # This process waits and never writes there.
        if int(process.name) != os.getpid() and any(file.startswith(f"{folder}/") for file in files):
            return int(process.name)
    return None


class Killer(Thread):
    """Kills the worker of a part after the part's first piece, and before its last."""

    def __init__(self, part):
        super().__init__(daemon=True)
        self.folder, self.pieces, self.killed = Path(part.out), None, None

    def run(self):
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            process = process_of(self.folder)
            if process is not None and list(self.folder.glob("pieces/*/seal.json")):
                # A stopped process does not go on between the count and its end.
                os.kill(process, signal.SIGSTOP)
                self.pieces = len(list(self.folder.glob("pieces/*/seal.json")))
                os.kill(process, signal.SIGKILL)
                self.killed = process
                return
            time.sleep(0.005)


def files(run):
    kept = (path for path in run.folder.iterdir() if path.suffix in (".mcap", ".parquet", ".csv"))
    return {path.name: path.read_bytes() for path in kept}


def assert_same(sweep, parts, killer, tmp_path):
    killer.join(PATIENCE)
    full, _ = sweep
    assert killer.killed is not None and process_of(killer.folder) is None
    # The part was killed in its midst.
    assert 0 < killer.pieces < len(list(killer.folder.glob("pieces/*/seal.json")))
    merged = sf.merge([part.out for part in parts], tmp_path / "merged")
    assert files(merged) == files(full) and len(files(full)) >= 13


def test_a_killed_worker_of_dask_changes_no_byte(sweep, tmp_path):
    distributed = pytest.importorskip("dask.distributed")
    parts = sf.shards(sweep[1], 4, tmp_path / "parts", timed=False)
    cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with cluster, distributed.Client(cluster) as client:
        killer = Killer(parts[0])
        killer.start()
        assert sf.compute(parts, client) == [part.out for part in parts]
    assert_same(sweep, parts, killer, tmp_path)


def test_a_killed_worker_of_ray_changes_no_byte(sweep, tmp_path):
    ray = pytest.importorskip("ray")
    parts = sf.shards(sweep[1], 4, tmp_path / "parts", timed=False)
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    try:
        killer = Killer(parts[0])
        killer.start()
        assert sf.compute(parts, ray) == [part.out for part in parts]
    finally:
        ray.shutdown()
    assert_same(sweep, parts, killer, tmp_path)


def test_parts_of_a_broken_pool_continue_in_another(sweep, tmp_path):
    parts = sf.shards(sweep[1], 4, tmp_path / "parts", timed=False)
    spawn = multiprocessing.get_context("spawn")
    killer = Killer(parts[0])
    killer.start()
    with pytest.raises(BrokenProcessPool), ProcessPoolExecutor(2, mp_context=spawn) as pool:
        sf.compute(parts, pool)
    with ProcessPoolExecutor(2, mp_context=spawn) as pool:
        assert sf.compute(parts, pool) == [part.out for part in parts]
    assert_same(sweep, parts, killer, tmp_path)
