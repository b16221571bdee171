"""The process that writes a run, so that another process can decide whether a run marked as running
still is.
"""

import contextlib
import functools
import os
import socket
from pathlib import Path
from typing import Any

TAG = "tractexp.process"
PAGE = 1000  # runs a query
closed: list[str] = []  # runs that this process has closed where it opened a store


@functools.cache
def _identify_machine() -> tuple[str, str, str]:
    """This computer, its boot, and its namespace of processes; "-" where the system
    does not say.
    """
    number, boot = (
        _read_system_file(Path(path))[:12]
        for path in ("/etc/machine-id", "/proc/sys/kernel/random/boot_id")
    )
    try:
        namespace = os.readlink("/proc/self/ns/pid")
    except OSError:
        namespace = "-"
    return f"{socket.gethostname()}/{number}".replace(" ", "_"), boot, namespace


def _read_system_file(path: Path) -> str:
    """The text of a file of the system; "-" where it is not there."""
    try:
        return path.read_text().strip() or "-"
    except OSError:
        return "-"


def _read_start(pid: int) -> str:
    """When a process began, in the system's own count; "" where there is none, "-" where the system
    does not say.
    """
    if os.name == "nt":
        return "-"
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return ""
    except OSError:
        return "-"
    status = _read_system_file(Path(f"/proc/{pid}/stat")).rpartition(")")[2].split()
    if status and status[0] in "ZX":
        return ""
    return status[19] if len(status) > 19 else "-"


def sign_process() -> str:
    """This process, as a tag of the runs that it writes."""
    return " ".join([*_identify_machine(), str(os.getpid()), _read_start(os.getpid())])


def has_ended(tag: str) -> bool | None:
    """Whether the process of a signature has ended; None where this computer cannot decide."""
    parts = tag.split()
    if len(parts) != 5 or parts[0] != _identify_machine()[0]:
        return None
    if parts[1] != _identify_machine()[1]:
        return True  # the computer has been started anew
    if parts[2] != _identify_machine()[2] or not parts[3].isdecimal():
        return None
    begun = _read_start(int(parts[3]))
    return not begun or (begun != parts[4] and "-" not in (begun, parts[4]))


def close_stale(client: Any) -> list[str]:
    """Close runs as KILLED whose process has ended without a word, and return their ids."""
    stale = [
        run.info.run_id for run in list_running(client) if has_ended(run.data.tags.get(TAG, ""))
    ]
    for run_id in stale:
        client.set_terminated(run_id, "KILLED")
    return stale


def list_running(client: Any) -> list[Any]:
    """The runs of a store that are said to be running."""
    experiments = [experiment.experiment_id for experiment in client.search_experiments()]
    return search(client, experiments, "attributes.status = 'RUNNING'") if experiments else []


def search(
    client: Any, experiments: list[str], filter: str, order: tuple[str, ...] = ()
) -> list[Any]:
    """All runs of some experiments that match MLflow's `filter`, page by page."""
    runs, token = [], None
    while True:
        page = client.search_runs(
            experiments, filter, max_results=PAGE, order_by=[*order], page_token=token
        )
        runs += page
        token = page.token
        if not token:
            return runs


def close_quietly(client: Any) -> None:
    """Close stale runs by `close_stale`, and ignore errors: the next use of the store
    raises them.
    """
    with contextlib.suppress(Exception):
        closed.extend(close_stale(client))
