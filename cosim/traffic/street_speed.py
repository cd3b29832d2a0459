"""Streets whose limits are multiplied by a factor."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field


class StreetSpeed(BaseModel):
    """Streets on which all vehicles drive slower or faster than the speed limit suggests."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    edges: tuple[str, ...] = Field(min_length=1, description="SUMO's edge ids")
    factor: float = Field(gt=0.1, lt=5, description="factor of the limits of their lanes [1]")
