"""Which process writes a run: from that another one tells whether a run that says it is running still is."""

import contextlib
import functools
import os
import socket
from pathlib import Path
from typing import Any

TAG = "tractexp.process"
PAGE = 1000  # runs asked for at a time
closed: list[str] = []  # runs that this process has closed where it opened a store


@functools.cache
def _machine() -> tuple[str, str, str]:
    """This computer, since when it runs, and which processes it sees; "-" where that is not told."""
    number, boot = (_read(Path(path))[:12] for path in ("/etc/machine-id", "/proc/sys/kernel/random/boot_id"))
    try:
        seen = os.readlink("/proc/self/ns/pid")
    except OSError:
        seen = "-"
    return f"{socket.gethostname()}/{number}".replace(" ", "_"), boot, seen


def _read(path: Path) -> str:
    try:
        return path.read_text().strip() or "-"
    except OSError:
        return "-"


def _begun(pid: int) -> str:
    """When a process began, in the system's own count; "" where there is none, "-" where it cannot be told."""
    if os.name == "nt":
        return "-"
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return ""
    except OSError:
        return "-"
    told = _read(Path(f"/proc/{pid}/stat")).rpartition(")")[2].split()
    if told and told[0] in "ZX":
        return ""
    return told[19] if len(told) > 19 else "-"


def signature() -> str:
    """This process, as a tag of the runs that it writes."""
    return " ".join([*_machine(), str(os.getpid()), _begun(os.getpid())])


def gone(told: str) -> bool | None:
    """Whether the process of a signature has ended; None where that cannot be told from here."""
    parts = told.split()
    if len(parts) != 5 or parts[0] != _machine()[0]:
        return None
    if parts[1] != _machine()[1]:
        return True  # the computer has been started anew
    if parts[2] != _machine()[2] or not parts[3].isdecimal():
        return None
    begun = _begun(int(parts[3]))
    return not begun or (begun != parts[4] and "-" not in (begun, parts[4]))


def close_stale(client: Any) -> list[str]:
    """Close runs as KILLED whose process has ended without a word, and return their ids."""
    stale = [run.info.run_id for run in running(client) if gone(run.data.tags.get(TAG, ""))]
    for run_id in stale:
        client.set_terminated(run_id, "KILLED")
    return stale


def running(client: Any) -> list[Any]:
    """All runs that say they are running."""
    experiments = [found.experiment_id for found in client.search_experiments()]
    found, token = [], None
    while experiments:
        page = client.search_runs(experiments, "attributes.status = 'RUNNING'", max_results=PAGE, page_token=token)
        found += page
        token = page.token
        if not token:
            break
    return found


def close_quietly(client: Any) -> None:
    """As `close_stale`, where something else is to be done: a store that refuses tells so then."""
    with contextlib.suppress(Exception):
        closed.extend(close_stale(client))
