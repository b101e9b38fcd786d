"""The server of the workbench: whom it answers, what waits, when it ends.

The check that it starts.
"""

import asyncio
import gc
import json
import os
import re
import socket
import struct
import subprocess
import sys
import threading
import warnings
from pathlib import Path
from time import monotonic, sleep

from pytest import fixture, importorskip, mark, raises

importorskip(
    "tornado",
    reason="the workbench is served by tornado: pip install tornado",
)
importorskip(
    "tomlkit",
    reason="the workbench edits scene files by tomlkit: pip install tomlkit",
)
from tornado.httpclient import AsyncHTTPClient, HTTPRequest
from tornado.ioloop import IOLoop
from tornado.websocket import websocket_connect

from fourbar.edit import exports, server, session
from fourbar.edit.redirect import REDIRECT_ENDING, REDIRECT_PAGE, Redirect
from fourbar_validation.places import MODELS
from tests.support.rows import read_rows, refused

CRANK_ROCKER = MODELS / "crank_rocker.toml"
HUGE = 100_000_000
"""Bytes of a request that is not taken."""
OPEN = []
"""Pages to be closed when a test ends."""
LEFT = REDIRECT_PAGE.format(address="http://127.0.0.1:4000/token/")
"""The page of a server that was killed."""


@fixture
def path(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_bytes(CRANK_ROCKER.read_bytes())
    return path


def start(path, *options, **environment):
    """The command, in a process of its own; its first line is the address."""
    command = [sys.executable, "-m", "fourbar", "edit", str(path), *options]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, env=os.environ | environment, **streams)


def wait_until(happened):
    deadline = monotonic() + 20
    while not happened() and monotonic() < deadline:
        sleep(0.05)


@fixture
def bench(path, monkeypatch, capsys):
    """Return a function that runs a coroutine with a listening workbench and its
    address.
    """
    monkeypatch.setattr(server, "GONE", 0.3)

    def run(what):
        edited = session.Session(path, path.parent / "exports")

        async def both():
            made = server.Workbench(edited)
            serving = asyncio.create_task(made.serve(0))
            try:
                await what(made, await made.address)
            finally:
                made.ended.set()
                await serving
                while OPEN:
                    OPEN.pop().close()
                await asyncio.sleep(0.05)

        # tornado's client keeps the sockets of lines that the server has closed
        warnings.simplefilter("ignore", ResourceWarning)
        asyncio.run(both())
        gc.collect()
        return edited

    return run


def set_input(length):
    """The request of a page that types the length of the input."""
    return {"do": "set", "path": ["lengths", "input"], "value": length}


def port_of(address):
    return address.split("/")[2].rpartition(":")[2]


def fetch(address, **options):
    request = HTTPRequest(address, **options)
    return AsyncHTTPClient(force_instance=True).fetch(request, raise_error=False)


async def status(address, **options):
    return (await fetch(address, **options)).code


async def page(address):
    origin = "/".join(address.split("/")[:3])
    line = address.replace("http:", "ws:") + "live"
    request = HTTPRequest(line, headers={"Origin": origin})
    OPEN.append(await websocket_connect(request, max_message_size=HUGE))
    return OPEN[-1]


async def heard(line, wanted):
    """The next answer of the kind wanted."""
    while True:
        data = await asyncio.wait_for(line.read_message(), 10.0)
        about = json.loads(data[4 : 4 + struct.unpack("<I", data[:4])[0]])
        if wanted(about):
            return about


async def settled(line):
    return await heard(line, lambda about: about.get("settled"))


async def told(line, request):
    """The answer to a request."""
    await line.write_message(json.dumps({"id": "mine"} | request))
    return await heard(line, lambda about: about.get("for") == "mine")


ANSWERED = read_rows("""
{root} | | 404
{root}{token}/ | | 404
{root}../scene.toml | | 404
{root}%2e%2e/scene.toml | | 404
{page}scene.toml | | 404
{page}report | | 404
{page} | Host: example.org:{port} | 403
{page} | Host: example.org | 403
{page} | Host: 127.0.0.1 | 403
{page} | Host: 127.0.0.1:{other} | 403
{page} | Host: localhost:{port} | 200
{page} | Origin: http://example.org | 403
{page} | Origin: null | 403
{page} | Origin: https://127.0.0.1:{port} | 403
{page} | Origin: http://127.0.0.1:{other} | 403
{page}live | Origin: http://example.org | 403
{page}live | Origin: null | 403
{page}live | Origin: https://127.0.0.1:{port} | 403
{page}live | Origin: http://127.0.0.1:{other} | 403
{page}live | | 403
{root}{token}/live | Origin: {own} | 404
# as it should be, but no WebSocket
{page}live | Origin: {own} | 400
""")
"""Addresses, a header of the request, and the status of the answer."""


