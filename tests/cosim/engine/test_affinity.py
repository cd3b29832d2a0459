"""Assignment of tasks: processes prefer tasks whose town and world they have in memory."""

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
