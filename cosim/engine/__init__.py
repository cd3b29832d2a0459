"""Work shared out among processes, of this machine or of a cluster, that may die or hang without harm."""

from cosim.engine.jobs import Do, Engine, Event, Job, Skipped, Tell, WorkError
from cosim.engine.local import LocalEngine

__all__ = ["Do", "Engine", "Event", "Job", "LocalEngine", "Skipped", "Tell", "WorkError"]
