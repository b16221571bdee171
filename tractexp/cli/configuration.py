"""The configuration that lies beside the results of a run, in `.hydra`: never beside those of another.

A folder that holds an earlier run keeps it whole until this run has a result: only then do the old results go, and this
run's configuration takes the place of theirs. A run that is refused or killed before leaves the folder as it was.
"""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from tractexp import files
from tractexp.composition import texts

FOLDER, NEXT = ".hydra", ".hydra.next"
KINDS = (
    "discrepancy", "generalise", "linear_network", "posterior", "plan", "profile", "survey", "benchmark", "comparison",
    "paper",
)  # fmt: skip
RESULTS = (
    "result.json", "history.csv", "interrupted.json", "report.html", "posterior.npz", "unexplained.csv", "survey.csv",
    "survey.parquet", "paper.md", "mlflow.json",
    *(f"{kind}{ending}" for kind in KINDS for ending in (".json", ".html")),
)  # fmt: skip


def written(folder: Path, config: Any) -> Callable[[], None]:
    """Write a composed configuration into a run's folder; what gives it its place once the run has a result.

    Raises `UserError` where the folder cannot be written to.
    """
    from omegaconf import OmegaConf

    earlier = any((folder / name).exists() for name in (FOLDER, *RESULTS))
    for name, content in _contents(config).items():
        files.write(folder / (NEXT if earlier else FOLDER) / name, content, lasting=False)
    return lambda: _begun(folder, OmegaConf.to_container(config, resolve=True))


def concluded(folder: Path) -> None:
    """What a task leaves that writes files for others, but no result: results that are there keep their own."""
    if any((folder / name).exists() for name in RESULTS):
        shutil.rmtree(folder / NEXT, ignore_errors=True)
    else:
        _placed(folder)


def removed(folder: Path) -> None:
    """Remove the configuration of a run that was refused: with the folder, where it holds nothing else."""
    shutil.rmtree(folder / NEXT, ignore_errors=True)
    if {p.name for p in folder.iterdir()} <= {FOLDER}:
        shutil.rmtree(folder)


def _contents(config: Any) -> Mapping[str, str]:
    """The files that Hydra writes of a job, by their names."""
    from hydra.core.hydra_config import HydraConfig
    from omegaconf import OmegaConf

    whole: Any = HydraConfig.instance().cfg
    around = OmegaConf.masked_copy(whole, "hydra")
    return {
        "config.yaml": OmegaConf.to_yaml(config),
        "hydra.yaml": OmegaConf.to_yaml(around),
        "overrides.yaml": OmegaConf.to_yaml(whole.hydra.overrides.task),
    }


def _begun(folder: Path, config: Any) -> None:
    """Let the results of an earlier run go, but for those that this one was made from, and its configuration."""
    read = {Path(text).absolute() for text in texts(config)}
    if (folder / NEXT).exists() and (folder / FOLDER).exists():
        for path in (folder / name for name in RESULTS):
            if path.absolute() not in read:
                path.unlink(missing_ok=True)
    _placed(folder)


def _placed(folder: Path) -> None:
    if (folder / NEXT).exists():
        shutil.rmtree(folder / FOLDER, ignore_errors=True)
        files.move(folder / NEXT, folder / FOLDER)
