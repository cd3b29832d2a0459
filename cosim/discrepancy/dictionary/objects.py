"""Mean errors of size and place that all objects of a class share.

A random effect of an object is noise; its mean over a class is not. The direction towards the sensor in the axes of the
object, times the position on the object relative to its size, gives the change of range by a change of length, width
and height; the direction alone that by a change of place.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import sparse

from cosim.discrepancy.dictionary.groups import Group, basis_group
from cosim.discrepancy.dictionary.linearisation import Linearisation

AXES = ("length", "width", "height")
PLACES = ("ahead", "left", "up")


def object_groups(linearisation: Linearisation) -> Iterator[Group]:
    """Size and place of each class of objects, three columns each."""
    sample = linearisation.sample
    along, size = object_directions(linearisation)
    _, information = linearisation.weights("range")
    for code, kind in enumerate(sample.kinds):
        rows = np.flatnonzero((sample.kind == code) & (information > 0)) if code else np.zeros(0, int)
        if len(rows) < sample.settings.dictionary.fewest_in_bin:
            continue
        for what, values in (("object_size", size), ("object_place", along)):
            places = np.repeat(rows, 3), np.tile(np.arange(3), len(rows))
            basis = sparse.csr_matrix((values[rows].ravel(), places), (len(sample), 3))
            name = f"range by {kind} {what.removeprefix('object_')}"
            yield basis_group(linearisation, "range", name, ("kind", what), basis)


def object_directions(linearisation: Linearisation) -> tuple[np.ndarray, np.ndarray]:
    """Change of range (n, 3) by a shift along the axes of the object that is met, and by a change of its size [m/m]."""
    sample = linearisation.sample
    along, size = np.zeros((len(sample), 3)), np.zeros((len(sample), 3))
    for number, frame in enumerate(linearisation.frames):
        rows = np.flatnonzero((sample.frame == number) & (sample.instance >= 0))
        if not len(rows):
            continue
        which = sample.instance[rows]
        pose, extent = frame.instances.poses[which], frame.instances.sizes[which]
        axes = pose[:, :3, :3]
        toward = sample.object_derivative[rows, :3]
        relative = np.einsum("nij,ni->nj", axes, sample.place[rows] - pose[:, :3, 3])
        along[rows] = np.einsum("nij,ni->nj", axes, toward)
        size[rows] = along[rows] * relative / np.maximum(extent, 1e-3)
    return along, size
