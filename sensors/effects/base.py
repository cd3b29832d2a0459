"""Base classes of effects: validated parameters, the stage they act on, and effects they can be confused with."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, get_args, get_origin

import numpy as np
from annotated_types import Ge, Le
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from sensors.beams import Beams
from sensors.effects.phases import Channel, Phase, Stage
from sensors.label_boxes import LabelBoxes
from sensors.pattern import Pattern
from sensors.returns import Returns
from sensors.shot import Shot

_LIDAR_LIMBS = "https://github.com/PerCollECT/LidarLimbs/blob/HEAD/data"


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect, as `cosim effects` shows it and as fits need it.

    Attributes:
        name: key in a sensor file.
        unit: of its values; empty for pure numbers.
        low, high: bounds, or None where it has none.
        description: one sentence.
        per_ring: a list with one value a laser.
        choices: allowed words, for parameters that are no numbers.
        per_axis: a list with values for length, width and height; a single number applies to all three.
        is_table: a column of a table, with any number of rows.
    """

    name: str
    unit: str
    low: float | None
    high: float | None
    description: str
    per_ring: bool
    choices: tuple[str, ...] = ()
    per_axis: bool = False
    is_table: bool = False


class Effect(BaseModel):
    """One physical effect: frozen parameters and an equation. Subclass one of the stages below.

    Class attributes:
        name: key in sensor files.
        stage: what it acts on: beams, echoes, points, the whole scan or the labels.
        phase: when it acts.
        channel: the channel that it changes; `also`: further channels that it changes, too.
        equation: the equation, in one line.
        reference: source of the equation.
        taxonomy: its node in PerCollECT's LidarLimbs tree of causes and effects; empty where it has none.
        confusable_with: effects with similar residuals.
        needs_new_rays: cannot be made from stored hits.
        needs_camera: uses the frame's grayscale and depth image where they are at hand.
        has_texture: depends on a random field that is fixed to surfaces (`Shot.texture`).
        repeatable: whether a sensor file may have it more than once.
        example: parameters that show it.
        neutral: parameters that do nothing, the start of fits; None where there are none.
        shapes: values of shape parameters from which fits are started, as the amplitude does not determine them.
        is_candidate: whether a diagnosis tests it by default.
        by_search: whether its parameters are fitted one after the other, because each derivative requires new rays.
        sampled_to: by parameter, the relative error from sampling the equation: lower bound of its standard error.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    name: ClassVar[str]
    stage: ClassVar[Stage]
    phase: ClassVar[Phase]
    channel: ClassVar[Channel]
    also: ClassVar[tuple[Channel, ...]] = ()
    equation: ClassVar[str] = ""
    reference: ClassVar[str] = ""
    taxonomy: ClassVar[str] = ""
    confusable_with: ClassVar[tuple[str, ...]] = ()
    needs_new_rays: ClassVar[bool] = False
    needs_camera: ClassVar[bool] = False
    has_texture: ClassVar[bool] = False
    repeatable: ClassVar[bool] = False
    example: ClassVar[dict[str, Any]] = {}
    neutral: ClassVar[dict[str, Any] | None] = None
    shapes: ClassVar[tuple[dict[str, Any], ...]] = ()
    is_candidate: ClassVar[bool] = True
    by_search: ClassVar[bool] = False
    sampled_to: ClassVar[dict[str, float]] = {}
    source: ClassVar[str] = ""  # where a user's effect was loaded from, as sensor files name it

    def density(self, beam: np.ndarray, range_m: np.ndarray, shot: Shot) -> np.ndarray:
        """Probability per metre (k,) that it puts a return of `beam` (k,) at `range_m` (k,), with nothing in front."""
        return np.zeros(len(beam))

    @classmethod
    def taxonomy_link(cls) -> str:
        """Address of its node in LidarLimbs (Linnhoff et al., ITSC 2021); empty where it has none."""
        return f"{_LIDAR_LIMBS}/{cls.taxonomy}_node.xml" if cls.taxonomy else ""

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, values: Any) -> Any:
        """Set missing parameters to their neutral values if any parameter is given."""
        if isinstance(values, dict) and values and cls.neutral:
            return {**{name: value for name, value in cls.neutral.items() if name in cls.model_fields}, **values}
        return values

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """Its parameters in order."""
        return tuple(_parameter(name, info) for name, info in cls.model_fields.items())

    def check(self, pattern: Pattern) -> None:
        """Raise ValueError if the parameters do not fit the beam pattern."""
        for parameter in self.parameters():
            count = len(getattr(self, parameter.name)) if parameter.per_ring else pattern.rings
            if count not in (pattern.rings, 0):  # optional lists may be empty
                raise ValueError(
                    f"{parameter.name} has {count} entries but pattern {pattern.name} has {pattern.rings} lasers; "
                    "give one a laser"
                )


class BeamEffect(Effect):
    """Changes the beams before they are traced.

    Class attributes:
        needs_surfaces: `apply` uses the surfaces that the beams meet in the state in which it receives them; `shot`
            is traced then.
    """

    stage: ClassVar[Stage] = "beam"
    phase: ClassVar[Phase] = Phase.OWN_BEAM
    needs_new_rays: ClassVar[bool] = True
    needs_surfaces: ClassVar[bool] = False

    def apply(self, beams: Beams, shot: Shot, rng: np.random.Generator) -> Beams:
        """Return the changed beams; their number is unchanged."""
        raise NotImplementedError


class EchoEffect(Effect):
    """Determines which surfaces return an echo, its strength, and whether it is detected."""

    stage: ClassVar[Stage] = "echo"
    phase: ClassVar[Phase] = Phase.OWN_ECHO

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the changed returns; rows may be removed, or replaced by returns of other surfaces."""
        raise NotImplementedError

    def expected(self, returns: Returns, shot: Shot) -> tuple[Returns, np.ndarray]:
        """Return the expected returns, and the probability (m,) of each.

        Deterministic effects need only `apply`.
        """
        changed = self.apply(returns, shot, np.random.default_rng(0))
        return changed, np.ones(len(changed))

    def elsewhere(self, shot: Shot) -> np.ndarray | float:
        """Return the probability (n,) of each beam that another surface answers: the integral of `density`."""
        return 0.0


