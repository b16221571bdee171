"""What becomes of damaged settings: `python benchmarks/mutated_settings.py [--count 10000] [--first
0] [--seed 1]`.

Four in ten are commands that work, changed in one to three arguments as people and programs change
them: values that are no numbers, not finite, huge, of another kind, names that do not exist,
settings taken out, doubled or misspelt, references, brackets by the thousand, files that are none.
A command is composed, checked and, where it is accepted and identifies, its problem is made and
searched for a moment. The others are sidecars of a table, changed as JSON and as bytes, with which
the table is read. Allowed is that it works, or one sentence. Not allowed: another exception, a
warning, words of Python in what a user reads, more than 10 s of processor time. Counts go to
mutated_settings.json; the exit code says whether all held.
"""

import copy
import json
import os
import re
import signal
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy is imported

import tractexp

tractexp.__version__  # noqa: B018

import numpy as np  # noqa: E402
from mutated_files import DAMAGE, LEAKS, NASTY, command  # noqa: E402

from tractexp.configuration.choices import CONF  # noqa: E402
from tractexp.errors import UserError  # noqa: E402
from tractexp.storage import files  # noqa: E402

SECONDS = 10  # of processor time; a kernel that is compiled first takes half of it
WORDS = re.compile(
    LEAKS.pattern + r"|Config\b(?<!the Config)|OmegaConf|\bof type '|\btype"
    r" '|\bdict\b|\btuple\b|\bint\b|\bstr\b|\bfloat\b"
    r"|(?<!['=])\b(None|True|False)\b(?!')|Integer\b|\bkwarg|\bargument of"
    r" type|\bregex|\battribute|__"
    r"|\bnode\b|Enum|primitive"
)
DEEP = "[" * 100_000 + "]" * 100_000
VALUES = [
    *NASTY,
    "inf",
    "-inf",
    "1e999",
    "-1",
    "0",
    "0.0",
    "null",
    "true",
    "false",
    "???",
    "[]",
    "{}",
    "[[1]]",
    "{a:1}",
    "[1,2]",
    "[a,b]",
    "1,2",
    "a,b",
    "${nothing}",
    "${oc.env:HOME}",
    "${oc.env:NO_SUCH_VARIABLE}",
    "${seed}",
    "${",
    "}",
    "'",
    '"',
    "[",
    "(",
    "a b",
    "a=b",
    "=",
    "\\",
    "~",
    "*",
    "glob(*)",
    "range(1,3)",
    "choice(1,2)",
    "interval(0,1)",
    "1e20",
    "99999999999999999999",
    "-5e-324",
    "/proc/x",
    "/dev/null",
    "/dev/zero",
    ".",
    "/",
    "nothing.csv",
    "é",
    "—",
    "\x00",
    "\n",
    "None",
    "1j",
    "0x10",
    "1_000",
    "issa",
    "pso",
    "voltage",
    "zip",
    "stator_resistance",
    DEEP[:4000] + DEEP[-4000:],
    "x" * 5000,
]
JSONS = [
    None,
    True,
    False,
    0,
    -1,
    1e308,
    -1e-320,
    10**400,
    "",
    " ",
    "abc",
    "é",
    "U",
    "kV",
    "nan",
    "/",
    [],
    {},
    [[]],
    {"a": 1},
    [1, 2, 3],
    ["U", "P"],
    {"": ""},
    float("nan"),
    float("inf"),
    -float("inf"),
    "x" * 5000,
]

SIDECAR = {
    "name": "dip",
    "note": "made",
    "notes": ["one", "two"],
    "base": {"voltage": 27.5, "power": 20.0, "frequency": 50.0},
    "columns": {"t": "t", "U": "U", "P": "P", "Q": "Q"},
    "units": {"t": "s", "U": "pu", "P": "pu", "Q": "pu"},
    "uniform": True,
    "more": ["THD_u"],
    "window": {"name": "cycle", "at": [-0.01, 0.0, 0.01], "weights": [0.25, 0.5, 0.25]},
    "mine": {"kept": [1, {"a": None}]},
}


class Hung(Exception):
    """Nothing came of it for too long."""


def table(folder):
    """A table with a dip, of 300 rows; its path."""
    t = np.arange(300) / 200
    u = 1 - 0.4 * ((t >= 0.5) & (t < 0.7))
    rows = "\n".join(
        f"{a:.3f},{b:.3f},{b * b:.4f},{0.6 * b * b:.4f},0.01" for a, b in zip(t, u, strict=True)
    )
    return files.write(folder / "dip.csv", f"t,U,P,Q,THD_u\n{rows}\n")


