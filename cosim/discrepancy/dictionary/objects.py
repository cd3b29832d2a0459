"""Mean errors of size and position of all objects of a class.

The error of a single object is a random effect; the mean over a class is systematic. The derivative of the range with
respect to the position is the scaled surface normal in the object's axes; the derivative with respect to length, width
and height is this times the position of the hit on the object, relative to its size.
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
    """Yield the groups of size and position of each class of objects, three columns each."""
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
    """Derivatives (n, 3) of range by a shift along the axes of the object that is hit, and by its size [m/m]."""
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
