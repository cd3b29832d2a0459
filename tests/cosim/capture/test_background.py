"""What is done behind is done in order, and its errors come out."""

import threading
import time

import pytest

from cosim.capture.recorder import BackgroundWriter


def test_work_is_done_in_order_and_waited_for():
    behind, done, begin = BackgroundWriter(), [], threading.Event()

    def slow() -> None:
        begin.wait(10)
        done.append("slow")

    behind.do(slow)
    assert done == []  # the caller goes on meanwhile
    begin.set()
    behind.do(lambda: (time.sleep(0.01), done.append("next"))[1])
    assert done == ["slow"]
    behind.wait()
    assert done == ["slow", "next"]


def test_an_error_comes_out_once():
    behind = BackgroundWriter()
    behind.do(lambda: (_ for _ in ()).throw(OSError("full")))
    with pytest.raises(OSError, match="full"):
        behind.wait()
    behind.wait()