def commands(path):
    """Commands that work."""
    csv = ["data=csv", f"data.train=[{path}]"]
    return [
        [],
        ["optimizer=pso", "data=tibet_30pct"],
        ["optimizer=issa_no_levy", "objective=huber", "seed=3", "budget=60"],
        ["optimizer=differential_evolution", "model=third_order_zip", "model.bounds.C=[0.5,0.9]"],
        ["optimizer=multistart_least_squares", "model.fixed.p_v=1.5", "model.substeps=2"],
        ["optimizer=covariant_sparrow", "model=motor_alone", "target=0.1", "time_limit=60"],
        ["optimizer=cmaes", "objective=student_t", "model.effects=[stator_resistance]"],
        ["model/motor=mechanical", "model/static=constant_impedance", "optimizer=random_search"],
        [
            *csv,
            "data.base_voltage=27.5",
            "data.base_power=20",
            "data.frequency=50",
            "data.pre=0.4",
            "data.post=1.0",
        ],
        [
            *csv,
            "data.columns={U:U,P:P}",
            "data.units={U:pu}",
            "optimizer=pso",
            "optimizer.population=20",
        ],
        [f"data.path={path}", "data=csv", "data.train=[1]", "model.per_event=[T_m]"],
        ["data=tibet_50pct_comtrade", "optimizer=cobyqa"],
        ["task=profile", "task.points=5"],
        ["task=survey", "data=csv", f"data.path={path}"],
        ["task=compare", "task.ties=0.1"],
        ["experiment=table3"],
    ]


def misspelt(word, rng):
    if not word:
        return "x"
    k = int(rng.integers(len(word)))
    return [
        word[:k] + word[k + 1 :],
        word[:k] + "x" + word[k:],
        word[::-1],
        word.upper(),
        word + ".",
    ][int(rng.integers(5))]


def one_of(items, rng):
    return items[int(rng.integers(len(items)))]


def near(value, rng):
    """A value changed: a digit, the sign, the size, the kind."""
    digits = [i for i, c in enumerate(value) if c.isdigit()]
    ways = [
        f"[{value}]",
        f"{{a:{value}}}",
        f"'{value}'",
        value + value,
        f"-{value}",
        f"{value}e300",
        misspelt(value, rng),
    ]
    if digits:
        k = one_of(digits, rng)
        ways.append(value[:k] + str(int(rng.integers(10))) + value[k + 1 :])
    return one_of(ways, rng)


def changed(arguments, keys, rng):
    """A command with one to three of its arguments changed, lost, doubled or added."""
    made = list(arguments)
    for _ in range(int(rng.choice([1, 1, 2, 3]))):
        if made and rng.random() < 0.35:
            k = int(rng.integers(len(made)))
            key, _, value = made[k].partition("=")
            way = int(rng.integers(6))
            if way == 0:
                made[k] = f"{key}={near(value, rng)}"
            elif way == 1:
                made[k] = f"{misspelt(key, rng)}={value}"
            elif way == 2:
                made.append(made[k])
            elif way == 3:
                made[k] = one_of(["~", "+", "++", "-", "--", "@", "="], rng) + made[k]
            elif way == 4:
                made[k] = key
            else:
                made[k] = f"{key}={one_of(VALUES, rng)}"
        else:
            key = one_of(keys, rng)
            form = one_of(["{}={}"] * 8 + ["~{}", "+{}={}", "++{}={}", "{}.x={}", "{}@x={}"], rng)
            made.append(form.format(key, one_of(VALUES, rng)))
    return made


def keys_of(arguments):
    """Every key that a command's configuration has, and the groups."""
    from hydra import compose
    from omegaconf import OmegaConf

    from tractexp.configuration.composition import list_leaves
    from tractexp.configuration.overrides import quote_overrides

    whole = OmegaConf.to_container(compose("config", quote_overrides(arguments)))
    keys = [key for key, _ in list_leaves(whole)]
    sections = sorted({key.rpartition(".")[0] for key in keys} - {""})
    groups = [
        "optimizer",
        "data",
        "objective",
        "model",
        "model/motor",
        "model/static",
        "task",
        "domain",
        "experiment",
    ]
    return [*keys, *keys, *sections, *groups, "model.bounds.C", "model.fixed.T_m", "data.columns.U"]


def perform(arguments, folder):
    """What a command does until its search has begun; "" or what it was found to be."""
    from hydra import compose
    from omegaconf import OmegaConf, open_dict

    from tractexp.api.job import Job
    from tractexp.cli.chosen import collect_chosen_settings, refuse_unread
    from tractexp.configuration.overrides import quote_overrides
    from tractexp.configuration.plugin import build
    from tractexp.configuration.refusal import explain_errors
    from tractexp.configuration.schema import check

    with explain_errors():
        config = compose("config", quote_overrides(arguments), return_hydra_config=True)
        choices, told = dict(config.hydra.runtime.choices), list(config.hydra.overrides.task)
        with open_dict(config):
            del config["hydra"]
        plain = OmegaConf.to_container(config, resolve=True)
        job = Job(plain, choices, folder, given=collect_chosen_settings(told, choices))
        check(job.config)
        task = build("task", job.config["task"])
        refuse_unread(task, job.given, task.needless())
        if task.name == "identify":
            from tractexp.api.arguments import Choice
            from tractexp.api.setup import Setup
            from tractexp.identification.search import Limits, search

            asked = {key: job.config[key] for key in ("budget", "time_limit", "target")}
            setup = Setup.from_arguments(
                job.events.train,
                job.config["model"],
                job.events.validate,
                job.config["objective"],
                **asked,
            )
            optimizer = Choice.from_argument("optimizer", job.config["optimizer"]).build(
                "optimizer"
            )
            search(setup.problem, optimizer, job.seed, Limits(60, 5.0, job.config["target"]))


