"""Worker processes that are replaced while jobs are waiting."""

import subprocess
import sys

GROWING = """
import sys
import time
from joblib import Parallel, delayed
from tractexp.workers import replaced

def grow(k):  # past the 300 MB at which joblib lets a worker end; it looks once in a second
    sys.__dict__.setdefault("kept", []).append(b"x" * 150_000_000)
    time.sleep(1.1)
    return k

with replaced():
    print(Parallel(n_jobs=2)(delayed(grow)(k) for k in range(10)))
"""


def test_jobs_end_where_warnings_are_errors_and_their_workers_grow():
    """Without `replaced` the last jobs never end: this one is killed."""
    done = subprocess.run([sys.executable, "-W", "error", "-c", GROWING], capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n")[0] == str(list(range(10)))
    assert "A worker stopped" not in done.stderr
