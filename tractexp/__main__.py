"""Command line: compose the configuration, run the task, end with a sentence where the input is
wrong.
"""

import os
import sys

# `python -m tractexp` would look for modules beside the records first. A clone that is run where it
# lies needs that.
if (
    __name__ == "__main__"
    and not sys.flags.safe_path
    and not __file__.startswith(os.path.join(sys.path[0], ""))
):
    del sys.path[0]

import gc
import importlib
import signal
from collections.abc import Sequence

# The matrices of a fit are small: threads of a BLAS cost more than they bring (30 times on two busy
# cores), and the cores are for the jobs of a sweep. Set before NumPy is imported; an explicit
# choice of the user's stands.
for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

from tractexp.errors import Stopped, UserError  # noqa: E402
from tractexp.process import interpreter  # noqa: E402
from tractexp.storage import credentials  # noqa: E402
from tractexp.text.output import open_outlet  # noqa: E402
from tractexp.text.progress import ask_for  # noqa: E402
from tractexp.text.wording import write_on_one_line  # noqa: E402

# what no single job that is logged has: maybe
UNLOGGED = ("-", "tracking.enabled=", "task=export", "experiment=", "hydra.mode=")
# what is imported stays: to look for garbage in it takes a quarter of a short job
SELDOM = (50_000, 20, 50)
COMMANDS = {  # beside the tasks: where each is
    "ui": "tractexp.cli.ui:ui",
    "look": "tractexp.cli.look:look",
    "sync": "tractexp.cli.sync:sync",
    "doctor": "tractexp.cli.doctor:doctor",
    "list": "tractexp.configuration.usage:print_choices",
    "new": "tractexp.cli.new:new",
}
FULL_ERROR = "HYDRA_FULL_ERROR"  # Hydra's own switch: set it to see tracebacks


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `tractexp` and `python -m tractexp`; returns the exit code. `argv` is by
    default the process's.
    """
    arguments = sys.argv[1:] if argv is None else [*argv]
    gc.set_threshold(*SELDOM)
    try:
        with open_outlet() as out, interpreter.keep_safe_path():
            code = _run_with_refusals(arguments)
        if out and out.lost:
            return _print_refusal(
                f"what was to be printed could not be written ({out.lost}); files are whole",
                code or 2,
            )
        return code
    finally:
        gc.freeze()  # nor at the end, when everything goes anyway


def _run_with_refusals(arguments: list[str]) -> int:
    """Do what is asked; a sentence where it cannot be done."""
    traceback = os.environ.get(FULL_ERROR, "0") not in ("", "0")
    try:
        return _dispatch_command(arguments)
    except KeyboardInterrupt as stop:
        sentence = str(stop) or "interrupted; nothing was logged for this run"
        return _print_refusal(sentence, getattr(stop, "code", 130))
    except (UserError, OSError, MemoryError) as error:
        if traceback:
            raise
        return _print_refusal(_describe_refusal(error))
    except Exception as error:
        if traceback:
            raise
        if mark := getattr(error, "problem_mark", None):  # of a YAML file that Hydra read
            problem = getattr(error, "problem", None) or type(error).__name__
            return _print_refusal(f"{mark.name}: line {mark.line + 1}: not valid YAML ({problem})")
        from tractexp.configuration.plugin import place_in_plugin

        place = place_in_plugin(error)
        whose = (
            f"the plugin fails in {place}"
            if place
            else "the program failed, which is its own mistake"
        )
        return _print_refusal(
            f"{whose}: {type(error).__name__}: {error}; {FULL_ERROR}=1 shows where", 1
        )


def _describe_refusal(error: UserError | OSError | MemoryError) -> str:
    """The sentence of an error that the user or the machine is the cause of."""
    if isinstance(error, MemoryError):
        return "this takes more memory than there is; ask for less, such as a smaller population"
    if isinstance(error, OSError):
        return f"{error.filename or 'a file'} cannot be used: {error.strerror or error}"
    return str(error)


def _print_refusal(sentence: str, code: int = 2) -> int:
    """Print why a command was refused; its exit code."""
    print(f"tractexp: {write_on_one_line(sentence)}", file=sys.stderr)
    return code


def _refuse_command_as_task(arguments: Sequence[str]) -> None:
    """Raise `UserError` for a task that is a command of its own."""
    for name in COMMANDS:
        if f"task={name}" in arguments:
            raise UserError(f"task={name}: {name} is no task but a command: tractexp {name}")


def _dispatch_command(arguments: list[str]) -> int:
    """Run a command beside the tasks, or a task; the exit code."""
    _refuse_credentials(arguments)
    _refuse_command_as_task(arguments)
    if arguments and arguments[0] in COMMANDS:
        return _command(COMMANDS[arguments[0]], arguments[1:])
    if arguments and _is_file(arguments[0]):
        return _command(COMMANDS["look"], arguments)
    arguments = ask_for(arguments)
    if arguments[:1] == ["again"]:
        from tractexp.cli.again import build_repeat_command

        return _run(build_repeat_command(arguments[1:]))
    if arguments[:1] and os.path.isdir(arguments[0]):
        from tractexp.cli.folder import choose_command

        survey = choose_command(*arguments)
        return _run(survey) if survey else 0
    if {"--help", "-h"} & {*arguments}:
        from tractexp.configuration.usage import describe_usage

        print(describe_usage())
        return 0
    return _run(arguments)


def _refuse_credentials(arguments: list[str]) -> None:
    """Raise `UserError` for an argument with a user's name or password in it."""
    for argument in arguments:
        key, equals, _ = argument.partition("://")[0].rpartition("=")
        credentials.check(key if equals else "what is given", argument)