def read(path):
    """The table, with the sidecar beside it."""
    tractexp.read(str(path))


def outcome(call, *given):
    """(kind, words) of a call: how it ended, and what was said."""

    def late(*_):
        raise Hung

    signal.signal(signal.SIGPROF, late)
    # of this process: other work on the machine does not count
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    signal.signal(signal.SIGALRM, late)
    # what waits for something takes no time of its own
    signal.setitimer(signal.ITIMER_REAL, 60 * SECONDS)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            call(*given)
            return "works", ""
        except UserError as error:
            words = str(error)
        except Hung:
            return "hang", traceback.format_exc()[-1500:]
        except MemoryError:
            words = ""  # told by the command itself, see tractexp/__main__.py
        except BaseException:
            return "traceback", traceback.format_exc()[-1500:]
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
            signal.setitimer(signal.ITIMER_REAL, 0)
    # a folder of random name may hold any characters of a leak
    words = words.replace(str(Path.cwd()), "…")
    for one in (
        (*map(str, given), *(str(each) for each in given[0])) if isinstance(given[0], list) else ()
    ):
        for part in {one, one.partition("=")[2], one.partition("=")[0]} - {""}:
            words = words.replace(part, "…") if len(part) > 3 else words
    return (
        "leak" if WORDS.search(words) else "several lines" if "\n" in words.strip() else "refused"
    ), str(words)


def nodes(told, where=()):
    """The places of all values within JSON."""
    yield where
    items = (
        told.items()
        if isinstance(told, dict)
        else enumerate(told)
        if isinstance(told, list)
        else ()
    )
    for key, inner in items:
        yield from nodes(inner, (*where, key))


def changed_sidecar(rng):
    """The bytes of a sidecar with one to three changes."""
    if rng.random() < 0.02:
        return one_of([DEEP, '{"base":' * 50_000, "[" * 100_000, '{"a":1' * 1000], rng).encode()
    told = copy.deepcopy(SIDECAR)
    for _ in range(int(rng.choice([1, 1, 2, 3]))):
        place = one_of([p for p in nodes(told) if p], rng)
        *above, last = place
        inner = told
        for key in above:
            inner = inner[key]
        way = int(rng.integers(6))
        if way < 3:
            inner[last] = copy.deepcopy(one_of(JSONS, rng))
        elif way == 3:
            del inner[last]
        elif way == 4 and isinstance(inner, dict):
            inner[misspelt(str(last), rng)] = inner.pop(last)
        else:
            inner[last] = [inner[last]] if rng.random() < 0.5 else {"a": inner[last]}
        if not told:
            break
    data = json.dumps(told, ensure_ascii=rng.random() < 0.5).encode()
    return one_of(DAMAGE, rng)(data, rng) if data and rng.random() < 0.4 else data


def made(count, seed, folder, first=0):
    """(what, call, given) of `count` mutants from number `first` on, each the same for the same
    seed: four of ten are commands.
    """
    path = table(folder)
    beside, sound = path.with_suffix(".json"), commands(path)
    keys = [keys_of(arguments) for arguments in sound]
    for k in range(first, first + count):
        rng = np.random.default_rng([seed, k])
        if k % 10 < 4:
            which = int(rng.integers(len(sound)))
            yield "configuration", perform, (changed(sound[which], keys[which], rng), folder)
        else:
            beside.write_bytes(changed_sidecar(rng))
            yield "sidecar", read, (path,)
            beside.unlink(missing_ok=True)


def prepared():
    """Let Hydra compose our configurations in this process; returns what ends it."""
    from hydra import initialize_config_dir
    from hydra.core.global_hydra import GlobalHydra

    from tractexp.sweep.hydra_groups import register

    register()
    GlobalHydra.instance().clear()
    initialize_config_dir(str(CONF), version_base="1.3")
    return GlobalHydra.instance().clear


def run(count, seed, first=0):
    counts = {"configuration": {}, "sidecar": {}}
    bad, worst = [], 0.0
    end = prepared()
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as base:
        os.chdir(base)
        try:
            for k, (what, call, given) in enumerate(made(count, seed, Path(base), first), first):
                started = time.process_time()
                kind, words = outcome(call, *given)
                worst = max(worst, time.process_time() - started)
                counts[what][kind] = counts[what].get(kind, 0) + 1
                if kind not in ("works", "refused"):
                    shown = (
                        given[0]
                        if call is perform
                        else Path(given[0])
                        .with_suffix(".json")
                        .read_bytes()
                        .decode(errors="replace")
                    )
                    bad.append(
                        {
                            "case": k,
                            "what": what,
                            "kind": kind,
                            "given": str(shown)[:600],
                            "words": words,
                        }
                    )
        finally:
            os.chdir(here)
            end()
    return {
        "cases": count,
        "seed": seed,
        "counts": counts,
        "worst": {"seconds": round(worst, 1)},
        "bad": bad,
    }


if __name__ == "__main__":
    sys.exit(command(run, __doc__, __file__))
