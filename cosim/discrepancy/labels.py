"""What labels say, as a part of a diagnosis."""

from __future__ import annotations

from dataclasses import replace

from cosim.discrepancy.diagnosis import Diagnosis
from cosim.drives.kitti import Drive
from cosim.labels.bias import diagnose_labels
from sensors.effects.box_shrink import BoxShrink
from sensors.sensor_model import SensorModel


def with_labels(found: Diagnosis, drive: Drive) -> Diagnosis:
    """A diagnosis with its labels looked at; a missing label effect goes into the improved sensor.

    The verdict stays that of the points, unless these lack nothing.
    """
    if not any(drive[name].has("label_2") for name in drive.frames):
        return found
    labels = diagnose_labels(drive, found.sensor)
    if labels.effect is None:
        return replace(found, labels=labels)
    model = found.sensor
    others = tuple(one for one in model.effects if not isinstance(one, BoxShrink))
    sensor = SensorModel(model.pattern, (*others, labels.effect), model.origin)
    return replace(found, labels=labels, sensor=sensor)
