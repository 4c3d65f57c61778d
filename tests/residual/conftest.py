"""Makes ``synthetic`` importable from the tests of the residual room; fewer folds."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from greybed.residual import holdout

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def three_folds(monkeypatch):
    """Held-out rows in three folds instead of ten."""
    monkeypatch.setattr(holdout, "ROW_FOLDS", 3)
