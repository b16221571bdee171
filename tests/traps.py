"""Modules that lie beside records, and say when somebody imports them."""

from pathlib import Path

TRAPS = (
    "mlflow",
    "numpy",
    "pickle",
    "yaml",
    "joblib",
    "hydra",
    "json",
    "typing_extensions",
    "uvicorn",
    "tempfile",
)
TRAP = "open('trapped', 'a').write(__name__ + ' ')\nraise ImportError(__name__)\n"


def lay_traps(folder: Path) -> None:
    """Write the modules; who imports one of them in this folder leaves a file `trapped`."""
    for name in TRAPS:
        (folder / f"{name}.py").write_text(TRAP)
