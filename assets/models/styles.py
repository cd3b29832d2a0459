"""Body styles: the lines that each style, such as hatchback or saloon, is drawn with.

Lines are control points (distance behind the nose / length, height / overall height), seen from the side.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from assets.models.catalogue import Body, ModelSpec

Line = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class BodyStyle:
    """Side-view lines and plan shape of one body.

    Attributes:
        crest: upper edge of the flanks: bonnet edge, A-pillar, cantrail, tailgate edge.
        belt: lower edge of the side windows, and the shoulder line ahead of and behind them.
        windscreen: start and end along the crest.
        backlight: start and end of the rear window along the crest; equal ends leave it out.
        panes: start and end of each side window; the gaps are the pillars.
        bulkhead: start of the cargo room of a panel van, or 1 where seats fill the cabin.
        nose: length (m) and superellipse exponent of the rounding of the front in plan.
        tail: the same for the rear.
        tumblehome: inward lean of the side windows, metres a metre.
        crown_m: rise of the roof from its edge to the centre line.
        clearance_m: height of the underbody.
        wheel_radius_share: outer radius of the tyres as a share of the wheelbase.
        cladding: unpainted sills and arches.
    """

    crest: Line
    belt: Line
    windscreen: tuple[float, float]
    backlight: tuple[float, float]
    panes: Line
    bulkhead: float = 1.0
    nose: tuple[float, float] = (0.62, 2.7)
    tail: tuple[float, float] = (0.42, 3.0)
    tumblehome: float = 0.24
    crown_m: float = 0.055
    clearance_m: float = 0.18
    wheel_radius_share: float = 0.122
    cladding: bool = False

    def wheel_radius_m(self, spec: ModelSpec) -> float:
        """Outer radius of the tyres for a body of the dimensions of `spec`."""
        return self.wheel_radius_share * spec.wheelbase_m


_HATCHBACK = BodyStyle(
    crest=((0, 0.50), (0.06, 0.55), (0.15, 0.60), (0.245, 0.645), (0.33, 0.78), (0.43, 0.915), (0.55, 0.962),
           (0.70, 0.955), (0.84, 0.925), (0.91, 0.89), (0.945, 0.78), (0.972, 0.675), (1.0, 0.64)),
    belt=((0, 0.475), (0.08, 0.53), (0.22, 0.60), (0.35, 0.615), (0.70, 0.635), (0.92, 0.65), (1.0, 0.60)),
    windscreen=(0.252, 0.425),
    backlight=(0.915, 0.966),
    panes=((0.315, 0.545), (0.568, 0.77), (0.795, 0.875)),
)  # fmt: skip
_SALOON = BodyStyle(
    crest=((0, 0.50), (0.06, 0.55), (0.15, 0.595), (0.265, 0.645), (0.34, 0.77), (0.425, 0.905), (0.54, 0.962),
           (0.64, 0.95), (0.71, 0.90), (0.775, 0.80), (0.845, 0.695), (0.92, 0.685), (0.985, 0.675), (1.0, 0.66)),
    belt=((0, 0.475), (0.08, 0.53), (0.22, 0.60), (0.35, 0.625), (0.70, 0.65), (0.90, 0.645), (1.0, 0.605)),
    windscreen=(0.272, 0.418),
    backlight=(0.705, 0.835),
    panes=((0.325, 0.515), (0.535, 0.685), (0.70, 0.752)),
    tail=(0.50, 2.9),
)  # fmt: skip
_ESTATE = BodyStyle(
    crest=((0, 0.49), (0.06, 0.54), (0.15, 0.585), (0.255, 0.635), (0.33, 0.77), (0.415, 0.905), (0.53, 0.957),
           (0.70, 0.955), (0.86, 0.93), (0.915, 0.90), (0.945, 0.79), (0.975, 0.67), (1.0, 0.635)),
    belt=((0, 0.465), (0.08, 0.52), (0.22, 0.59), (0.35, 0.61), (0.70, 0.635), (0.92, 0.64), (1.0, 0.595)),
    windscreen=(0.262, 0.41),
    backlight=(0.918, 0.968),
    panes=((0.315, 0.49), (0.51, 0.67), (0.695, 0.885)),
)  # fmt: skip
_SUV = BodyStyle(
    crest=((0, 0.53), (0.05, 0.58), (0.14, 0.615), (0.25, 0.65), (0.325, 0.79), (0.405, 0.918), (0.53, 0.963),
           (0.70, 0.96), (0.86, 0.935), (0.915, 0.905), (0.945, 0.79), (0.972, 0.675), (1.0, 0.63)),
    belt=((0, 0.50), (0.07, 0.56), (0.22, 0.605), (0.35, 0.625), (0.70, 0.64), (0.92, 0.645), (1.0, 0.59)),
    windscreen=(0.257, 0.40),
    backlight=(0.918, 0.966),
    panes=((0.31, 0.50), (0.522, 0.70), (0.725, 0.875)),
    nose=(0.58, 3.0),
    tail=(0.40, 3.2),
    tumblehome=0.20,
    clearance_m=0.22,
    wheel_radius_share=0.137,
    cladding=True,
)  # fmt: skip
_VAN = BodyStyle(
    crest=((0, 0.40), (0.05, 0.45), (0.12, 0.495), (0.185, 0.54), (0.25, 0.71), (0.32, 0.885), (0.40, 0.955),
           (0.60, 0.968), (0.85, 0.965), (0.955, 0.945), (0.972, 0.78), (0.985, 0.56), (1.0, 0.50)),
    belt=((0, 0.375), (0.07, 0.43), (0.17, 0.505), (0.30, 0.52), (0.70, 0.52), (0.95, 0.52), (1.0, 0.46)),
    windscreen=(0.19, 0.325),
    backlight=(0.957, 0.981),
    panes=((0.245, 0.40), (0.425, 0.655), (0.685, 0.91)),
    nose=(0.62, 2.8),
    tail=(0.28, 4.0),
    tumblehome=0.13,
    crown_m=0.06,
    clearance_m=0.20,
    wheel_radius_share=0.106,
)  # fmt: skip

STYLES: dict[Body, tuple[BodyStyle, ...]] = {
    "hatchback": (
        _HATCHBACK,
        replace(
            _HATCHBACK,
            crest=((0, 0.48), (0.06, 0.53), (0.16, 0.585), (0.265, 0.64), (0.35, 0.77), (0.45, 0.91),
                   (0.57, 0.962), (0.70, 0.945), (0.80, 0.90), (0.87, 0.845), (0.92, 0.765), (0.965, 0.685),
                   (1.0, 0.645)),
            windscreen=(0.272, 0.445),
            backlight=(0.85, 0.955),
            panes=((0.335, 0.565), (0.59, 0.80)),
            nose=(0.70, 2.5),
        ),
    ),
    "saloon": (
        _SALOON,
        replace(
            _SALOON,
            crest=((0, 0.49), (0.06, 0.545), (0.15, 0.60), (0.28, 0.655), (0.35, 0.775), (0.43, 0.905),
                   (0.53, 0.962), (0.62, 0.955), (0.69, 0.92), (0.745, 0.82), (0.80, 0.705), (0.90, 0.70),
                   (0.985, 0.69), (1.0, 0.67)),
            windscreen=(0.287, 0.423),
            backlight=(0.692, 0.793),
            panes=((0.335, 0.505), (0.525, 0.69)),
            nose=(0.66, 3.1),
        ),
    ),
    "estate": (
        _ESTATE,
        replace(
            _ESTATE,
            crest=((0, 0.50), (0.06, 0.55), (0.15, 0.60), (0.27, 0.65), (0.345, 0.78), (0.43, 0.91),
                   (0.54, 0.96), (0.70, 0.94), (0.82, 0.90), (0.88, 0.865), (0.93, 0.77), (0.97, 0.68), (1.0, 0.64)),
            windscreen=(0.277, 0.425),
            backlight=(0.885, 0.96),
            panes=((0.33, 0.505), (0.525, 0.68), (0.705, 0.83)),
        ),
    ),
    "suv": (
        _SUV,
        replace(
            _SUV,
            crest=((0, 0.55), (0.045, 0.61), (0.14, 0.635), (0.25, 0.655), (0.31, 0.80), (0.37, 0.925),
                   (0.48, 0.962), (0.72, 0.962), (0.90, 0.945), (0.935, 0.91), (0.952, 0.79), (0.972, 0.66),
                   (1.0, 0.62)),
            windscreen=(0.256, 0.367),
            backlight=(0.937, 0.968),
            panes=((0.30, 0.485), (0.507, 0.69), (0.715, 0.905)),
            nose=(0.50, 3.6),
            tail=(0.34, 3.8),
            tumblehome=0.15,
        ),
    ),
    "van": (
        replace(_VAN, panes=((0.245, 0.40),), backlight=(0.957, 0.957), bulkhead=0.43),
        replace(_VAN, crown_m=0.07),
    ),
}  # fmt: skip
