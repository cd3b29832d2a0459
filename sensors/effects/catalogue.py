"""All built-in effects of a LiDAR."""

from __future__ import annotations

from sensors.effects.angular_downsampling import AngularDownsampling
from sensors.effects.atmospheric_extinction import AtmosphericExtinction
from sensors.effects.backscatter import Backscatter
from sensors.effects.base import Effect
from sensors.effects.beam_divergence import BeamDivergence
from sensors.effects.blooming import Blooming
from sensors.effects.box_shrink import BoxShrink
from sensors.effects.detection_threshold import DetectionThreshold
from sensors.effects.detector_compression import DetectorCompression
from sensors.effects.dual_block import DualBlock
from sensors.effects.elevation_offset import ElevationOffset
from sensors.effects.encoder_eccentricity import EncoderEccentricity
from sensors.effects.false_alarms import FalseAlarms
from sensors.effects.few_points import FewPoints
from sensors.effects.focal_response import FocalResponse
from sensors.effects.glass_transmission import GlassTransmission
from sensors.effects.incidence_bias import IncidenceBias
from sensors.effects.incidence_falloff import IncidenceFalloff
from sensors.effects.intensity_cutoff import IntensityCutoff
from sensors.effects.intensity_floor import IntensityFloor
from sensors.effects.intensity_jitter import IntensityJitter
from sensors.effects.intensity_noise import IntensityNoise
from sensors.effects.intensity_quantization import IntensityQuantization
from sensors.effects.linear_falloff import LinearFalloff
from sensors.effects.max_range import MaxRange
from sensors.effects.mirror_ghost import MirrorGhost
from sensors.effects.mount_rotation import MountRotation
from sensors.effects.mount_translation import MountTranslation
from sensors.effects.own_shadow import OwnShadow
from sensors.effects.paint_gloss import PaintGloss
from sensors.effects.path_dropout import PathDropout
from sensors.effects.projected_intensity import ProjectedIntensity
from sensors.effects.pulse_detection import PulseDetection
from sensors.effects.random_dropout import RandomDropout
from sensors.effects.range_bias import RangeBias
from sensors.effects.range_falloff import RangeFalloff
from sensors.effects.range_noise import RangeNoise
from sensors.effects.range_quantization import RangeQuantization
from sensors.effects.range_scale import RangeScale
from sensors.effects.range_walk import RangeWalk
from sensors.effects.receiver_focus import ReceiverFocus
from sensors.effects.retroreflection import Retroreflection
from sensors.effects.ring_elevation import RingElevation
from sensors.effects.ring_gain import RingGain
from sensors.effects.ring_range_offset import RingRangeOffset
from sensors.effects.suspension_pitch import SuspensionPitch
from sensors.effects.sweep_motion import SweepMotion
from sensors.effects.time_offset import TimeOffset
from sensors.effects.wet_road import WetRoad

BUILT_IN: dict[str, type[Effect]] = {
    effect.name: effect
    for effect in sorted(
        (
            AngularDownsampling,
            AtmosphericExtinction,
            Backscatter,
            BeamDivergence,
            Blooming,
            BoxShrink,
            DetectionThreshold,
            DetectorCompression,
            DualBlock,
            ElevationOffset,
            EncoderEccentricity,
            FalseAlarms,
            FewPoints,
            FocalResponse,
            GlassTransmission,
            IncidenceBias,
            IncidenceFalloff,
            IntensityCutoff,
            IntensityFloor,
            IntensityJitter,
            IntensityNoise,
            IntensityQuantization,
            LinearFalloff,
            MaxRange,
            MirrorGhost,
            MountRotation,
            MountTranslation,
            OwnShadow,
            PaintGloss,
            PathDropout,
            ProjectedIntensity,
            PulseDetection,
            RandomDropout,
            RangeBias,
            RangeFalloff,
            RangeNoise,
            RangeQuantization,
            RangeScale,
            RangeWalk,
            ReceiverFocus,
            Retroreflection,
            RingElevation,
            RingGain,
            RingRangeOffset,
            SuspensionPitch,
            SweepMotion,
            TimeOffset,
            WetRoad,
        ),
        key=lambda effect: effect.phase,
    )
}
