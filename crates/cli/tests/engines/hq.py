"""`hq submit --wait --array=1-N … sh SCRIPT` by HyperQueue's Python package: a real server and a real worker, as long as it takes."""

import sys

from hyperqueue import Job, LocalCluster
from hyperqueue.cluster import WorkerConfig

options = dict(word[2:].split("=", 1) for word in sys.argv[2:] if word.startswith("--") and "=" in word)
command = [word for word in sys.argv[2:] if not word.startswith("--")]
first, last = map(int, options["array"].split("-"))
assert sys.argv[1] == "submit" and "--wait" in sys.argv and first == 1, sys.argv

with LocalCluster(None, WorkerConfig(cores=2)) as cluster:
    job = Job(max_fails=None, name=options["name"])
    # The package numbers tasks from 0 on, `--array=1-N` from 1 on.
    job.program(["true"], stdout="/dev/null", stderr="/dev/null")
    for _ in range(last):
        job.program(command, stdout=options["stdout"], stderr=options["stderr"])
    client = cluster.client()
    sys.exit(0 if client.wait_for_jobs([client.submit(job)], raise_on_error=False) else 1)
