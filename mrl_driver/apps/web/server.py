"""The server of the page: HTTP, WebSocket, and where a browser refuses it, an event stream with POST.

One event loop owns everything here, in the thread that calls `serve`; the robot's own threads only wake it.  A client
gets the newest message of each kind (`client.Client`), so that one that is slow delays nobody.  If the loop stands
still, nobody calls `drive`, and the robot's own command timeout stops it.
"""

import asyncio
import concurrent.futures
import contextlib
import logging
import math
import pathlib
import secrets
import socket
import time
from typing import Any, Awaitable, Callable, Coroutine, Dict, Iterable, Iterator, List, Optional, Set

from mrl_driver.clocks import clock_s
from mrl_driver.errors import ConfigError, MrlError, one_line
from mrl_driver.navigation.occupancy_grid import CELL_M, FloorMap

from . import messages
from .client import Client
from .guard import headers_of, why_not
from .helm import Drive, Go, Halt, Helm, Latch, Refuse, Tell, Unlatch
from .listening import DRIVE, Settings, listening_socket
from .robot import PageRobot, Recorded

try:
    from aiohttp import WSMsgType, web
except ImportError as missing:
    raise ConfigError(
        f"the page needs the Python package {missing.name}, which is not installed; install it with: "
        f"pip install 'mrl-driver[web]', or without a virtual environment: sudo apt install python3-{missing.name}"
    ) from None

_DATA = (WSMsgType.TEXT, WSMsgType.BINARY)
PAGE = pathlib.Path(__file__).resolve().parent / "page"
MOST_CLIENTS, MOST_CONNECTIONS = 16, 100
FOR_DRIVING = 4  # places of `MOST_CLIENTS` that are kept for pages that may drive
SAMPLE_S, VIEW_S, CELLS_S = 0.02, 0.1, 0.5  # least time between two samples, views, and occupancy grids [s]
SILENT_SAMPLE_S = 0.2  # after this time without a report there is a sample with unknown speeds [s]
BEAT_S = 0.05  # the loop looks this often whether the program is to end, and at a silent robot [s]
LEAST_VIEW_S = 1.0  # a view that has not changed is sent again after this time [s]
SILENT_S = 2.0  # a session over POST that sends nothing for this time is closed [s]
HEARTBEAT_S = 5.0  # a WebSocket is asked this often; without an answer in half the time it is closed [s]
ACCEPT_AGAIN_S = 0.2  # without a free descriptor, the next connection is accepted after this time [s]
HANDSHAKE_S = 5.0  # the handshake of an encrypted connection is done within this time [s]
KEPT_S = 30.0  # a connection without a request is closed after this time [s]
CLOSE_S = 0.5  # at the end, clients have this time to take their last message [s]
LOG_S = 1.0  # least time between two lines of the log about requests that failed [s]
MOST_QUOTED = 300  # characters of an error that may quote a request
MOST_POSES = 1000  # poses of the path that a client gets when it joins
TOKENS_S = 1.0  # new tokens count within this time [s]
RECORDINGS_S = 2.0  # sizes of recordings are read this often while one is written [s]
HELM, VIEW, SAMPLE, CELLS, RECORDING = "helm", "view", "sample", "cells", "recording"
_ORDERS = {"take": Helm.take, "yield": Helm.yield_, "stop": Helm.stop}
"""What the helm does for a message that has only a type."""
_FLOODS = "the page sends too many messages"
_WATCHES_ONLY = "a watch-only link cannot record or download; use the link for driving"
_REFUSED_LINK = "this link is not valid; open the whole link that mrl web or web_node printed last"


def serve(
    robot: PageRobot,
    settings: Settings,
    ended: Callable[[], str],
    begun: Callable[["Server"], None],
    ear: Optional[socket.socket] = None,
) -> None:
    """Serve the page until `ended` returns a reason, which is asked 20 times a second, or `Server.end` is called.

    Then the robot is stopped, the clients get the reason, and all connections are closed.  Signals are the caller's.
    `begun` gets the server once it listens, at the `ear` or at the address in the settings.  Raises what
    `listening_socket` does.
    """

    async def run() -> None:
        server = Server(robot, settings, ear)
        await server.start()
        why = "the program that serves the page has ended"
        try:
            begun(server)
            why = await server.wait(ended)
        finally:
            await server.close(why)

    asyncio.run(run())


