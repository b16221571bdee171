"""Command line: compose the configuration, run the task, end with a sentence where the input is wrong."""

import gc
import os
import signal
import sys

# The matrices of a fit are small: threads of a BLAS cost more than they bring (30 times on two busy cores), and the
# cores are for the jobs of a sweep. Set before NumPy is imported; an explicit choice of the user's stands.
for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

from tractexp.errors import Stopped, UserError  # noqa: E402

UNLOGGED = (
    "-",
    "tracking.enabled=",
    "task=export",
    "experiment=",
    "hydra.mode=",
)  # no single job that is logged: maybe
SELDOM = (50_000, 20, 50)  # what is imported stays: to look for garbage in it takes a quarter of a short job
FULL_ERROR = "HYDRA_FULL_ERROR"  # Hydra's own switch: set it to see tracebacks


def main() -> int:
    """Entry point of `tractexp` and `python -m tractexp`; returns the exit code."""
    traceback = os.environ.get(FULL_ERROR, "0") not in ("", "0")
    gc.set_threshold(*SELDOM)
    try:
        if sys.argv[1:2] == ["ui"]:
            from tractexp.tasks.ui import ui

            return ui(sys.argv[2:])
        if sys.argv[1:2] == ["look"]:
            from tractexp.tasks.look import look

            return look(sys.argv[2:])
        if sys.argv[1:2] == ["sync"]:
            from tractexp.tasks.sync import sync

            return sync(sys.argv[2:])
        if sys.argv[1:2] == ["doctor"]:
            from tractexp.tasks.doctor import doctor

            return doctor(sys.argv[2:])
        if sys.argv[1:2] == ["new"]:
            from tractexp.new import new

            return new(sys.argv[2:])
        if sys.argv[1:2] == ["list"]:
            from tractexp.usage import listed

            return listed(sys.argv[2:])
        if {"--help", "-h"} & set(sys.argv[1:]):
            from tractexp.usage import usage

            print(usage())
            return 0
        return _run()
    except UserError as error:
        if traceback:
            raise
        print(f"tractexp: {error}", file=sys.stderr)
    except MemoryError:
        if traceback:
            raise
        print(
            "tractexp: this takes more memory than there is; ask for less, such as a smaller population",
            file=sys.stderr,
        )
    except KeyboardInterrupt as stop:
        print(f"tractexp: {str(stop) or 'interrupted; nothing was logged for this run'}", file=sys.stderr)
        return getattr(stop, "code", 130)
    finally:
        gc.freeze()  # nor at the end, when everything goes anyway
    return 2


def terminated(*_: object) -> None:
    """End what runs in an orderly way when the system asks for it, as at a batch system's time limit."""
    raise Stopped("ended by SIGTERM; nothing was logged for this run", code=143)


def _run() -> int:
    signal.signal(signal.SIGTERM, terminated)
    if not any(argument.startswith(UNLOGGED) for argument in sys.argv[1:]):
        from tractexp.tracking.process import start_ahead

        start_ahead()
    import hydra

    from tractexp.choices import CONF
    from tractexp.config import register
    from tractexp.overrides import overrides
    from tractexp.provenance import started
    from tractexp.refusal import explained

    register()
    started(sys.argv[1:])
    os.environ[FULL_ERROR] = "1"  # let exceptions through: they are told below, in one sentence
    with explained():
        sys.argv[1:] = overrides(sys.argv[1:])
    ended: list[Exception] = []

    @hydra.main(version_base="1.3", config_path=str(CONF), config_name="config")
    def job(config: object) -> None:
        from hydra.core.hydra_config import HydraConfig
        from hydra.types import RunMode

        from tractexp.sweep.job import run_job
        from tractexp.tasks.run import run

        try:
            with explained():
                (run_job if HydraConfig.get().mode == RunMode.MULTIRUN else run)(config)
        except (UserError, OSError, MemoryError) as error:  # raised again below, beyond what Hydra would print about it
            ended.append(error)

    with explained():
        job()
    for error in ended:
        raise error
    return 0


if __name__ == "__main__":
    sys.exit(main())
