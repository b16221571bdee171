"""The configuration that lies beside the results of a run, in `.hydra`: never beside those of
another.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tractexp.configuration.composition import list_texts


def list_contents(config: Any) -> Mapping[str, str]:
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


def list_named_files(config: Any) -> frozenset[Path]:
    """The files that a configuration, as plain data, may name and the run reads."""
    return frozenset(Path(text).absolute() for text in list_texts(config) if "\0" not in text)
