"""A machine that is short of everything: workers that start late, or are killed
before they begin.
"""

import os
import signal

import pytest
from command_line import start_command

if os.name == "nt":
    pytest.skip("workers are ended by signals", allow_module_level=True)

# of each worker, as it starts: how late it is, and whether one before it has started
LATE = """
import os, pathlib, signal, sys, time
if any("popen_loky" in word for word in sys.orig_argv):
    seen = pathlib.Path(os.environ["SEEN"])
    first = not seen.exists()
    seen.touch()
    {what}
"""
WAYS = {
    "late": "time.sleep(6)",
    "killed": f"first and os.kill(os.getpid(), {int(signal.SIGKILL)})",
    "always killed": f"os.kill(os.getpid(), {int(signal.SIGKILL)})",
}


@pytest.mark.parametrize("way", WAYS)
def test_doctor_waits_for_a_worker_as_a_sweep_does(way, tmp_path):
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "sitecustomize.py").write_text(LATE.format(what=WAYS[way]))
    surroundings = {"PYTHONPATH": str(tmp_path / "site"), "SEEN": str(tmp_path / "seen")}
    done = start_command("doctor", cwd=tmp_path, **surroundings)
    assert (tmp_path / "seen").exists()
    if way == "always killed":
        assert done.returncode == 2
        assert "no worker process starts" in done.stdout
        assert "is there enough memory for them?" in done.stdout
    else:
        assert done.returncode == 0, done.stdout
        assert "and a worker starts" in done.stdout