class DetectionEffect(EchoEffect):
    """Removes returns at random, independently."""

    def kept(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Return the probability (m,) that each return is detected."""
        raise NotImplementedError

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the detected returns."""
        return returns.take(shot.per_return(returns, rng.random((2, len(shot.rays)))) < self.kept(returns, shot))

    def expected(self, returns: Returns, shot: Shot) -> tuple[Returns, np.ndarray]:
        """Return all returns, and their probabilities."""
        return returns, self.kept(returns, shot)


class PointEffect(Effect):
    """Changes ranges and intensities of returns, but not their number."""

    stage: ClassVar[Stage] = "point"
    phase: ClassVar[Phase] = Phase.OWN_POINT

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the changed returns; their number is unchanged."""
        raise NotImplementedError


class NoiseEffect(PointEffect):
    """Adds zero-mean noise."""

    def spread(self, returns: Returns, shot: Shot) -> tuple[np.ndarray | float, np.ndarray | float]:
        """Standard deviations of range [m] and of intensity, (m,) or one for all."""
        raise NotImplementedError


class NoiseScaleEffect(PointEffect):
    """Multiplies the noise that all noise effects before it have added; it adds none of its own."""

    phase: ClassVar[Phase] = Phase.NOISE_SCALE

    def factors(self, returns: Returns, shot: Shot) -> tuple[np.ndarray | float, np.ndarray | float]:
        """Return the factors of the noise of range and of intensity, (m,) or one for all.

        Args:
            returns: without the noise.
            shot: of the revolution.
        """
        raise NotImplementedError

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the returns as they are: `acting` multiplies the noise."""
        return returns


class RoundingEffect(PointEffect):
    """Rounds values to multiples of a step."""

    phase: ClassVar[Phase] = Phase.ROUNDING

    @property
    def steps(self) -> tuple[float, float]:
        """Steps of range [m] and of intensity; 0 for what is not rounded."""
        raise NotImplementedError

    def rounded(self, range_m: np.ndarray, intensity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return rounded ranges and intensities of any shape; intensities are clipped to 0–1."""
        range_step_m, intensity_step = self.steps
        if range_step_m:
            range_m = np.rint(range_m / range_step_m) * range_step_m
        if intensity_step:
            intensity = np.minimum(np.rint(intensity / intensity_step) * intensity_step, 1)
        return range_m, intensity

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Rounded returns."""
        range_m, intensity = self.rounded(returns.range_m, returns.intensity)
        return replace(returns, range_m=range_m.astype(np.float32), intensity=intensity.astype(np.float32))


class ScanEffect(Effect):
    """Adds returns that come from no surface, or removes returns."""

    stage: ClassVar[Stage] = "scan"
    phase: ClassVar[Phase] = Phase.OWN_SCAN

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the changed returns, sorted by beam."""
        raise NotImplementedError

    def survival(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Return the probability (m,) that each return is not replaced."""
        return np.ones(len(returns))

    def silence(self, shot: Shot) -> np.ndarray:
        """Return the probability (n,) that a beam without a surface gets no return from this effect either."""
        return np.ones(len(shot.rays))


class LabelEffect(Effect):
    """Changes the labels of objects, not the points."""

    stage: ClassVar[Stage] = "label"
    phase: ClassVar[Phase] = Phase.OWN_LABEL
    channel: ClassVar[Channel] = "label"

    def apply(self, boxes: LabelBoxes, rng: np.random.Generator) -> LabelBoxes:
        """Return the changed boxes; the number is unchanged, boxes without a label are no longer `kept`."""
        raise NotImplementedError


def number(description: str, *, unit: str = "", ge: float | None = None, le: float | None = None) -> Any:
    """Declare a required number of an effect, with its unit and bounds."""
    return Field(description=description, ge=ge, le=le, json_schema_extra={"unit": unit})


def per_axis(low: float, high: float) -> Any:
    """Type of values for length, width and height within bounds; a single number is used for all three."""
    item = Annotated[float, Field(ge=low, le=high)]
    return Annotated[tuple[item, item, item], BeforeValidator(_for_all_axes)]


def _for_all_axes(value: object) -> object:
    return (value,) * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


def per_ring(description: str, *, unit: str = "") -> Any:
    """Declare a required list with one value per laser; bounds are in the item's type."""
    return Field(description=description, min_length=1, max_length=256, json_schema_extra={"unit": unit})


def laser_factors() -> Any:
    """Declare an optional list of factors, one per laser; bounds are in the item's type."""
    return Field(
        default=(),
        max_length=256,
        description="f, noise of each laser over σ, ring 0 first; none: 1",
        json_schema_extra={"unit": ""},
    )


def of_lasers(factors: tuple[float, ...], returns: Returns, shot: Shot) -> np.ndarray | float:
    """Factor of each return's laser, (m,) float32; 1 without factors."""
    return np.array(factors, np.float32)[shot.rays.ring[returns.beam]] if factors else 1.0


def bounded(low: float, high: float) -> Any:
    """Type of a list of numbers between two bounds."""
    return tuple[Annotated[float, Field(ge=low, le=high)], ...]


def _parameter(name: str, info: Any) -> Parameter:
    marks, annotation = list(info.metadata), info.annotation
    is_list = get_origin(annotation) is tuple
    axes = is_list and Ellipsis not in get_args(annotation)
    per_laser = is_list and not axes
    if is_list:
        item = get_args(annotation)[0]
        marks = [mark for field in get_args(item)[1:] for mark in field.metadata] if get_args(item) else []
    low: Any = next((m.ge for m in marks if isinstance(m, Ge)), None)
    high: Any = next((m.le for m in marks if isinstance(m, Le)), None)
    words = get_args(annotation) if annotation is not None and not is_list else ()
    unit = str((info.json_schema_extra or {}).get("unit", ""))
    choices = tuple(str(word) for word in words)
    return Parameter(name, unit, low, high, info.description or "", per_laser, choices, axes)
