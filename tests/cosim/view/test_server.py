"""The server returns only the page and its frames, and only to this machine."""

from __future__ import annotations

import http.client
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from cosim.drives.kitti import Drive
from cosim.view.interactive import ViewServer, show_drives
from cosim.view.interactive.server import LOOPBACK, ServeError
from tests.cosim.view.unpacking import unpacked


@pytest.fixture
def server(labelled_drive: Path) -> Iterator[ViewServer]:
    shown = show_drives([Drive(labelled_drive)], "000000,000001", None, None, for_file=False)
    with ViewServer(shown) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))  # s between looks for its end
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def ask(server: ViewServer, path: str, host: str | None = None, method: str = "GET") -> tuple[int, bytes]:
    connection = http.client.HTTPConnection(LOOPBACK, server.server_port, timeout=30)
    connection.putrequest(method, path, skip_host=True)
    connection.putheader("Host", host or f"localhost:{server.server_port}")
    connection.endheaders()
    answer = connection.getresponse()
    found = answer.status, answer.read()
    connection.close()
    return found


def test_the_page_and_its_frames_are_given(server: ViewServer) -> None:
    status, page = ask(server, "/")
    assert status == 200 and b"<canvas" in page
    status, frame = ask(server, "/frame/0/000001")
    assert status == 200 and unpacked(frame)[0]["name"] == "000001"
    status, extra = ask(server, "/extra/0/000001")
    assert status == 200 and "residual" in unpacked(extra)[0]["absent"]


@pytest.mark.parametrize(
    "path",
    [
        "/frame/0/000002",  # in the drive but not among the frames shown
        "/frame/1/000000",
        "/frame/-1/000000",
        "/frame/0/../velodyne/000000.bin",
        "/frame/0/%2e%2e%2f%2e%2e%2fetc%2fpasswd",
        "/frame/0/..%5c..%5cdrive.yaml",
        "/frame/0/000000%00",
        "/frame/0/",
        "/frame/0",
        "/../../etc/passwd",
        "//etc/passwd",
        "/velodyne/000000.bin",
        "/extra/0/000002",
        "/index.html",
    ],
)
def test_other_paths_give_404(server: ViewServer, path: str) -> None:
    status, text = ask(server, path)
    assert status == 404
    assert len(text) < 100


def test_other_host_names_are_refused(server: ViewServer) -> None:
    assert ask(server, "/frame/0/000000", host="evil.example")[0] == 403
    assert ask(server, "/", host=f"127.0.0.1:{server.server_port}")[0] == 200


def test_nothing_can_be_sent(server: ViewServer) -> None:
    assert ask(server, "/frame/0/000000", method="POST")[0] == 501


def test_a_broken_frame_is_one_line(server: ViewServer, labelled_drive: Path) -> None:
    (labelled_drive / "label_2" / "000001.txt").write_text("Car 0\n")
    status, text = ask(server, "/frame/0/000001")
    assert status == 500
    assert b"2 columns" in text and b"Traceback" not in text


def test_a_port_that_is_taken_is_one_line(server: ViewServer) -> None:
    with pytest.raises(ServeError, match="choose another --port"):
        ViewServer(server.shown, server.server_port)


@pytest.mark.parametrize("port", [-1, 70000])
def test_a_port_that_cannot_be_is_one_line(server: ViewServer, port: int) -> None:
    with pytest.raises(ServeError, match="choose another --port"):
        ViewServer(server.shown, port)
