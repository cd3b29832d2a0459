"""Effects with similar residuals, and the drive that would distinguish them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Confusion:
    """Two groups of effects.

    Attributes:
        one, other: names; the members of a group have the same confusions.
        why: reason for the similarity.
        remedy: what to measure.
    """

    one: tuple[str, ...]
    other: tuple[str, ...]
    why: str
    remedy: str

    def between(self, a: str, b: str) -> bool:
        """Whether it is about two effects."""
        return (a in self.one and b in self.other) or (b in self.one and a in self.other)


CONFUSIONS = (
    Confusion(
        ("mount_rotation", "suspension_pitch"),
        ("elevation_offset", "ring_elevation"),
        "A pitched sensor sees ahead what beams with another elevation see all round.",
        "Compare ahead with behind: pitch turns its sign, elevation does not. Keep the rear azimuths, on level ground.",
    ),
    Confusion(
        ("range_bias", "ring_range_offset"),
        ("mount_translation", "box_shrink"),
        "A constant range error and a shift along x agree on everything straight ahead; shifted labels do on objects.",
        "Look at walls on all sides: a shift is +x ahead and −x behind, a range error has one sign all round. "
        "Labels move only objects; the residuals of the map distinguish them.",
    ),
    Confusion(
        ("atmospheric_extinction", "range_falloff", "max_range"),
        ("focal_response", "receiver_focus", "ring_gain", "retroreflection"),
        "Intensity decreases with range, and materials occur at different ranges.",
        "Pass the same surface at several ranges, such as one sign at 10 m and 40 m: extinction is exponential in "
        "range, a focus has its peak at one distance, another reflectance keeps its ratio.",
    ),
    Confusion(
        ("atmospheric_extinction",),
        ("range_falloff", "max_range", "detection_threshold"),
        "Each dims or loses what is far.",
        "Pass one dark and one bright surface at 10, 40 and 80 m: extinction is a straight line in log intensity "
        "against range, for both.",
    ),
    Confusion(
        ("range_walk",),
        ("range_bias",),
        "Among materials that are all about as bright, a delay by intensity is the same delay everywhere.",
        "Record bright surfaces next to dark ones, such as signs and road markings: weak echoes' delay vanishes there.",
    ),
    Confusion(
        ("range_walk",),
        ("incidence_bias", "incidence_falloff"),
        "Slanted surfaces are dim ones, so a delay that grows as intensity falls looks like one that grows with slant.",
        "Record dark and bright materials at the same incidence angle: asphalt and marking, a dark and a white car.",
    ),
    Confusion(
        ("sweep_motion",),
        ("time_offset",),
        "Each shifts the world by velocity × time.",
        "Drive fast past things on all sides: a sweep's shift grows with azimuth from ahead and turns its sign there, "
        "a delay's is the same all round. A stop within the drive takes both away and leaves pose errors.",
    ),
    Confusion(
        ("suspension_pitch",),
        ("mount_rotation", "elevation_offset"),
        "A slope of the road that is missing in the map looks like a pitch of the vehicle.",
        "Pass the same place twice, once braking and once accelerating: the grade stays, pitch changes its sign.",
    ),
    Confusion(
        ("incidence_falloff",),
        ("range_falloff", "ring_gain"),
        "On flat ground range, ring and slant rise together.",
        "Have walls at many angles and ranges, such as a drive along a façade that is then passed head-on.",
    ),
    Confusion(
        ("encoder_eccentricity",),
        ("mount_rotation", "sweep_motion"),
        "A once-a-turn azimuth error resembles a small yaw or the skew of a turning vehicle.",
        "Have structure on all sides, at rest: a yaw is the same all round, an eccentricity a sine of azimuth.",
    ),
    Confusion(
        ("random_dropout",),
        ("detection_threshold", "max_range"),
        "Each loses returns.",
        "Record bright surfaces near and far: dropout affects all, a threshold only dim ones, a limit far ones.",
    ),
    Confusion(
        ("range_scale",),
        ("range_bias", "incidence_bias"),
        "Over few ranges a slope is an offset.",
        "Pass walls at 5 m and at 60 m: a scale error grows with range.",
    ),
)


def separations(a: str, b: str) -> tuple[Confusion, ...]:
    """Known ways to distinguish two effects."""
    return tuple(one for one in CONFUSIONS if one.between(a, b))