def test_only_a_page_with_the_token_from_this_address_is_answered(bench):
    """A browser names its origin, and another address of this machine is refused."""

    async def ask(made, address):
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[A-Za-z0-9_-]{32,}/", address)
        root, port = address[: address.rindex("/", 0, -1) + 1], int(port_of(address))
        fetched = await fetch(address)
        assert fetched.code == 200 and b"Crank-rocker" in fetched.body
        assert fetched.headers["Referrer-Policy"] == "no-referrer"
        assert fetched.headers["Cache-Control"] == "no-store"
        parts = {"root": root, "page": address, "own": root[:-1], "port": port}
        parts |= {"other": port ^ 1, "token": "x" * 43}
        for row in ANSWERED:
            place, header, code = (cell.format(**parts) for cell in row)
            name, _, value = header.partition(": ")
            headers = {name: value} if name else {}
            assert await status(place, headers=headers) == int(code), row
        assert await status(address, method="POST", body="x") == 405
        assert not made.pages
        with raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.2", port), timeout=1.0)

    bench(ask)


@mark.slow
def test_a_request_of_a_hundred_megabytes_is_not_read(bench):
    async def ask(made, address):
        host, port = address.split("/")[2].split(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        path = "/" + address.split("/", 3)[3]
        writer.write(
            f"POST {path} HTTP/1.1\r\nHost: {host}:{port}\r\nContent-Length:"
            f" {HUGE}\r\n\r\n".encode()
        )
        answer = await asyncio.wait_for(reader.read(), 5.0)
        assert answer.startswith((b"HTTP/1.1 400", b"HTTP/1.1 413"))
        writer.close()
        for depth in (server.LARGEST_REQUEST + 1, 100_000):  # nested too deeply
            line = await page(address)
            await line.write_message("[" * depth)
            assert await asyncio.wait_for(line.read_message(), 5.0) is None  # closed
        line = await page(address)
        assert (await told(line, {"do": "hello"}))["file"] == "scene.toml"

    bench(ask)


@mark.slow
def test_a_hundred_requests_at_once_are_answered(bench):
    async def ask(made, address):
        assert await asyncio.gather(*(status(address) for _ in range(30))) == [200] * 30
        line = await page(address)
        lengths = [f"{101 + 0.1 * size:.1f} mm" for size in range(100)]
        for length in lengths[:-1]:
            line.write_message(json.dumps(set_input(length) | {"id": "old"}))
        about = await told(line, set_input(lengths[-1]))
        assert 'input = "110.9 mm"' in about["text"]

    bench(ask)


@mark.slow
def test_error_bars_follow_and_every_page_sees_the_change(bench):
    async def ask(made, address):
        first_page, second_page = await page(address), await page(address)
        await told(first_page, {"do": "hello"})
        about = await told(first_page, set_input("4 in"))
        assert not about["settled"] and "torque_error" not in str(about["columns"])
        for line in (first_page, second_page):
            about = await settled(line)
            assert '"4 in"' in about["text"]
            assert "torque_error" in str(about["columns"])
            assert about["saved"] is False
            assert "  torque   peak" in "".join(about["data"]["summary"])
        assert "refused" in await told(second_page, set_input("9 ft"))

    assert bench(ask).state_file.exists()  # it is not saved


@mark.slow
def test_samples_of_a_scene_that_has_changed_are_given_up(bench, monkeypatch):
    collect, changed, finished = server.collect_tolerances, threading.Event(), []

    def watched(*arguments):
        changed.wait(20)
        finished.append(collect(*arguments))
        return finished[-1]

    async def ask(made, address):
        text = made.session.now.text + '[tolerances]\n"lengths.input" = "0.1 mm"\n'
        data = made.session.do({"do": "text", "text": text})["data"]
        sampled = asyncio.create_task(made._sample(made.session.now, data))
        await asyncio.sleep(0)
        made.session.do(set_input("101 mm"))
        changed.set()
        await sampled
        assert not finished
        await made._sample(made.session.now, data)
        assert len(finished) == 1

    monkeypatch.setattr(server, "collect_tolerances", watched)
    bench(ask)


@mark.slow
def test_it_ends_when_the_last_page_has_gone_and_not_before(bench):
    async def ask(made, address):
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


@mark.slow
def test_the_check_runs_in_a_process_of_its_own_reports_and_can_be_stopped(
    bench, monkeypatch
):
    # the line first: the report is what the test waits for before it stops the check
    program = (
        "import sys, time, pathlib; out = pathlib.Path(sys.argv[-1]); "
        "print('agrees', flush=True); (out / 'report.html').write_text('<p>report'); "
        "time.sleep(float(out.parent.joinpath('wait').read_text()))"
    )
    harness = [sys.executable, "-c", program]
    monkeypatch.setattr(exports, "find_harness", lambda: harness)

    def has_ended(about):
        return not about.get("check", {"running": True})["running"]

    async def ask(made, address):
        folder = made.session.exports
        folder.mkdir()
        report = folder / "check" / "report.html"
        line = await page(address)
        for wait, stopped in (("0", False), ("60", True)):
            (folder / "wait").write_text(wait)
            report.unlink(missing_ok=True)
            await line.write_message(json.dumps({"do": "check"}))
            if stopped:
                while not report.exists():
                    await asyncio.sleep(0.05)
                await line.write_message(json.dumps({"do": "stop"}))
            check = (await heard(line, has_ended))["check"]
            assert check["lines"] == ["agrees"] and check["report"]
            assert check["stopped"] is stopped
        answer = await fetch(address + "report")
        assert answer.body == b"<p>report"
        assert "sandbox" in answer.headers["Content-Security-Policy"]
        assert (folder / "check" / "scene.toml").read_text() == CRANK_ROCKER.read_text()

    bench(ask)


@mark.slow
def test_a_change_overtakes_a_summary_that_is_being_computed(bench, monkeypatch):
    evaluate = session.evaluate_scene
    asked_for = threading.Event()
    released = threading.Event()
    summaries = []

    def slow(scene, units, *, settled=False, **options):
        if settled:  # the summary; a change is answered without it
            asked_for.set()
            released.wait(20)
            summaries.append(scene.linkage.input.length)
        return evaluate(scene, units, settled=settled, **options)

    async def ask(made, address):
        line = await page(address)
        await told(line, {"do": "hello"})
        # the summary of the first state is under way
        await asyncio.to_thread(asked_for.wait, 20)
        for size in range(101, 111):
            about = await told(line, set_input(f"{size} mm"))
            assert f'"{size} mm"' in about["text"] and not about["settled"]
            # each asks for a summary of its own
            await asyncio.sleep(server.ERROR_BAR_DELAY * 1.2)
        released.set()
        about = await settled(line)
        # the one of each state between was given up
        assert '"110 mm"' in about["text"] and summaries == [0.1, 0.11]

    monkeypatch.setattr(session, "evaluate_scene", slow)
    bench(ask)


@mark.slow
def test_the_line_of_a_page_that_does_not_read_is_closed(bench, caplog, monkeypatch):
    """One page changes the scene, another one that reads nothing is told each time."""
    monkeypatch.setattr(server, "PING", 0.5)
    frame = {"note": "x" * 60_000}

    async def ask(made, address):
        reading = await page(address)
        silent = await page(address)
        silent.stream.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        IOLoop.current().remove_handler(silent.stream.socket)
        for _ in range(200):
            made.tell(frame)
            await heard(reading, lambda about: "note" in about)
        async with asyncio.timeout(10.0):
            while len(made.pages) > 1:
                await asyncio.sleep(0.1)
        made.tell(frame)
        assert await heard(reading, lambda about: "note" in about)

    bench(ask)
    gc.collect()
    assert not caplog.records


@mark.slow
def test_the_picture_is_served_as_an_image_alone(bench, path):
    """An SVG opened by its address runs no script and reaches nothing here."""

    async def ask(made, address):
        assert await status(address + "picture") == 404
        path.write_text(path.read_text() + '[picture]\nfile = "a.svg"\n')
        await told(await page(address), {"do": "text", "text": path.read_text()})
        assert await status(address + "picture") == 404
        path.with_name("a.svg").write_text("<svg><script/></svg>")
        answer = await fetch(address + "picture")
        assert answer.body == b"<svg><script/></svg>"
        assert answer.headers["Content-Type"] == "image/svg+xml"
        policy = answer.headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy and policy.endswith("sandbox")

    bench(ask)


@mark.slow
@mark.posix
def test_the_browser_gets_a_private_page_and_the_token_stands_in_no_list_of_processes(
    path,
):
    seen, browser = path.with_name("seen"), path.with_name("browser")
    browser.write_text(f'#!/bin/sh\necho "$@" >> {seen}.part; mv {seen}.part {seen}\n')
    browser.chmod(0o755)
    with start(path, BROWSER=f"{browser} %s") as process:
        address = process.stdout.readline().strip()
        wait_until(seen.exists)
        (opened_url,) = seen.read_text().split()
        redirect = Path(opened_url.removeprefix("file://"))
        assert opened_url.startswith("file://")
        assert address.split("/")[3] not in opened_url
        assert redirect.stat().st_mode & 0o777 == 0o600
        assert f'url={address}"' in redirect.read_text().replace("0; ", "")
        process.send_signal(2)
        process.communicate(timeout=20)
    assert not redirect.exists()


@mark.slow
@mark.posix
def test_a_second_workbench_on_one_file_leads_to_the_first(path):
    link = path.with_name("link.toml")
    link.symlink_to(path)
    first, second = (start(name, "--no-browser") for name in (path, link))
    addresses = [process.stdout.readline() for process in (first, second)]
    assert addresses[0] == addresses[1] and addresses[0].startswith("http://127.0.0.1:")
    wait_until(lambda: first.poll() is not None or second.poll() is not None)
    guest, host = (first, second) if first.poll() is not None else (second, first)
    assert (guest.returncode, guest.communicate(), host.poll()) == (0, ("", ""), None)
    host.kill()
    host.communicate()
    # the page of a server that was killed leads nobody astray
    with start(path, "--no-browser") as third:
        assert third.stdout.readline() not in addresses
        third.send_signal(2)
        assert third.communicate(timeout=20) == ("", "")
    assert not path.with_name(path.name + REDIRECT_ENDING).exists()


@mark.posix
def test_a_file_that_another_one_locks_and_gives_no_address_for_is_named(
    tmp_path, monkeypatch
):
    monkeypatch.setattr("fourbar.edit.redirect.PATIENCE", 0.1)
    first, second = Redirect(tmp_path / "a.toml"), Redirect(tmp_path / "a.toml")
    assert first.claim() and not second.claim()
    with refused("has no address"):
        second.read()
    first.remove()
    assert second.claim()
    second.remove()


@mark.posix
@mark.parametrize("content", ["<html>", LEFT + "<p>"], ids=["other", "longer"])
def test_a_file_of_the_page_s_name_that_is_somebody_else_s_stays_as_it_is(
    tmp_path, content
):
    page = tmp_path / f"a.toml{REDIRECT_ENDING}"
    page.write_text(content)
    page.chmod(0o644)
    with refused("is another file: move it away"):
        Redirect(tmp_path / "a.toml").claim()
    assert (page.read_text(), page.stat().st_mode & 0o777) == (content, 0o644)


@mark.posix
@mark.parametrize("left", ["", LEFT])
def test_an_empty_page_and_one_of_a_killed_server_are_written_over(tmp_path, left):
    page = tmp_path / f"a.toml{REDIRECT_ENDING}"
    page.write_text(left)
    redirect = Redirect(tmp_path / "a.toml")
    assert redirect.claim()
    address = "http://127.0.0.1:5000/other/"
    redirect.write(address)
    assert page.read_text() == REDIRECT_PAGE.format(address=address)
    redirect.remove()


@mark.slow
@mark.posix
def test_the_command_prints_the_address_alone_and_ends_by_an_interrupt(path):
    began = monotonic()
    with start(path, "--no-browser") as process:
        address = process.stdout.readline()
        assert address.startswith("http://127.0.0.1:")
        with start(path.with_name("other.toml"), "--port", port_of(address)) as taken:
            error = taken.communicate()[1]
        assert taken.returncode == 2 and "--port" in error and "Traceback" not in error
        process.send_signal(2)
        out, error = process.communicate(timeout=20)
    assert (process.returncode, out, error) == (0, "", "")
    assert list(path.parent.iterdir()) == [path] and monotonic() - began < 60
