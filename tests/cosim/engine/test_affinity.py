"""Assignment of tasks: processes prefer tasks whose town and world they have in memory, and learn the next one."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from cosim.engine import Do, LocalEngine
from cosim.engine.local import _choose_task

TOWNS = [("a", 0), ("a", 1), ("b", 0), ("b", 1)]


def test_the_first_task_is_chosen_without_affinities():
    assert _choose_task(TOWNS, (), []) == 0


def test_a_second_process_starts_in_another_town():
    assert _choose_task(TOWNS[1:], (), [("a", 0)]) == 1


def test_a_process_stays_in_its_town_and_world():
    assert _choose_task(TOWNS, ("b", 1), [("a", 0)]) == 3
    assert _choose_task(TOWNS[:3], ("b", 1), [("a", 0)]) == 2


def test_remaining_tasks_are_done_by_any_process():
    assert _choose_task([("a", 4)], ("b", 1), [("a", 3)]) == 0


def test_tasks_without_affinity_keep_their_order():
    assert _choose_task([(), ()], (), [()]) == 0


@dataclass(frozen=True)
class Errand:
    """A task that learns which one follows."""

    number: int
    affinity: tuple[int, ...]
    upcoming: int | None = None

    def followed_by(self, other: Errand) -> Errand:
        return replace(self, upcoming=other.number)


@dataclass(frozen=True)
class Errands:
    """Writes for each task its process, its number and that of the task that is expected next."""

    folder: Path

    @contextmanager
    def open(self, threads: int) -> Iterator[Do]:
        def do(task: Errand, _) -> None:
            with (self.folder / str(os.getpid())).open("a") as file:
                file.write(f"{task.number} {task.upcoming}\n")

        yield do


@pytest.mark.parametrize("workers", [1, 3])
def test_a_process_learns_its_next_task(tmp_path, workers):
    tasks = [Errand(number, (number // 4,)) for number in range(14)]
    assert not LocalEngine(workers).share_out(Errands(tmp_path), tasks, lambda _: None)
    rows = [[line.split() for line in path.read_text().splitlines()] for path in tmp_path.iterdir()]
    assert sorted(int(number) for lines in rows for number, _ in lines) == list(range(14))
    for lines in rows:
        for (_, upcoming), (number, _) in itertools.pairwise(lines):
            assert upcoming in (number, "None")
    if workers == 1:
        assert rows[0][-1][1] == "None" and all(upcoming != "None" for _, upcoming in rows[0][:-1])
