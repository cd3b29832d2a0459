"""Recipes of towns, from which the builder makes SUMO files."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

TownStyle = Literal["village", "hamlet", "suburb", "urban", "industrial", "boulevard"]
Share = Annotated[float, Field(ge=0, le=1)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class GridLayout(_Part):
    """A grid of streets with randomly displaced junctions: `netgenerate --grid`."""

    kind: Literal["grid"] = "grid"
    columns: int = Field(default=6, ge=2, le=30, description="junctions from west to east")
    rows: int = Field(default=6, ge=2, le=30, description="junctions from south to north")
    spacing_m: float = Field(default=105.0, ge=40, le=400, description="mean distance of neighbouring junctions")
    jitter_m: float = Field(default=8.0, ge=0, le=40, description="standard deviation of a junction's displacement")

    def arguments(self) -> list[str]:
        """Return the command line of netgenerate."""
        arguments = ["--grid", "--grid.x-number", str(self.columns), "--grid.y-number", str(self.rows)]
        arguments += ["--grid.length", str(self.spacing_m)]
        if self.jitter_m > 0:
            jitter = f"normc(0,{self.jitter_m},{-2 * self.jitter_m},{2 * self.jitter_m})"
            arguments += ["--perturb-x", jitter, "--perturb-y", jitter]
        return arguments


class SpiderLayout(_Part):
    """Rings and radial streets: `netgenerate --spider`."""

    kind: Literal["spider"] = "spider"
    arms: int = Field(default=7, ge=3, le=24, description="radial streets")
    circles: int = Field(default=4, ge=1, le=12, description="ring streets")
    spacing_m: float = Field(default=80.0, ge=40, le=400, description="distance of neighbouring rings")

    def arguments(self) -> list[str]:
        """Return the command line of netgenerate."""
        arguments = ["--spider", "--spider.arm-number", str(self.arms)]
        arguments += ["--spider.circle-number", str(self.circles)]
        return [*arguments, "--spider.space-radius", str(self.spacing_m), "--spider.omit-center"]


class RandomLayout(_Part):
    """Random streets: `netgenerate --rand`."""

    kind: Literal["random"] = "random"
    iterations: int = Field(default=60, ge=5, le=2000, description="growth steps; more give a larger town")
    spacing_m: tuple[float, float] = Field(default=(70.0, 140.0), description="shortest and longest street")

    def arguments(self) -> list[str]:
        """Return the command line of netgenerate."""
        arguments = ["--rand", "--rand.iterations", str(self.iterations), "--rand.grid"]
        arguments += ["--rand.min-distance", str(self.spacing_m[0])]
        return [*arguments, "--rand.max-distance", str(self.spacing_m[1]), "--bidi-probability", "1"]


class RingRoadLayout(_Part):
    """A web of streets inside a fast ring road; arms are numbered counter-clockwise from east."""

    kind: Literal["ring_road"] = "ring_road"
    arms: int = Field(default=8, ge=3, le=20, description="radial streets of the web")
    circles_m: tuple[float, ...] = Field(
        default=(55.0, 115.0, 175.0), min_length=1, description="radii of the web's ring streets [m], inside out"
    )
    radius_m: float = Field(default=270.0, ge=120, le=2000, description="radius of the ring road's middle line [m]")
    lanes: int = Field(default=2, ge=1, le=4, description="driving lanes of each carriageway")
    median_m: float = Field(default=6.0, ge=1, le=40, description="distance of the two carriageways [m]")
    speed_kmh: float = Field(default=80.0, ge=40, le=130, description="speed limit on the ring road [km/h]")
    gates: tuple[int, ...] = Field(default=(0, 4), description="arms that meet the ring road at traffic lights")
    ramps: tuple[int, ...] = Field(default=(2, 6), description="arms that join the inner carriageway by ramps")
    services: tuple[int, ...] = Field(default=(2, 6), description="arms at which the outer one has a service road")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        unknown = sorted({*self.gates, *self.ramps, *self.services} - set(range(self.arms)))
        if unknown:
            raise ValueError(f"arm {unknown[0]} does not exist; number arms from 0 to {self.arms - 1}")
        both = sorted(set(self.gates) & {*self.ramps, *self.services})
        if both:
            raise ValueError(f"arm {both[0]} has a gate and ramps; choose one of them")
        if list(self.circles_m) != sorted(set(self.circles_m)) or self.circles_m[-1] > self.radius_m - 75:
            raise ValueError(f"circles_m {self.circles_m} must grow and end 75 m within radius_m {self.radius_m:g}")
        return self


class Relief(_Part):
    """Relief of the ground."""

    range_m: float = Field(default=7.0, ge=0, le=200, description="lowest to highest point of the town")
    waves: int = Field(default=5, ge=1, le=20, description="sinusoids summed")
    wavelength_m: tuple[float, float] = Field(default=(500.0, 1000.0), description="shortest and longest of them")
    max_grade: float = Field(default=0.065, gt=0, le=0.15, description="steepest ground allowed, rise over run")


class StreetRules(_Part):
    """Cross sections and furniture of the streets."""

    dropped: Share = Field(default=0.25, description="share of the layout's streets left out")
    bend_m: float = Field(default=6.0, ge=0, le=30, description="largest sideways bow of a local street")
    main_routes: int = Field(default=2, ge=0, le=8, description="main streets that cross the town")
    main_lanes: int = Field(default=2, ge=1, le=4, description="driving lanes per direction of a main street")
    widened: int = Field(
        default=0, ge=0, le=50, description="longest stretches of one-lane main streets that have two lanes a direction"
    )
    main_speed_kmh: float = Field(default=50.0, ge=20, le=100, description="speed limit on main streets")
    local_speed_kmh: float = Field(default=30.0, ge=10, le=100, description="speed limit on local streets")
    lane_width_m: float = Field(default=3.2, ge=2.6, le=4.5, description="width of a driving lane")
    sidewalk_width_m: float = Field(default=2.2, ge=1.2, le=8, description="width of the sidewalk on each side")
    parking_width_m: float = Field(default=2.1, ge=2.0, le=3.0, description="width of the parking strip")
    parking_share: Share = Field(default=0.65, description="share of the sides of local streets with a parking strip")
    main_parking_share: Share = Field(
        default=0.0, description="share of the sides of main streets with a parking strip"
    )
    slanted_share: Share = Field(
        default=0.0, description="share of the parking strips of local streets with slanted bays for cars"
    )
    slanted_deg: float = Field(default=60.0, ge=30, le=90, description="angle between slanted bays and the street")
    median_m: float = Field(
        default=0.0, ge=0, le=20, description="green between the two directions of a main street [m]"
    )
    roundabouts: int = Field(default=0, ge=0, le=20, description="busiest junctions made roundabouts, at most")
    roundabout_m: float = Field(default=13.0, ge=8, le=40, description="radius of a roundabout's island [m]")
    signal_share: Share = Field(
        default=0.4, description="share of four-armed main junctions with traffic lights; main crossings all have them"
    )
    stop_share: Share = Field(
        default=0.3, description="share of unsignalled main junctions with stop signs on side streets"
    )


class KindShares(_Part):
    """Relative frequencies of the kinds of vehicles on the move; they need not add up to 1."""

    car: float = Field(default=0.80, ge=0, allow_inf_nan=False, description="passenger cars")
    van: float = Field(default=0.08, ge=0, allow_inf_nan=False, description="vans")
    truck: float = Field(default=0.025, ge=0, allow_inf_nan=False, description="lorries")
    bus: float = Field(default=0.01, ge=0, allow_inf_nan=False, description="buses")
    motorcycle: float = Field(default=0.03, ge=0, allow_inf_nan=False, description="motorcycles with riders")
    cyclist: float = Field(default=0.055, ge=0, allow_inf_nan=False, description="bicycles with riders")

    @model_validator(mode="after")
    def _not_all_zero(self) -> Self:
        if sum(self.model_dump().values()) <= 0:
            raise ValueError("all shares are 0: give at least one kind a positive share")
        return self


class Demand(_Part):
    """Road users and their numbers."""

    driving: int = Field(default=100, ge=0, le=5000, description="vehicles on the move, bicycles among them")
    parked: int = Field(default=160, ge=0, le=5000, description="vehicles parked for the whole time")
    walking: int = Field(default=45, ge=0, le=5000, description="people on foot")
    trams: int = Field(default=0, ge=0, le=100, description="trams, in addition to these vehicles")
    kinds: KindShares = KindShares()
    fill_s: float = Field(default=40.0, gt=0, description="time over which the vehicles enter")
    duration_s: float = Field(default=1800.0, gt=0, description="time for which the population is kept up")


class Recipe(_Part):
    """Complete definition of a town. Equal recipes give the same files, byte for byte."""

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$", description="the town's name, and its files' stem")
    style: TownStyle = Field(default="suburb", description="what the buildings and greens look like")
    seed: int = Field(default=1, ge=0, description="of every random choice")
    layout: GridLayout | SpiderLayout | RandomLayout | RingRoadLayout = Field(
        default=GridLayout(), discriminator="kind"
    )
    relief: Relief = Relief()
    streets: StreetRules = StreetRules()
    tram_line: tuple[str, ...] = Field(
        default=(),
        description="junctions of a loop of tram tracks, in driving order; the tracks lie in the innermost lanes",
    )
    demand: Demand = Demand()
