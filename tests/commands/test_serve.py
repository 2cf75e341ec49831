"""A run's report over HTTP."""

from __future__ import annotations

import http.client
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from toys import Toys

from pipeline.cli import main
from pipeline.commands.serve import HOST, ReportServer
from pipeline.errors import InputError


@pytest.fixture
def server(tmp_path: Path) -> Iterator[ReportServer]:
    run = tmp_path / "run"
    (run / "outputs").mkdir(parents=True)
    (run / "report.html").write_text("<p>Réport</p>")
    (run / "outputs" / "fit map.png").write_bytes(b"\x89PNG")
    (run / "outputs" / ".written.json").write_text("{}")
    (tmp_path / "secret.txt").write_text("secret")
    (run / "outputs" / "link.txt").symlink_to(tmp_path / "secret.txt")
    with ReportServer(run) as made:
        thread = threading.Thread(target=made.serve_forever, daemon=True)
        thread.start()
        yield made
        made.shutdown()
        thread.join()


def fetched(
    server: ReportServer, path: str, method: str = "GET", host: str | None = None
) -> tuple[int, bytes, dict[str, str]]:
    connection = http.client.HTTPConnection(HOST, server.server_port, timeout=10)
    connection.request(method, path, headers={} if host is None else {"Host": host})
    response = connection.getresponse()
    body = response.read()
    connection.close()
    return response.status, body, dict(response.getheaders())


def test_the_report_is_the_front_page(server: ReportServer) -> None:
    for path in ("/", "/report.html", "/report.html?x=1"):
        status, body, headers = fetched(server, path)
        assert (status, body.decode()) == (200, "<p>Réport</p>")
        assert headers["Content-Type"] == "text/html"
        assert "default-src 'none'" in headers["Content-Security-Policy"]
    status, body, headers = fetched(server, "/", "HEAD")
    assert (status, body) == (200, b"")


def test_files_are_listed_and_served_with_their_types(server: ReportServer) -> None:
    listing = fetched(server, "/outputs")[1].decode()
    assert 'href="/outputs/fit%20map.png"' in listing
    assert ".written" not in listing
    status, body, headers = fetched(server, "/outputs/fit%20map.png")
    assert (status, body, headers["Content-Type"]) == (200, b"\x89PNG", "image/png")


@pytest.mark.parametrize(
    "path",
    [
        "/../secret.txt",
        "/outputs/../../secret.txt",
        "/%2e%2e/secret.txt",
        "/outputs/link.txt",
        "/outputs/.written.json",
    ],
)
def test_nothing_outside_the_folder_is_served(server: ReportServer, path: str) -> None:
    status, body, _ = fetched(server, path)
    assert status == 404
    assert b"secret" not in body


def test_other_names_of_this_machine_are_refused(server: ReportServer) -> None:
    assert fetched(server, "/", host="evil.example")[0] == 403
    assert fetched(server, "/", host=f"localhost:{server.server_port}")[0] == 200


def test_a_reader_who_leaves_in_the_middle_of_a_large_file_is_let_go(
    server: ReportServer, capsys: pytest.CaptureFixture[str]
) -> None:
    before = threading.active_count()
    large = server.folder / "outputs" / "large.exr"
    with large.open("wb") as file:
        file.truncate(1 << 26)
    with socket.create_connection((HOST, server.server_port), timeout=10) as reader:
        reader.sendall(f"GET /outputs/large.exr HTTP/1.0\r\nHost: {HOST}:{server.server_port}\r\n\r\n".encode())
        assert reader.recv(100).startswith(b"HTTP/1.0 200")
    assert fetched(server, "/")[0] == 200
    deadline = time.monotonic() + 10
    while threading.active_count() > before and time.monotonic() < deadline:
        time.sleep(0.01)
    assert "Traceback" not in capsys.readouterr().err


def test_nothing_can_be_written(server: ReportServer) -> None:
    assert fetched(server, "/report.html", "POST")[0] == 501


def test_only_this_machine_is_listened_to(server: ReportServer) -> None:
    assert server.socket.getsockname()[0] == "127.0.0.1"


def test_a_folder_without_a_report_and_a_taken_port_are_refused(tmp_path: Path, server: ReportServer) -> None:
    with pytest.raises(InputError, match="there is no report in"):
        ReportServer(tmp_path)
    with pytest.raises(InputError, match=r"port \d+ cannot be opened: Address already in use"):
        ReportServer(server.folder, server.server_port)


def test_the_command_serves_until_it_is_interrupted(toys: Toys, capsys: pytest.CaptureFixture[str]) -> None:
    run = toys.run()
    assert main(["serve", str(run.path), "--port", "x"]) == 2
    assert "--port is 'x'" in capsys.readouterr().err
    command = [sys.executable, "-m", "pipeline", "serve", str(run.path), "--port=0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        url = process.stdout.readline().split()[0]
        port = int(url.split(":")[2].split("/")[0])
        with socket.create_connection((HOST, port), timeout=10):
            process.send_signal(signal.SIGINT)
            assert process.wait(10) == 0
