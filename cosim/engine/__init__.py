"""Fault-tolerant execution of tasks in worker processes, on this machine or on a cluster."""

from cosim.engine.jobs import Do, Engine, Event, Job, Skipped, Tell, WorkError
from cosim.engine.local import LocalEngine

__all__ = ["Do", "Engine", "Event", "Job", "LocalEngine", "Skipped", "Tell", "WorkError"]
