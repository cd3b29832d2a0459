"""The streets that trajectories are replayed on."""

import pytest

from sumo_nets import Town, read_town


@pytest.fixture(scope="session")
def hamlet(hamlet_config) -> Town:
    return read_town(hamlet_config.parent / "town")
