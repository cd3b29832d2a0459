"""All kinds of unseen effects by name."""

from __future__ import annotations

from tests.hidden.unseen.echoes import ECHOES
from tests.hidden.unseen.kind import Kind
from tests.hidden.unseen.lasers import LASERS
from tests.hidden.unseen.objects import OBJECTS
from tests.hidden.unseen.pointing import POINTING
from tests.hidden.unseen.shapes import FORMS
from tests.hidden.unseen.shared import SHARED
from tests.hidden.unseen.signal import SIGNALS

FAULTS: dict[str, Kind] = {**POINTING, **SHARED, **LASERS, **SIGNALS, **ECHOES, **OBJECTS}
KINDS: dict[str, Kind] = {**FAULTS, **FORMS}