def _command(place: str, arguments: list[str]) -> int:
    """Run the function of a command; the exit code."""
    module, _, function = place.partition(":")
    return getattr(importlib.import_module(module), function)(arguments)


def _is_file(argument: str) -> bool:
    """Whether an argument names a file to look at, one that may be missing, and is no setting."""
    if "=" in argument or argument.startswith("-"):
        return False
    if os.path.isfile(argument):
        return True
    from tractexp.record.reader import list_endings

    return os.path.splitext(argument)[1].lower() in list_endings()


def end_on_signal(*_: object) -> None:
    """End what runs in an orderly way when the system asks for it, as at a batch system's time
    limit.
    """
    raise Stopped("ended by SIGTERM; nothing was logged for this run", code=143)


def _run(arguments: list[str]) -> int:
    """Compose the configuration and run its task; the exit code."""
    signal.signal(signal.SIGTERM, end_on_signal)
    if not any(argument.startswith(UNLOGGED) for argument in arguments):
        from tractexp.tracking.process import start_ahead

        start_ahead()
    import hydra

    from tractexp.compat.hydra_versions import choose_behavior
    from tractexp.configuration.choices import CONF
    from tractexp.configuration.overrides import quote_overrides
    from tractexp.configuration.refusal import explain_errors
    from tractexp.configuration.run_command import remember_command
    from tractexp.sweep.hydra_groups import register

    register(arguments)
    remember_command(arguments)
    os.environ[FULL_ERROR] = "1"  # let exceptions through: they are told below, in one sentence
    with explain_errors():
        sys.argv[1:] = quote_overrides(arguments)  # where Hydra reads them
    ended: list[Exception] = []

    @hydra.main(**choose_behavior(), config_path=str(CONF), config_name="config")
    def job(config: object) -> object:
        from hydra.core.hydra_config import HydraConfig
        from hydra.types import RunMode

        from tractexp.cli.run import run
        from tractexp.sweep.job import run_job

        if HydraConfig.get().mode == RunMode.MULTIRUN:
            with explain_errors():
                return run_job(config)
        try:
            with explain_errors():
                run(config)
        except Exception as error:  # raised again below, beyond what Hydra would print about it
            ended.append(error)
        return None

    with explain_errors():
        job()
    for error in ended:
        raise error
    return 0


if __name__ == "__main__":
    sys.exit(main())
