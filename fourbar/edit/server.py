"""The server of the workbench.

The server listens on the loopback address alone, for pages that know its token.
"""

import asyncio
import hmac
import json
import os
import signal
import sys
import threading
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from fourbar.edit.exports import HarnessRun, pack_frame
from fourbar.edit.redirect import Redirect
from fourbar.edit.session import SceneState, Session
from fourbar.errors import FourBarError, InputError
from fourbar.show.animate import write_page
from fourbar.show.tolerances import collect_tolerances

_LOOPBACK = "127.0.0.1"
LARGEST_REQUEST = 2_000_000
"""Bytes; a scene file has half a million at most."""
IDLE = 10.0
"""Time within which a request must be complete, s."""
PING = 20.0
"""Time between two pings of a page, and that within which it answers, s."""
GONE = 90.0
"""Time from the last page's leaving to the server's end, s. A page in the background
looks for the server once a minute.
"""
ERROR_BAR_DELAY = 0.15
"""s without a change, after which error bars follow."""
SPREAD_DELAY = 1.0
"""Time without a change after which the spreads of tolerances are sampled, s. Sampling
takes seconds.
"""


class Workbench:
    """A session and the pages that show it."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.ended = asyncio.Event()
        self.loop = asyncio.get_running_loop()
        self.address: asyncio.Future[str] = self.loop.create_future()
        self.pages: set[_PageLine] = set()
        self.waiting: deque[tuple[_PageLine, dict[str, Any]]] = deque()
        # the session is touched from this thread alone
        self.one = ThreadPoolExecutor(1)
        self.aside = ThreadPoolExecutor(1)  # what takes seconds
        self.working: asyncio.Task[None] | None = None
        self.following: asyncio.Task[None] | None = None
        self.leaving: asyncio.TimerHandle | None = None
        self.check = HarnessRun(session.exports / "check", self.tell)

    def join(self, line: "_PageLine") -> None:
        """Add a page, and cancel the end of a server without pages."""
        self.pages.add(line)
        if self.leaving is not None:
            self.leaving.cancel()

    def leave(self, line: "_PageLine") -> None:
        """Remove a page; some time after the last one the server ends."""
        self.pages.discard(line)
        if not self.pages:
            self.leaving = self.loop.call_later(GONE, self.ended.set)

    def tell(self, about: dict[str, Any], *, to: "_PageLine | None" = None) -> None:
        """Send an answer to one page or to all."""
        data = pack_frame(about)
        for line in [to] if to else list(self.pages):
            line.send(data)

    def take(self, line: "_PageLine", asked: dict[str, Any]) -> None:
        """Put a request in the queue; `check` and `stop` are done at once."""
        if self.ended.is_set():  # a page may go on sending while the server ends
            return
        do = asked.get("do")
        if do in ("check", "stop"):
            if do == "check":
                self.check.start(self.session.now.text)
            else:
                self.check.stop()
            self.tell({"for": asked.get("id")}, to=line)
            return
        self.waiting.append((line, asked))
        if self.following is not None:
            self.following.cancel()
        if self.working is None or self.working.done():
            self.working = asyncio.create_task(self._run_work())

    async def _run_work(self) -> None:
        while self.waiting:
            line, asked = self.waiting.popleft()
            about = await self.loop.run_in_executor(self.one, self.session.do, asked)
            about["for"] = asked.get("id")
            to_all = {"data", "text"} <= about.keys() and asked.get("do") != "hello"
            if about.pop("refer", False):
                compare = self.session.compared
                compared = await self.loop.run_in_executor(self.one, compare)
                self.tell(compared, to=None if to_all else line)
            self.tell(about, to=None if to_all and "ask" not in about else line)
        self.following = asyncio.create_task(self._follow_up())

    def _write_state_file(self) -> None:
        try:
            self.session.write_state_file()
        except OSError as error:
            self.loop.call_soon_threadsafe(
                self.tell,
                {"note": f"the state file cannot be written: {error}"},
            )

    async def _follow_up(self) -> None:
        """Send error bars and summary of a state that rests, then what tolerances do.

        The next request cancels this; changes are answered meanwhile.
        """
        await asyncio.sleep(ERROR_BAR_DELAY)
        self.one.submit(self._write_state_file)
        session = self.session
        state = session.now
        more = {"settled": True, "pressure": session.pressure}
        evaluate = partial(state.evaluate, session.units, **more)
        call = self.loop.run_in_executor
        try:
            data = await call(self.aside, evaluate)
            data["kept_peaks"] = await call(self.aside, session.locate_kept_peaks)
            describe = partial(session.describe, data, settled=True)
            about = await call(self.one, describe)
        except FourBarError as error:
            self.tell({"note": str(error)})
            return
        self.tell(about)
        await asyncio.sleep(SPREAD_DELAY)
        await self._sample(state, data)

    async def _sample(self, state: SceneState, data: dict[str, Any]) -> None:
        """Send what the tolerances do, unless something has changed meanwhile."""
        scene = state.scene

        def give_up(_: float) -> None:
            if self.ended.is_set() or state is not self.session.now:
                raise FourBarError("nobody waits for these samples any more")

        if scene.tolerances:
            with suppress(FourBarError):
                places = data["over"]["values"] or data["theta_2"]
                spreads = await self.loop.run_in_executor(
                    self.aside,
                    collect_tolerances,
                    scene,
                    places,
                    give_up,
                )
                if state is self.session.now:
                    self.tell({"tolerances": spreads})

    async def serve(
        self,
        port: int,
        redirect: Redirect | None = None,
        *,
        browse: bool = False,
    ) -> None:
        """Serve until all pages have gone, or until Ctrl-C.

        `redirect`: page that leads browsers and other servers here.
        """
        try:
            sockets = bind_sockets(port, _LOOPBACK)
        except (OSError, OverflowError) as error:
            allowed = f"the port cannot be opened: {error}"
            raise InputError("--port", port, allowed) from None
        own_port = sockets[0].getsockname()[1]
        server = HTTPServer(
            _make_application(self, own_port),
            max_body_size=LARGEST_REQUEST,
            max_header_size=16_384,
            idle_connection_timeout=IDLE,
            body_timeout=IDLE,
        )
        server.add_sockets(sockets)
        for name in (signal.SIGINT, signal.SIGTERM):
            with suppress(NotImplementedError):  # Windows: KeyboardInterrupt
                self.loop.add_signal_handler(name, self.ended.set)
        address = f"http://{_LOOPBACK}:{own_port}/{self.session.token}/"
        self.one.submit(self._write_state_file)
        self.address.set_result(address)
        if redirect is not None:
            redirect.write(address)
        print(address, flush=True)
        if browse and redirect is not None:
            threading.Thread(target=redirect.open, daemon=True).start()
        await self.ended.wait()
        server.stop()
        gone = not self.pages
        self.waiting.clear()
        if self.working is not None:
            await asyncio.wait({self.working})
        if self.following is not None:
            self.following.cancel()
        for line in list(self.pages):
            line.close(1001, "the server ends")
        self.check.stop()
        if self.check.task is not None:
            await asyncio.wait({self.check.task}, timeout=5.0)
        await self.loop.run_in_executor(self.one, lambda: self.session.end(gone=gone))
        self.one.shutdown()
        self.aside.shutdown(wait=False, cancel_futures=True)


class _Guarded(RequestHandler):
    """Answers only requests for this address, with the token."""

    def initialize(self, bench: Workbench, hosts: frozenset[str]) -> None:
        """Store the workbench and the names of this address."""
        self.bench = bench
        self.hosts = hosts

    def prepare(self) -> None:
        """Refuse another Host or Origin (403), and a wrong token (404)."""
        origin = self.request.headers.get("Origin")
        wanted = {f"http://{host}" for host in self.hosts}
        if self.request.host not in self.hosts or (
            origin is not None and origin not in wanted
        ):
            raise HTTPError(403)
        if not hmac.compare_digest(
            self.path_kwargs["token"].encode(),
            self.bench.session.token.encode(),
        ):
            raise HTTPError(404)

    def set_default_headers(self) -> None:
        """Keep the page and its address to this browser."""
        headers = {
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
            "X-Frame-Options": "DENY",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Server": "fourbar",
        }
        for name, value in headers.items():
            self.set_header(name, value)


class Page(_Guarded):
    """The page itself."""

    async def get(self, token: str) -> None:
        """Write the page with its first state."""
        session = self.bench.session
        text = await asyncio.get_running_loop().run_in_executor(
            self.bench.one,
            lambda: write_page(
                session.now.scene,
                units=session.units,
                live=f"ws://{self.request.host}/{token}/live",
            ),
        )
        self.finish(text)


class Report(_Guarded):
    """The report of the harness, in a sandbox without an origin.

    A page in this sandbox reaches nothing of the server.
    """

    def get(self, token: str) -> None:
        """Write the report; 404 before there is one."""
        if not self.bench.check.report.is_file():
            raise HTTPError(404)
        self.set_header("Content-Security-Policy", "sandbox allow-scripts")
        self.finish(self.bench.check.report.read_bytes())


class TracedPictureFile(_Guarded):
    """The picture under the drawing: an image alone, whatever an SVG holds."""

    def get(self, token: str) -> None:
        """Write the file; 404 where there is none that can be read."""
        picture = self.bench.session.now.scene.picture
        if picture is None:
            raise HTTPError(404)
        try:
            content, kind = picture.read()
        except InputError:
            raise HTTPError(404) from None
        self.set_header("Content-Type", kind)
        policy = "default-src 'none'; style-src 'unsafe-inline'; sandbox"
        self.set_header("Content-Security-Policy", policy)
        self.finish(content)


class _PageLine(WebSocketHandler, _Guarded):
    """The line between a page and the session."""

    def prepare(self) -> None:
        """Refuse what is no page of this server: a browser always states the origin."""
        _Guarded.prepare(self)
        if "Origin" not in self.request.headers:
            raise HTTPError(403)

    def open(self, *args: str, **kwargs: str) -> None:
        """Add the page to the workbench."""
        self.set_nodelay(True)
        self.bench.join(self)

    def send(self, data: bytes) -> None:
        """Send a frame; a page that has closed meanwhile is no error."""
        with suppress(WebSocketClosedError):
            written = asyncio.ensure_future(self.write_message(data, binary=True))
            written.add_done_callback(
                lambda sent: None if sent.cancelled() else sent.exception()
            )

    def on_message(self, message: str | bytes) -> None:
        """Take a request, one JSON object; the line of anything else is closed."""
        self.bench.take(self, json.loads(message))

    def on_close(self) -> None:
        """Remove the page from the workbench."""
        self.bench.leave(self)


def _make_application(bench: Workbench, port: int) -> Application:
    """Make the application of a workbench that listens at a port."""
    served = {
        "bench": bench,
        "hosts": frozenset(f"{name}:{port}" for name in (_LOOPBACK, "localhost")),
    }
    routes: dict[str, type[_Guarded]] = {
        "": Page,
        "report": Report,
        "live": _PageLine,
        "picture": TracedPictureFile,
    }
    return Application(
        [
            (rf"/(?P<token>[A-Za-z0-9_-]+)/{place}", handler, served)
            for place, handler in routes.items()
        ],
        log_function=lambda handler: None,
        websocket_max_message_size=LARGEST_REQUEST,
        # a page that reads nothing does not answer either, and is closed
        websocket_ping_interval=PING,
        websocket_ping_timeout=PING,
    )


def edit(path: Path, exports: Path, port: int = 0, *, browse: bool = True) -> None:
    """Open a scene in the workbench, and serve it until all pages have gone.

    A file that does not exist is begun; exports and reports go to the folder `exports`;
    port 0: any that is free. Where another process serves the file, its address is
    printed and its page opened.
    """
    redirect = Redirect(Path(os.path.realpath(path)))
    if not redirect.claim():
        print(redirect.read(), flush=True)
        if browse:
            redirect.open()
        return

    async def run() -> None:
        await Workbench(session).serve(port, redirect, browse=browse)

    try:
        session = Session(path, exports)
        session.answer()  # what assembles nowhere has no page
        with suppress(KeyboardInterrupt):
            asyncio.run(run())
    finally:
        redirect.remove()
    sys.stdout.flush()
