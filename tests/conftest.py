"""Fixtures that several test files share."""

from pathlib import Path

import pytest

import tractexp  # noqa: F401  before NumPy: it keeps BLAS to one thread, as every command does

collect_ignore = ["acme"]  # a package of its own, whose tests run where it is installed


@pytest.fixture
def shared_data() -> Path:
    """The folder of real recordings beside the repository; they are not part of the project."""
    folder = Path(__file__).parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"real recordings are not beside the repository ({folder.name} folder absent)")
    return folder
