"""What `import cosim` offers is there, and is what its home calls so."""

from __future__ import annotations

import pytest

import cosim


@pytest.mark.parametrize("name", cosim.__all__)
def test_every_name_leads_to_something_called_so(name):
    found = getattr(cosim, name)
    assert found.__name__ == name and found.__module__.startswith("cosim.")
    assert name in dir(cosim)


def test_a_name_that_is_not_there_is_said_so():
    with pytest.raises(AttributeError, match="no attribute 'Driver'"):
        _ = cosim.Driver
