"""The server of the workbench: whom it answers, what waits, when it ends; and the check that it starts."""

import asyncio
import gc
import json
import re
import socket
import struct
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

pytest.importorskip("tornado", reason="the workbench is served by tornado: pip install tornado")
pytest.importorskip("tomlkit", reason="the workbench edits scene files by tomlkit: pip install tomlkit")
from tornado.httpclient import AsyncHTTPClient, HTTPRequest
from tornado.websocket import websocket_connect

from fourbar.edit import server, witness
from fourbar.edit.server import LARGEST_REQUEST, MOST_WAITING, Workbench
from fourbar.edit.session import Session

CRANK_ROCKER = Path(__file__).parents[3] / "models" / "crank_rocker.toml"
HUGE = 100_000_000
"""Bytes of a request that is not taken."""
OPEN: list = []
"""Pages to be closed when a test ends."""


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys):
    """Run a coroutine against a workbench that listens; it gets the workbench and its address."""
    monkeypatch.setattr(server, "GONE", 0.3)
    path = tmp_path / "scene.toml"
    path.write_bytes(CRANK_ROCKER.read_bytes())

    def run(what: Callable[[Workbench, str], Awaitable[None]]) -> Session:
        session = Session(path, tmp_path / "exports")

        async def both() -> None:
            made = Workbench(session)
            serving = asyncio.create_task(made.serve(0, browse=False))
            try:
                await what(made, await made.address)
            finally:
                made.ended.set()
                await serving
                while OPEN:
                    OPEN.pop().close()
                await asyncio.sleep(0.05)

        with warnings.catch_warnings():  # tornado's client keeps the sockets of lines that the server has closed
            warnings.simplefilter("ignore", ResourceWarning)
            asyncio.run(both())
            gc.collect()
        return session

    return run


def port_of(address: str) -> str:
    return address.split("/")[2].rpartition(":")[2]


async def status(address: str, **options) -> int:
    answer = await AsyncHTTPClient(force_instance=True).fetch(HTTPRequest(address, **options), raise_error=False)
    return answer.code


async def page(address: str):
    origin = "/".join(address.split("/")[:3])
    line = address.replace("http:", "ws:") + "live"
    OPEN.append(await websocket_connect(HTTPRequest(line, headers={"Origin": origin}), max_message_size=HUGE))
    return OPEN[-1]


async def told(line, request: dict | None = None, *, settled: bool = False) -> dict:
    """The answer to a request, or the next settled one."""
    if request is not None:
        await line.write_message(json.dumps({"id": "mine"} | request))
    while True:
        data = await asyncio.wait_for(line.read_message(), 10.0)
        about = json.loads(data[4 : 4 + struct.unpack("<I", data[:4])[0]])
        if about.get("settled") if settled else about.get("for") == "mine":
            return about


def test_only_a_page_with_the_token_from_this_address_is_answered(bench) -> None:
    async def ask(made: Workbench, address: str) -> None:
        root, port = address[: address.rindex("/", 0, -1) + 1], port_of(address)
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[A-Za-z0-9_-]{32,}/", address)
        fetched = await AsyncHTTPClient(force_instance=True).fetch(address)
        assert fetched.code == 200 and b"Crank-rocker" in fetched.body
        assert fetched.headers["Referrer-Policy"] == "no-referrer" and fetched.headers["Cache-Control"] == "no-store"
        for path in (
            "",
            "x" * 43 + "/",
            "x/",
            "../scene.toml",
            "%2e%2e/scene.toml",
            address.split("/")[3] + "/scene.toml",
        ):
            assert await status(root + path) == 404, path
        assert await status(address + "report") == 404
        for host in (f"example.org:{port}", "example.org", "127.0.0.1", f"127.0.0.1:{int(port) ^ 1}"):
            assert await status(address, headers={"Host": host}) == 403, host
        assert await status(address, headers={"Host": f"localhost:{port}"}) == 200
        for origin in ("http://example.org", "null", f"https://127.0.0.1:{port}", f"http://127.0.0.1:{int(port) ^ 1}"):
            assert await status(address, headers={"Origin": origin}) == 403, origin
            assert await status(address + "live", headers={"Origin": origin}) == 403, origin
        assert await status(address + "live") == 403  # no browser leaves it out
        assert await status(root + "x" * 43 + "/live", headers={"Origin": root[:-1]}) == 404
        assert await status(address + "live", headers={"Origin": root[:-1]}) == 400  # as it should be, but no WebSocket
        assert await status(address, method="POST", body="x") == 405
        assert not made.pages

    bench(ask)


def test_it_listens_on_the_loopback_address_alone(bench) -> None:
    async def ask(made: Workbench, address: str) -> None:
        port = int(port_of(address))
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.2", port), timeout=1.0)  # as is every other address of this machine

    bench(ask)


