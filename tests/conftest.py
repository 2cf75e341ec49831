from __future__ import annotations

from pathlib import Path

import pytest
from toys import toys

__all__ = ["measurements", "toys"]

REPOSITORY = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def measurements() -> Path:
    """Folder of real measurements; tests that need it are skipped where it is not at hand."""
    folder = REPOSITORY.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("no folder of real measurements beside the checkout")
    return folder
