"""Phases of fixed-time traffic lights, estimated from when vehicles enter junctions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from cosim.driver_discrepancy.network import Network, SignalProgram
from cosim.driver_discrepancy.placed import Placed

_FEWEST_ENTRIES = 6
_BETTER = 0.06  # share of entries at green by which another phase must be better than that of the network's clock
_SLOW_MPS = 3.0  # vehicles entering more slowly have waited for green
_WAITED = 0.004  # penalty per second between the start of green and the entry of waiting vehicles


@dataclass(frozen=True)
class Phases:
    """Programs with the offsets of the recording's clock.

    Attributes:
        programs: traffic light → program; time counts as in the recording.
        notes: how they were found.
    """

    programs: Mapping[str, SignalProgram]
    notes: tuple[str, ...]

    def red(self, placed: Placed, shift_s: float = 0.0) -> np.ndarray:
        """Whether the link ahead shows red (n,); that which is taken at the next sample, or else all of the lane.

        Args:
            placed: trajectories.
            shift_s: their clock less that of the programs [s].
        """
        found = np.zeros(len(placed.tracks), bool)
        time_s = placed.tracks.time_s - shift_s
        for code, lane in enumerate(placed.lanes):
            links = [link for link in placed.network.links.get(lane, ()) if link.signal in self.programs]
            if not links:
                continue
            rows = np.flatnonzero(placed.code == code)
            states = [is_red(self.programs[link.signal], link.index, time_s[rows]) for link in links]
            found[rows] = np.all(states, axis=0)
            after = np.minimum(rows + 1, len(found) - 1)
            for link, state in zip(links, states, strict=True):
                if link.via in placed.lanes:
                    taken = placed.code[after] == placed.lanes.index(link.via)
                    found[rows[taken]] = state[taken]
        return found

    def signalled(self, network: Network) -> frozenset[str]:
        """Lanes that end at a light with a known program."""
        return frozenset(
            lane for lane, links in network.links.items() if any(link.signal in self.programs for link in links)
        )


def is_red(program: SignalProgram, index: int, time_s: np.ndarray) -> np.ndarray:
    """Whether a link of a program shows red at some times."""
    ends = np.cumsum(program.durations_s)
    phase = np.searchsorted(ends, np.mod(time_s - program.offset_s, ends[-1]), side="right")
    red = np.array([state[index : index + 1] in ("r", "u", "s") for state in program.states], bool)
    return red[np.minimum(phase, len(red) - 1)]


def estimate_phases(placed: Placed) -> Phases:
    """Find the offset between the recording's clock and the network's programs.

    One offset for all lights is tried first (another clock), then single lights whose vehicles still enter at red.
    """
    programs = placed.network.programs
    entries = _entries(placed)
    usable = {name: entries[name] for name in programs if name in entries}
    if not programs:
        return Phases({}, ("the network has actuated lights only: their phases are left out",) * bool(entries))
    total = sum(len(found) for found in usable.values())
    if total < _FEWEST_ENTRIES:
        few = f"{total} vehicles enter junctions with lights: phases are those of the network, and cannot be checked"
        return Phases(programs, (few,) * bool(usable))
    longest = max(programs[name].cycle_s for name in usable)
    shifts = np.arange(0.0, longest, 1.0)
    scores = sum((_scores(programs[name], found, shifts) * len(found) for name, found in usable.items()), np.zeros(1))
    best = int(np.argmax(scores))
    notes, common = [], 0.0
    if scores[best] - scores[0] > _BETTER * total:
        common = float(shifts[best])
        notes.append(f"the clock of the traffic lights differs from the network's by {common:.0f} s, estimated")
    chosen = {name: _shifted(program, common) for name, program in programs.items()}
    own = 0
    for name, found in usable.items():
        if len(found) < _FEWEST_ENTRIES:
            continue
        offsets = np.arange(0.0, programs[name].cycle_s, 1.0)
        values = _scores(chosen[name], found, offsets)
        if values.max() - values[0] > 3 * _BETTER:
            chosen[name] = _shifted(chosen[name], float(offsets[int(np.argmax(values))]))
            own += 1
    if own:
        notes.append(f"the phases of {own} of {len(programs)} traffic lights were estimated one by one")
    return Phases(chosen, tuple(notes))


def _shifted(program: SignalProgram, shift_s: float) -> SignalProgram:
    return replace(program, offset_s=program.offset_s + shift_s)


def _scores(program: SignalProgram, entries: np.ndarray, shifts_s: np.ndarray) -> np.ndarray:
    """Share of entries not at red with the program shifted, less a penalty for queues that start long after green.

    Args:
        program: of the light.
        entries: (m, 3) from `_entries`.
        shifts_s: (k,) tried.
    """
    score = np.zeros(len(shifts_s))
    for index in np.unique(entries[:, 0]):
        own = entries[entries[:, 0] == index]
        times = own[:, 1] - shifts_s[:, None]
        green = ~is_red(program, int(index), times)
        waited = green & (own[:, 2] < _SLOW_MPS)
        score += green.sum(1) - _WAITED * (_since_green(program, int(index), times) * waited).sum(1)
    return score / len(entries)


def _since_green(program: SignalProgram, index: int, times: np.ndarray) -> np.ndarray:
    """Seconds since a link's light became green, rounded down, at most 20; the shape is that of the times."""
    since = np.zeros(times.shape)
    still = np.ones(times.shape, bool)
    for back in range(1, 21):
        still &= ~is_red(program, index, times - back)
        since[still] = back
    return since


def _entries(placed: Placed) -> dict[str, np.ndarray]:
    """Traffic light → (m, 3) link index, time [s] and speed [m/s] of every entry into its junction."""
    ways = {
        link.via: (link.signal, link.index)
        for links in placed.network.links.values()
        for link in links
        if link.signal and link.via
    }
    tracks = placed.tracks
    rows = np.flatnonzero((np.diff(tracks.vehicle) == 0) & (np.diff(placed.code) != 0)) + 1
    found: dict[str, list[tuple[float, float, float]]] = {}
    for row in rows.tolist():
        way = ways.get(placed.lanes[placed.code[row]])
        if way:
            found.setdefault(way[0], []).append((way[1], float(tracks.time_s[row]), float(tracks.speed_mps[row])))
    return {name: np.array(values) for name, values in found.items()}