class Server:
    """Serves one robot to its clients.  All but `end` is for the event loop in which it was started."""

    def __init__(self, robot: PageRobot, settings: Settings, ear: Optional[socket.socket] = None) -> None:
        self._robot, self._settings, self._ear = robot, settings, ear
        self._helm = Helm()
        self._clients: Dict[int, Client] = {}
        self._sessions: Dict[str, Client] = {}
        self._tasks: Set[asyncio.Task[Any]] = set()
        self._ends: Dict[Any, socket.socket] = {}
        """Open connections by the address of their other end, the oldest first."""
        self._admitted: Set[Any] = set()  # those of them that belong to a page, or whose token was right
        self._number = 0
        self._page = {path.relative_to(PAGE).as_posix() for path in PAGE.rglob("*") if path.is_file()}
        self._pending = self._ending = False
        self._ended: Callable[[], str] = lambda: ""
        self._failure: Optional[BaseException] = None
        self._was_latched = False
        self._series: List[Any] = []
        self._facts: Dict[str, Any] = {}
        self._occupancy: Optional[FloorMap] = None
        self._cells: List[Any] = []
        self._view: Dict[str, Any] = {}
        self._sample_s = self._viewed_s = self._told_s = self._cells_s = self._listed_s = self._tokens_s = 0.0
        self._recordings: List[Recorded] = []
        self._recording_s: Optional[float] = None
        self._recording_loss = ""
        self._sampler: Optional[asyncio.TimerHandle] = None
        self._deadline: Optional[asyncio.TimerHandle] = None
        self._listener: Optional[asyncio.TimerHandle] = None
        self._files = concurrent.futures.ThreadPoolExecutor(1, "mrl-web-files")

    # -- start and end

    async def start(self) -> None:
        """Listen; raise ConfigError, PortBusy, PortDenied or LinkError if the address cannot be listened on."""
        self._loop = asyncio.get_running_loop()
        self._over: asyncio.Future[str] = self._loop.create_future()
        self._socket = self._ear or listening_socket(self._settings.host, self._settings.port)
        self._loop.set_exception_handler(self._on_failure)
        self._runner = web.AppRunner(
            self._application(), access_log=None, keepalive_timeout=KEPT_S, logger=_log
        )
        await self._runner.setup()
        self._socket.setblocking(False)
        self._listen()
        self.port: int = self._socket.getsockname()[1]
        self._was_latched = self._robot.latched
        if self._was_latched:
            self._carry_out(self._helm.robot_latched(True, clock_s()))
        self._robot.listen(self._on_changed)
        await self._list_recordings()
        self._beat()

    def _listen(self) -> None:
        self._loop.add_reader(self._socket, self._accept)

    def _accept(self) -> None:
        """Accept a connection; one too many ends the oldest that no page has, or is closed.

        Connections count from here on, before any handshake: what strangers open must not take the descriptors away.
        """
        try:
            end, peer = self._socket.accept()
        except (BlockingIOError, ConnectionError):
            return
        except OSError:  # no descriptor is free
            self._loop.remove_reader(self._socket)
            self._listener = self._loop.call_later(ACCEPT_AGAIN_S, self._listen)
            return
        self._ends = {
            each: other for each, other in self._ends.items() if other.fileno() >= 0 and each != peer
        }
        self._admitted &= self._ends.keys()
        if len(self._ends) >= MOST_CONNECTIONS:
            strange = next((each for each in self._ends if each not in self._admitted), None)
            if strange is None:
                end.close()
                return
            with contextlib.suppress(OSError):
                self._ends.pop(strange).shutdown(socket.SHUT_RDWR)
        self._ends[peer] = end
        self._spawn(self._open(end))

    async def _open(self, end: socket.socket) -> None:
        context = self._settings.context
        assert self._runner.server is not None
        with contextlib.suppress(OSError):  # of a handshake that fails
            await self._loop.connect_accepted_socket(
                self._runner.server, end, ssl=context, ssl_handshake_timeout=HANDSHAKE_S if context else None
            )

    def end(self, why: str) -> None:
        """Stop the robot now, and let `serve` end; any thread and any signal handler may call it."""
        self._ending = True
        self._robot.stop()
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._finish, why)

    def _finish(self, why: str) -> None:
        self._ending = True
        if not self._over.done():
            self._over.set_result(why)

    async def wait(self, ended: Callable[[], str] = lambda: "") -> str:
        """Return why the server is to end, when it is."""
        self._ended = ended
        why = await self._over
        if self._failure is not None:
            raise self._failure
        return why

    async def close(self, why: str) -> None:
        """Stop the robot, give the clients the reason, close all connections."""
        self._ending = True
        self._robot.stop()
        for timer in (self._beater, self._sampler, self._deadline, self._listener):
            if timer is not None:
                timer.cancel()
        if self._socket.fileno() >= 0:  # this is the first call
            self._loop.remove_reader(self._socket)
        for client in list(self._clients.values()):
            client.end(why)
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=CLOSE_S)
        for client in list(self._clients.values()):
            client.abort()
        for task in self._tasks:
            task.cancel()
        if self._runner.server is not None:  # this is the first call
            await self._runner.server.shutdown(CLOSE_S)
        await self._runner.cleanup()
        self._socket.close()
        self._files.shutdown()
        self._robot.stop()

    def _on_failure(self, loop: asyncio.AbstractEventLoop, context: Dict[str, Any]) -> None:
        """An error in a callback of the loop is an error of this program: stop the robot and end."""
        error = context.get("exception")
        if {"transport", "protocol", "socket"} & context.keys() or isinstance(error, ConnectionError):
            return  # a client has gone, and its connection is closed
        part = getattr(getattr(context.get("handle"), "_callback", None), "__self__", None)
        if isinstance(part, (asyncio.BaseTransport, asyncio.BaseProtocol)):
            return  # the same, of which asyncio names only the callback
        self._fail(error or RuntimeError(context.get("message", "the event loop has failed")))

    def _fail(self, error: BaseException) -> None:
        self._failure = self._failure or error
        self._robot.stop()
        self._finish("the server has failed")

    # -- the robot

    def _on_changed(self) -> None:
        """Called on any thread: wake the loop, unless it has been and has not come here yet."""
        if not self._pending:
            self._pending = True
            with contextlib.suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._look)

    def _look(self) -> None:
        """The robot has something new."""
        self._pending = False
        if self._ending:
            return
        self._watch_robot()
        now_s = time.monotonic()
        source = self._robot.source
        model = source.model
        if self._occupancy is None and model is not None and model.sonars and model.has_odometry:
            self._occupancy = FloorMap(model.sonars)
        if self._occupancy is not None:
            self._occupancy.follow(source.pose, source.ranges, now_s)
        if self._clients and self._sampler is None:
            if now_s >= self._sample_s:
                self._send_sample()
            else:
                self._sampler = self._loop.call_at(self._sample_s, self._send_sample)

    def _watch_robot(self) -> None:
        """Report to the helm what has happened to the robot."""
        robot, helm, now_s = self._robot, self._helm, clock_s()
        latched = robot.latched
        if latched != self._was_latched:
            self._was_latched = latched
            self._carry_out(helm.robot_latched(latched, now_s))
        why = robot.stopped_by
        if why is not None:
            self._carry_out(helm.robot_stopped(why, now_s))
        if helm.waits and robot.stands:
            self._carry_out(helm.stands(now_s))

    def _beat(self) -> None:
        """Do what is due whether the robot reports or not."""
        why = self._ended()
        if why:
            self._finish(why)
            return
        self._beater = self._loop.call_later(BEAT_S, self._beat)
        self._watch_robot()
        now_s = time.monotonic()
        for session, client in list(self._sessions.items()):
            if now_s - client.heard_s > SILENT_S:
                del self._sessions[session]
                client.end(f"the page sent nothing for {SILENT_S:g} s")
                self._leave(client)
        if self._clients and now_s >= self._sample_s + SILENT_SAMPLE_S and self._sampler is None:
            self._send_sample()
        if self._clients and now_s >= self._viewed_s + VIEW_S - BEAT_S / 2:
            self._viewed_s = now_s
            self._send_view(now_s)
        if now_s >= self._tokens_s + TOKENS_S:
            self._tokens_s = math.inf  # until it is done
            self._spawn(self._renew_tokens())
        if self._recording_s is not None and now_s >= self._listed_s + RECORDINGS_S:
            self._listed_s = now_s
            self._spawn(self._list_recordings())

    def _send_sample(self) -> None:
        """Send the newest sample to all."""
        self._sampler = None
        now_s = time.monotonic()
        self._sample_s = max(self._sample_s, now_s - SAMPLE_S) + SAMPLE_S
        self._broadcast(SAMPLE, messages.sample(clock_s(), self._robot.sample()))

    def _send_view(self, now_s: float) -> None:
        """Send the view if it has changed, and other values if the robot has changed."""
        robot, source = self._robot, self._robot.source
        view = messages.view_facts(robot.shown(now_s))
        series, facts = robot.series(), messages.robot_facts(view["name"], source.model, source.limits)
        if series != self._series or facts != self._facts:
            self._series, self._facts = series, facts
            for client in self._clients.values():
                client.put("welcome", self._welcome(client))
        if view != self._view or now_s >= self._told_s + LEAST_VIEW_S:
            self._view, self._told_s = view, now_s
            self._broadcast(VIEW, messages.encode(VIEW, clock_s(), **view))
        if self._occupancy is not None and now_s >= self._cells_s + CELLS_S:
            self._cells_s, before, self._cells = now_s, self._cells, self._occupancy.taken
            if self._cells != before:
                self._broadcast(CELLS, messages.cells(clock_s(), CELL_M, self._cells))

    def _broadcast(self, kind: str, text: str) -> None:
        for client in self._clients.values():
            client.put(kind, text)

    # -- the helm

    def _carry_out(self, acts: Iterable[Any]) -> None:
        """Do what the helm has decided."""
        todo = list(acts)
        robot, tell, switched = self._robot, False, False
        while todo:
            act = todo.pop(0)
            if isinstance(act, (Drive, Go)):
                drive = robot.drive if isinstance(act, Drive) else robot.go
                why = None if self._ending else drive(*act)
                if why is not None:
                    todo.extend(self._helm.robot_stopped(why, clock_s()))
            elif isinstance(act, Halt):
                robot.stop()
            elif isinstance(act, Latch):
                robot.latch()
                switched = True
            elif isinstance(act, Unlatch):
                robot.release()
                switched = True
            elif isinstance(act, Refuse):
                self._refuse(act.client, act.why)
            elif isinstance(act, Tell):
                tell = True
        if switched:
            self._watch_robot()
        if tell:
            self._tell()
        self._plan()

    def _plan(self) -> None:
        """Let the helm be called when something is due."""
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None
        wait_s = self._helm.due_s - clock_s()
        if wait_s < 1e6:
            self._deadline = self._loop.call_later(max(0.0, wait_s), self._tick)

    def _tick(self) -> None:
        self._deadline = None
        self._carry_out(self._helm.tick(clock_s()))

    def _tell(self) -> None:
        names = {client.number: client.name for client in self._clients.values()}
        self._broadcast(HELM, messages.helm(clock_s(), self._helm.state(), names))

    def _refuse(self, number: int, why: str) -> None:
        client = self._clients.get(number)
        if client is not None:
            client.put(f"refused {why}", messages.encode("refused", clock_s(), why=why))

    # -- clients

    def _join(self, data: Any, token: str = "") -> Client:
        """Return a new client, which has its first messages; `data` is what it has sent first.

        Malformed if it cannot be read, or is not hello; ConfigError, which says why, if it is not admitted; _NoPlace if
        there is none for it now.
        """
        kind, hello = messages.parse(data)
        if kind != "hello":
            raise messages.Malformed("the first message must be hello")
        role = self._settings.role(token or hello["token"])
        if not role:
            raise ConfigError(_REFUSED_LINK)
        if len(self._clients) >= (MOST_CLIENTS if role == DRIVE else MOST_CLIENTS - FOR_DRIVING):
            self._make_place()
        self._number += 1
        client = Client(self._number, role, hello["name"] or f"page {self._number}")
        now_s = time.monotonic()
        self._send_view(now_s)  # the others must not miss what has changed
        trail = list(self._robot.shown(now_s).trail)
        client.put("welcome", self._welcome(client))
        client.put("path", messages.path(clock_s(), trail[:: max(1, -(-len(trail) // MOST_POSES))]))
        client.put(VIEW, messages.encode(VIEW, clock_s(), **self._view))
        client.put(RECORDING, self._recording(client))
        if self._occupancy is not None:
            client.put(CELLS, messages.cells(clock_s(), CELL_M, self._occupancy.taken))
        self._clients[client.number] = client
        self._carry_out(self._helm.join(client.number, role == DRIVE, clock_s()))
        self._tell()
        return client

    def _make_place(self) -> None:
        """End the page that has been silent longest, or raise _NoPlace if none is.

        Its connection may be dead, and it may be the one that comes back.
        """
        silent = min(self._clients.values(), key=lambda client: client.heard_s, default=None)
        if silent is None or time.monotonic() - silent.heard_s < SILENT_S:
            raise _NoPlace(f"{len(self._clients)} pages show this robot already; close one of them")
        silent.end("the page was silent, and another one needed its place")
        self._leave(silent)

    def _leave(self, client: Client) -> None:
        """A client has gone; if it drove, the robot stops."""
        if self._clients.pop(client.number, None) is not None:
            with self._errors_end():
                self._carry_out(self._helm.leave(client.number, clock_s()))
                self._tell()

    def _welcome(self, client: Client) -> str:
        """Return our first message, which comes again if the robot or its series are others."""
        you = {"role": client.role, "you": client.number}
        return messages.encode("welcome", clock_s(), **you, robot=self._facts, series=self._series)

    def _take_message(self, client: Client, data: Any) -> None:
        """Handle one message of a client."""
        client.heard_s = time.monotonic()
        floods = client.is_flooding(client.heard_s)
        try:
            message = messages.parse(data)
            if floods and message.kind != "stop":
                client.end(_FLOODS)
                return
        except messages.Malformed as error:
            self._helm.malformed()
            client.refused += 1
            self._refuse(client.number, str(error))
            if client.refused >= messages.MOST_REFUSALS:
                client.end(f"{messages.MOST_REFUSALS} messages in a row were refused, the last one: {error}")
            return
        client.refused = 0
        with self._errors_end():
            self._follow(client, message)

    @contextlib.contextmanager
    def _errors_end(self) -> Iterator[None]:
        """In this block, an error is one of this program: the robot is stopped and the server ends.

        Elsewhere, a request of anybody may have caused it: that request is answered with an error, and nothing else
        happens.
        """
        try:
            yield
        except Exception as error:
            self._fail(error)
            raise

    def _follow(self, client: Client, message: messages.Message) -> None:
        number, helm, (kind, value) = client.number, self._helm, message
        if kind == "control":
            self._carry_out(helm.control(number, value, clock_s()))
        elif kind in _ORDERS:
            self._carry_out(_ORDERS[kind](helm, number, clock_s()))
        elif kind == "release":
            self._carry_out(helm.release(number, value["heard"], clock_s()))
        elif kind == "record":
            self._record(client, value["on"])
        elif kind == "phone" and helm.state().driver == number:
            self._robot.phone(value)
        elif kind == "hello":
            self._refuse(number, "hello was sent twice, expected it once, as the first message")

    async def _renew_tokens(self) -> None:
        """End all pages if another program has made new tokens; those with a new link may come again."""
        tokens = await self._loop.run_in_executor(self._files, self._settings.renewed)
        self._tokens_s = time.monotonic()
        if tokens is not None:
            self._settings = self._settings._replace(tokens=tokens)
            for client in self._clients.values():
                client.end("the links were made new")

    # -- recordings: files are opened on a thread of their own

    @property
    def _recording_name(self) -> Optional[str]:
        return next((each.name for each in self._recordings if each.on), None)

    def _record(self, client: Client, on: bool) -> None:
        if client.role != DRIVE:
            self._refuse(client.number, _WATCHES_ONLY)
        elif on != (self._recording_s is not None):
            self._recording_s = time.monotonic() if on else None
            self._spawn(self._switch_recording(client.number, on))

    async def _switch_recording(self, number: int, on: bool) -> None:
        act = self._robot.recordings.start if on else self._robot.recordings.stop
        try:
            found = await self._loop.run_in_executor(self._files, act)
            self._recording_loss = "" if on else found
        except MrlError as error:
            self._refuse(number, str(error))
            if on:
                self._recording_s = None
        await self._list_recordings()

    async def _list_recordings(self) -> None:
        self._recordings = await self._loop.run_in_executor(self._files, self._robot.recordings.files)
        name, begun_s = self._recording_name, self._recording_s
        if name is None:
            self._recording_s = None
        elif begun_s is None:
            self._recording_s = time.monotonic()
        for client in self._clients.values():
            client.put(RECORDING, self._recording(client))

    def _recording(self, client: Client) -> str:
        name, begun_s = self._recording_name, self._recording_s
        seconds = time.monotonic() - begun_s if name is not None and begun_s is not None else 0.0
        files = self._recordings if client.role == DRIVE else []  # those that it may download
        return messages.recording(
            clock_s(), name is not None, name or "", seconds, self._recording_loss, files
        )

    def _spawn(self, work: Coroutine[Any, Any, None]) -> None:
        task = self._loop.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._done)

    def _done(self, task: "asyncio.Task[Any]") -> None:
        self._tasks.discard(task)
        error = None if task.cancelled() else task.exception()
        if error is not None:
            self._fail(error)

    # -- HTTP

    def _application(self) -> web.Application:
        app = web.Application(middlewares=[self._guard], client_max_size=messages.MOST_BYTES)
        app.on_response_prepare.append(_add_headers)
        app.router.add_get("/", self._on_page)
        app.router.add_get("/page/{name:.+}", self._on_page)
        app.router.add_get("/ws", self._on_socket)
        app.router.add_post("/session", self._on_session)
        app.router.add_get("/session/{session}/events", self._on_events)
        app.router.add_post("/session/{session}", self._on_message)
        app.router.add_get("/recordings/{name}", self._on_recording)
        return app

    @web.middleware
    async def _guard(
        self, request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        """All requests pass it."""
        why = why_not(request.headers, self._settings.names, request.path == "/")
        if why:
            return _refusal(403, why)
        try:
            return await handler(request)
        except ConnectionError:
            return web.Response()  # to nobody: the page has gone

    def _role(self, request: web.Request) -> str:
        """Return what the token of a request permits; empty for nothing."""
        role = self._settings.role(_token(request))
        if role and request.transport is not None:
            self._admitted.add(request.transport.get_extra_info("peername"))
        return role

    async def _on_page(self, request: web.Request) -> web.StreamResponse:
        name = request.match_info.get("name", "index.html")
        if name not in self._page:
            return _refusal(404, f"there is no {name!r} on this server")
        page = web.FileResponse(PAGE / name, headers={"Cache-Control": "no-cache"})
        if "If-None-Match" not in request.headers:  # aiohttp would also compress the empty answer 304
            page.enable_compression()
        return page

    async def _on_recording(self, request: web.Request) -> web.StreamResponse:
        role = self._role(request)
        if role != DRIVE:
            return _refusal(403, _WATCHES_ONLY) if role else _refusal(401, _REFUSED_LINK)
        name = request.match_info["name"]
        try:
            if name not in {each.name for each in self._recordings}:
                raise ConfigError(f"there is no recording {name!r}")
            path = await self._loop.run_in_executor(self._files, self._robot.recordings.path, name)
        except ConfigError as error:
            return _refusal(404, str(error))
        headers = {"Content-Disposition": f'attachment; filename="{name}"', "Cache-Control": "no-store"}
        return web.FileResponse(path, headers=headers)

    # -- WebSocket

    async def _on_socket(self, request: web.Request) -> web.StreamResponse:
        link = web.WebSocketResponse(
            timeout=CLOSE_S,
            autoping=False,  # those of strangers are not answered, and others are counted
            heartbeat=HEARTBEAT_S,
            compress=False,
            max_msg_size=messages.MOST_BYTES + 1,
        )
        try:
            await link.prepare(request)
        except ValueError:
            return _refusal(400, "the key of the WebSocket cannot be read")
        transport = request.transport
        if transport is None:
            return link  # its page has gone already
        client = None if self._ending else await self._greet(link)
        if client is None:
            transport.abort()  # whatever a stranger goes on sending is not read
            return link
        self._admitted.add(transport.get_extra_info("peername"))
        self._spawn(client.pump(link.send_str, transport, link.close))
        try:
            async for message in link:
                if client.last:
                    continue
                if message.type in _DATA:
                    self._take_message(client, message.data)
                elif client.is_flooding(time.monotonic()):
                    client.end(_FLOODS)
                elif message.type is WSMsgType.PING:
                    await link.pong(message.data)
        finally:
            client.end("")
            self._leave(client)
        return link

    async def _greet(self, link: web.WebSocketResponse) -> Optional[Client]:
        """Return the client that says hello in time; None if it is not admitted, and then it gets the reason."""
        again = True
        try:
            first = await asyncio.wait_for(link.receive(), messages.HELLO_S)
            if first.type not in _DATA:
                return None
            return self._join(first.data)
        except asyncio.TimeoutError:
            why = f"the page did not say hello within {messages.HELLO_S:g} s"
        except _NoPlace as error:
            why = str(error)
        except (ConfigError, messages.Malformed) as error:
            why, again = str(error), False
        with contextlib.suppress(ConnectionError):
            await link.send_str(messages.closed(clock_s(), why, again))
            await link.close()
        return None

    # -- event stream with POST

    async def _on_session(self, request: web.Request) -> web.StreamResponse:
        try:
            client = self._join(await _body(request), _token(request))
        except messages.Malformed as error:
            return _refusal(400, str(error))
        except ConfigError as error:
            return _refusal(403, str(error))
        except _NoPlace as error:
            return web.Response(status=503, text=messages.closed(clock_s(), str(error)))
        session = secrets.token_urlsafe(16)
        self._sessions[session] = client
        return web.json_response({"session": session}, headers={"Cache-Control": "no-store"})

    def _session(self, request: web.Request) -> Client:
        """Return the client of a session; raise web.HTTPNotFound if there is none."""
        client = self._sessions.get(request.match_info["session"])
        if client is None or client.role != self._role(request):
            raise web.HTTPNotFound(text='{"why": "the session has ended"}', content_type="application/json")
        return client

    async def _on_events(self, request: web.Request) -> web.StreamResponse:
        client = self._session(request)
        response = web.StreamResponse(
            headers={"Content-Type": "text/event-stream", "Cache-Control": "no-store"}
        )
        await response.prepare(request)
        transport = request.transport
        if transport is None:
            return response  # its page has gone already
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(
            task
        )  # not by `_spawn`: what goes wrong with one page's request must not end the server
        try:
            send = lambda text: response.write(f"data: {text}\n\n".encode())  # noqa: E731
            await client.pump(send, transport, response.write_eof)
        finally:
            self._tasks.discard(task)
            self._sessions.pop(request.match_info["session"], None)
            client.end("")
            self._leave(client)
        return response

    async def _on_message(self, request: web.Request) -> web.StreamResponse:
        client = self._session(request)
        data = await _body(request)
        if not client.last:
            self._take_message(client, data)
        return web.Response(status=204)


class _Brief(logging.Filter):
    """Passes one record in `LOG_S`, as one line without a traceback.

    Anybody can cause a record with a request that is wrong.
    """

    passed_s = -math.inf

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether the record is passed, shortened then."""
        if time.monotonic() - self.passed_s < LOG_S:
            return False
        error = record.exc_info[1] if record.exc_info else None
        why = f": {type(error).__name__}: {error}" if error is not None else ""
        record.msg, record.args, record.exc_info = _brief(record.getMessage() + why), (), None
        self.passed_s = time.monotonic()
        return True


def _brief(text: str) -> str:
    """Return one line of a text that may quote a request; of a long one, its begin."""
    return one_line(text[:MOST_QUOTED])


_log = logging.getLogger(__name__)
_log.addFilter(_Brief())


class _NoPlace(Exception):
    """All places of pages are taken now."""


def _token(request: web.Request) -> str:
    """Return the token in the header of a request; empty if there is none."""
    kind, _, token = request.headers.get("Authorization", "").partition(" ")
    return token.strip() if kind.lower() == "bearer" else ""


async def _body(request: web.Request) -> bytes:
    """Return the body of a request; raise web.HTTPException if it does not arrive in time, or cannot be read."""
    try:
        return await asyncio.wait_for(request.read(), messages.HELLO_S)
    except asyncio.TimeoutError:
        raise web.HTTPRequestTimeout from None
    except web.RequestPayloadError as error:
        raise web.HTTPBadRequest(text=_brief(str(error))) from None


async def _add_headers(request: web.BaseRequest, response: web.StreamResponse) -> None:
    response.headers.update(headers_of(request.headers.get("Host", "")))
    response.headers.pop("Server", None)


def _refusal(status: int, why: str) -> web.Response:
    return web.json_response({"why": why}, status=status)
