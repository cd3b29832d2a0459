"""Who gets which task: processes go on where they have been."""

from cosim.engine.local import _choose_task

TOWNS = [("a", 0), ("a", 1), ("b", 0), ("b", 1)]


def test_the_first_comes_first_where_nobody_has_been_anywhere():
    assert _choose_task(TOWNS, (), []) == 0


def test_another_process_begins_elsewhere():
    assert _choose_task(TOWNS[1:], (), [("a", 0)]) == 1


def test_one_goes_on_in_its_town_and_best_in_its_world():
    assert _choose_task(TOWNS, ("b", 1), [("a", 0)]) == 3
    assert _choose_task(TOWNS[:3], ("b", 1), [("a", 0)]) == 2


def test_what_is_left_is_done_wherever_it_is():
    assert _choose_task([("a", 4)], ("b", 1), [("a", 3)]) == 0


def test_tasks_without_places_come_in_their_order():
    assert _choose_task([(), ()], (), [()]) == 0
