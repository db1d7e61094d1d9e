"""Ctrl-C during long work."""

import signal
import subprocess
import sys

#: A search with a budget of hours, in a program of its own, so that nothing of it is left. A shell starts programs in the
#: background with Ctrl-C ignored; the first line undoes that.
PROGRAM = """
import signal; signal.signal(signal.SIGINT, signal.default_int_handler)
import numpy as np, seafix as sf
rng = np.random.default_rng(0)
problem = sf.Problem(rng.uniform(-1, 1, (30, 3)), rng.uniform(-1, 1, (150, 3)) + [0, 0, 3], sigma=0.05)
try:
    print("starts", flush=True)
    sf.solve(problem, search={"name": "backtracking", "budget": 2**40})
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


def test_ctrl_c_ends_the_wait_for_a_search():
    with subprocess.Popen([sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout.readline() == "starts\n"
        program.send_signal(signal.SIGINT)
        assert program.stdout.readline() == "interrupted\n"
    assert program.returncode == 0
