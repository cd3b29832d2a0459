"""Fault-tolerant execution of tasks in worker processes, on this machine or on a cluster."""

from cosim.engine.jobs import Do, Engine, Job, JobEvent, Skipped, Tell, WorkError
from cosim.engine.local import LocalEngine

__all__ = ["Do", "Engine", "Job", "JobEvent", "LocalEngine", "Skipped", "Tell", "WorkError"]