def test_a_request_of_a_hundred_megabytes_is_not_read(bench) -> None:
    async def ask(made: Workbench, address: str) -> None:
        host, port = address.split("/")[2].split(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        path = "/" + address.split("/", 3)[3]
        writer.write(f"POST {path} HTTP/1.1\r\nHost: {host}:{port}\r\nContent-Length: {HUGE}\r\n\r\n".encode())
        assert (await asyncio.wait_for(reader.read(), 5.0)).startswith((b"HTTP/1.1 400", b"HTTP/1.1 413"))
        writer.close()
        line = await page(address)
        await line.write_message("[" * (LARGEST_REQUEST + 1))
        assert await asyncio.wait_for(line.read_message(), 5.0) is None  # closed
        line = await page(address)
        await line.write_message("[" * 100_000)  # nested too deeply
        assert await asyncio.wait_for(line.read_message(), 5.0) is None
        line = await page(address)
        assert (await told(line, {"do": "hello"}))["file"] == "scene.toml"

    bench(ask)


def test_a_hundred_requests_at_once_are_answered_and_of_a_drag_only_the_latest(bench) -> None:
    async def ask(made: Workbench, address: str) -> None:
        assert await asyncio.gather(*(status(address) for _ in range(30))) == [200] * 30
        line = await page(address)
        solved = []
        do = made.session.do
        made.session.do = lambda asked: solved.append(asked) or do(asked)
        for size in range(100):
            request = {"do": "set", "path": ["lengths", "input"], "value": f"{101 + 0.1 * size:.1f} mm", "gesture": "g"}
            line.write_message(json.dumps(request | {"id": "mine" if size == 99 else "old"}))
        about = await told(line)
        assert 'input = "110.9 mm"' in about["text"] and len(solved) < 60
        for number in range(3 * MOST_WAITING):
            line.write_message(json.dumps({"do": "units", "units": "SI", "id": "mine" if number == 299 else "old"}))
        await told(line)
        assert len(made.waiting) <= MOST_WAITING

    bench(ask)


def test_error_bars_follow_and_every_page_sees_the_change(bench) -> None:
    async def ask(made: Workbench, address: str) -> None:
        one, other = await page(address), await page(address)
        await told(one, {"do": "hello"})
        about = await told(one, {"do": "set", "path": ["lengths", "input"], "value": "4 in"})
        assert not about["settled"] and "torque_error" not in str(about["columns"])
        for line in (one, other):
            about = await told(line, settled=True)
            assert '"4 in"' in about["text"] and "torque_error" in str(about["columns"]) and about["saved"] is False
            assert "largest torque" in "".join(about["data"]["summary"])
        assert "refused" in await told(other, {"do": "set", "path": ["lengths", "input"], "value": "9 ft"})

    session = bench(ask)
    assert session.state_file.exists()  # it is not saved


def test_samples_of_a_scene_that_has_changed_are_given_up(bench, monkeypatch) -> None:
    collect, changed, finished = server.collect_tolerances, threading.Event(), []

    def watched(*given):
        changed.wait(20)
        finished.append(collect(*given))
        return finished[-1]

    async def ask(made: Workbench, address: str) -> None:
        text = made.session.now.text + '[tolerances]\n"lengths.input" = "0.1 mm"\n'
        data = made.session.do({"do": "text", "text": text})["data"]
        sampled = asyncio.create_task(made._sample(data))
        await asyncio.sleep(0)
        made.session.do({"do": "set", "path": ["lengths", "input"], "value": "101 mm"})
        changed.set()
        await sampled
        assert not finished
        await made._sample(data)
        assert len(finished) == 1

    monkeypatch.setattr(server, "collect_tolerances", watched)
    bench(ask)


def test_it_ends_when_the_last_page_has_gone_and_not_before(bench) -> None:
    async def ask(made: Workbench, address: str) -> None:
        one = await page(address)
        await told(one, {"do": "hello"})
        one.close()
        await asyncio.sleep(0.1)
        two = await page(address)  # a reload
        await asyncio.sleep(0.5)
        assert not made.ended.is_set()
        two.close()
        await asyncio.wait_for(made.ended.wait(), 3.0)

    assert not bench(ask).state_file.exists()  # nothing was changed


def test_the_check_runs_in_a_process_of_its_own_reports_and_can_be_stopped(bench, monkeypatch) -> None:
    program = "import sys, time, pathlib; print('agrees', flush=True); out = pathlib.Path(sys.argv[-1]); "
    program += (
        "(out / 'report.html').write_text('<p>report'); time.sleep(float(out.parent.joinpath('wait').read_text()))"
    )
    monkeypatch.setattr(witness, "find_harness", lambda: [sys.executable, "-c", program])
    monkeypatch.setattr(witness, "TICK", 0.05)

    async def ask(made: Workbench, address: str) -> None:
        folder = made.session.exports.folder
        folder.mkdir()
        line = await page(address)
        for wait, stopped in (("0", False), ("60", True)):
            (folder / "wait").write_text(wait)
            await line.write_message(json.dumps({"do": "check"}))
            while True:
                data = await asyncio.wait_for(line.read_message(), 10.0)
                about = json.loads(data[4 : 4 + struct.unpack("<I", data[:4])[0]])
                if not (check := about.get("check")):
                    continue
                if check["running"] and stopped and check["lines"]:
                    await line.write_message(json.dumps({"do": "stop"}))
                if not check["running"]:
                    break
            assert check["lines"] == ["agrees"] and check["report"] and check["stopped"] is stopped
        answer = await AsyncHTTPClient(force_instance=True).fetch(address + "report")
        assert answer.body == b"<p>report" and "sandbox" in answer.headers["Content-Security-Policy"]
        assert (folder / "check" / "scene.toml").read_text() == CRANK_ROCKER.read_text()

    bench(ask)


@pytest.mark.posix
def test_the_command_prints_the_address_alone_and_ends_by_an_interrupt(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(CRANK_ROCKER.read_bytes())
    command = [sys.executable, "-m", "fourbar", "edit", str(path), "--no-browser"]
    began = time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        address = process.stdout.readline()
        assert address.startswith("http://127.0.0.1:")
        port = port_of(address)
        taken = subprocess.run([*command, "--port", port], capture_output=True, text=True, check=False)
        assert taken.returncode == 2 and "--port" in taken.stderr and "Traceback" not in taken.stderr
        process.send_signal(2)
        out, error = process.communicate(timeout=20)
    assert (process.returncode, out, error) == (0, "", "")
    assert list(tmp_path.iterdir()) == [path] and time.monotonic() - began < 60
