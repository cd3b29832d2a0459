import pytest

from sumo_nets import Town, read_town


@pytest.fixture(scope="session")
def town() -> Town:
    return read_town("town01")
