"""Trajectories from files: SUMO's FCD output, CommonRoad, OpenSCENARIO, and tables of many names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from assets.streets import Streets
from cosim.traffic.trajectories.commonroad import read_commonroad
from cosim.traffic.trajectories.fcd import read_fcd
from cosim.traffic.trajectories.on_streets import check_streets
from cosim.traffic.trajectories.openscenario import read_openscenario
from cosim.traffic.trajectories.table import read_table
from cosim.traffic.trajectories.tracks import RoadTracks, TrajectoryError
from sumo_nets.xml_guard import read_xml


def read_trajectories(path: Path, streets: Streets, type_files: Iterable[Path] = ()) -> RoadTracks:
    """Trajectories of a file, on the streets they belong to.

    Args:
        path: XML of SUMO's `--fcd-output`, of CommonRoad or of OpenSCENARIO, plain or gzipped; else a table, CSV.
        streets: give heights where the file has none.
        type_files: SUMO's files with the vTypes that FCD output names.

    Raises:
        TrajectoryError: the file cannot be read, has no road user, a track jumps, or most are not on the streets.
        TownError: it is no safe, whole XML.
    """
    if not path.is_file():
        raise TrajectoryError(
            f"trajectories {path}: no such file; give FCD output, CommonRoad, OpenSCENARIO or a table (CSV)"
        )
    left_out: Counter[str] = Counter()
    if path.name.removesuffix(".gz").endswith((".xml", ".xosc")):
        root = read_xml(path, "fcd-export", "commonRoad", "OpenSCENARIO")
        if root.tag == "fcd-export":
            tracks = read_fcd(path, root, type_files, left_out)
        elif root.tag == "OpenSCENARIO":
            tracks = read_openscenario(path, root, left_out)
        else:
            tracks = read_commonroad(path, root, left_out)
    else:
        tracks = read_table(path, type_files, left_out)
    if left_out:
        types = ", ".join(f"{count} of {name!r}" for name, count in sorted(left_out.items()))
        tracks = replace(tracks, notes=(*tracks.notes, f"{path}: left out, as they are no road users: {types}"))
    return check_streets(path, tracks, streets)
