"""The page's server with a robot that notes what it is told, and aiohttp's client as the page."""

import asyncio
import contextlib
import errno
import itertools
import json
import time
from unittest import mock

import pytest

from mrl_driver.apps.web import client, listening, messages
from mrl_driver.apps.web.helm import Helm, Why, why_of
from mrl_driver.apps.web.robot import Recorded
from mrl_driver.errors import ConfigError
from mrl_driver.host.access import Tokens
from mrl_driver.protocol.stop_reason import StopReason
from tests.waiting import PATIENCE_S

from .fake_robot import FakeRobot

TOKENS = Tokens("d" * 32, "e" * 32)
LONG_S = 1000.0
FREE = listening.Settings(port=0)
GUARDED = listening.Settings(port=0, tokens=TOKENS)


class Page:
    """The messages of one page, over its WebSocket or over a session with POST."""

    def __init__(self, send, receive):
        self._send, self._receive = send, receive
        self._seq = itertools.count(1)
        self.heard = None
        self.seen = []

    async def send(self, kind, **fields):
        await self._send(json.dumps({"type": kind, **fields}))

    async def next(self, kind, what=lambda message: True):
        """The next message of this kind for which `what` holds."""
        while True:
            message = await self._receive()
            self.heard = message["at"], time.monotonic() * 1000
            self.seen.append(message)
            if message["type"] == kind and what(message):
                return message

    async def control(self, press, held, **fields):
        heard, heard_t = self.heard
        times = {"t": time.monotonic() * 1000, "heard": heard, "heard_t": heard_t}
        speeds = {"linear": 0.2, "angular": 0.0, "lateral": 0.0} if held and not fields else fields
        await self.send("control", seq=next(self._seq), press=press, held=held, **times, **speeds)

    async def take(self):
        """Take the helm, and show that no control is held."""
        await self.send("take")
        await self.next("helm", lambda state: state["driver"] is not None)
        await self.control(0, False)


class Site:
    """The server of a test, and what its clients need."""

    def __init__(self, server, session, robot):
        self.server, self.session, self.robot = server, session, robot
        self.url = f"http://127.0.0.1:{server.port}"

    @property
    def clients(self):
        """Number of pages that have said hello."""
        return len(self.server._clients)

    @contextlib.asynccontextmanager
    async def page(self, token="", name="desk", **options):
        """A page over a WebSocket that has said hello."""
        async with self.session.ws_connect(f"{self.url}/ws", **options) as link:
            page = Page(link.send_str, link.receive_json)
            page.link = link
            await page.send("hello", token=token, name=name)
            yield page

    @contextlib.asynccontextmanager
    async def stalled_page(self):
        """A page that says hello and then reads nothing."""
        hello = b'{"type": "hello", "token": "", "name": "stalled"}'
        _, writer = await asyncio.open_connection("127.0.0.1", self.server.port)
        writer.transport.pause_reading()
        writer.write(
            b"GET /ws HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
            b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
            b"\x81" + bytes([0x80 + len(hello)]) + b"\0\0\0\0" + hello
        )
        yield
        writer.transport.abort()

    @contextlib.asynccontextmanager
    async def posting_page(self, token=""):
        """A page over an event stream and POST."""
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        hello = json.dumps({"type": "hello", "token": "", "name": "phone"})
        async with self.session.post(f"{self.url}/session", data=hello, headers=headers) as answer:
            assert answer.status == 200
            path = f"{self.url}/session/{(await answer.json())['session']}"

        async def send(text):
            async with self.session.post(path, data=text, headers=headers) as answer:
                assert answer.status == 204, answer

        async with self.session.get(f"{path}/events", headers=headers) as stream:

            async def receive():
                async for line in stream.content:
                    if line.startswith(b"data: "):
                        return json.loads(line[6:])
                raise AssertionError("the stream has ended")

            page = Page(send, receive)
            page.path = path
            yield page

    async def until(self, condition):
        """Wait for something that the server does."""
        while not condition():
            await asyncio.sleep(0.002)


def serving(scenario, settings=FREE, robot=None, stop_s=LONG_S):
    """Serve a robot to a coroutine, which gets the `Site`.  On a busy machine no command and no session is too old."""
    import aiohttp

    from mrl_driver.apps.web.server import Server

    async def run():
        served = robot or FakeRobot()
        server = Server(served, settings)
        await server.start()
        try:
            connector = aiohttp.TCPConnector(ssl=False)  # certificates of tests are nobody's
            async with aiohttp.ClientSession(connector=connector) as session:
                await asyncio.wait_for(scenario(Site(server, session, served)), PATIENCE_S)
        finally:
            await server.close("the test is over")

    with mock.patch("mrl_driver.apps.web.helm.DEAF_S", LONG_S), mock.patch(
        "mrl_driver.apps.web.server.Helm", lambda: Helm(stop_s, LONG_S, 2 * LONG_S)
    ), mock.patch("mrl_driver.apps.web.server.SILENT_S", LONG_S):
        asyncio.run(run())


def pages(scenario):
    """A test of one page over each of both ways."""

    @pytest.mark.parametrize("way", ["page", "posting_page"])
    def test(way):
        async def run(site):
            async with getattr(site, way)() as page:
                await scenario(site, page)

        serving(run)

    return test


# -- what a page is shown


@pytest.mark.parametrize(
    ("way", "written"), [("page", "WebSocketResponse.send_str"), ("posting_page", "StreamResponse.write")]
)
def test_a_connection_that_ends_while_it_is_written_to_ends_alone(way, written):
    async def fail(*_):
        raise AttributeError("as of Python 3.11's TLS transport")

    async def run(site):
        with mock.patch(f"aiohttp.web.{written}", fail), contextlib.suppress(Exception):
            async with getattr(site, way)() as page:
                await page.next("view")
        await site.until(lambda: not site.clients)
        async with site.page() as page:
            await page.next("view")

    serving(run)


@pytest.mark.parametrize("part", [asyncio.Transport, asyncio.Protocol])
def test_a_callback_of_one_connection_that_fails_ends_no_server(part):
    """Python 3.11.2: a TLS connection that ends while it is written to is closed twice, and the second time fails."""

    class Broken(part):
        def fail(self):
            raise AttributeError

    async def scenario(site):
        asyncio.get_running_loop().call_soon(Broken().fail)
        await goes_on(site)

    serving(scenario)


@pages
async def test_each_report_of_the_robot_is_a_sample(site, page):
    await page.next("view")
    site.robot.values = [0.5, float("nan"), float("inf")]
    site.robot.changed()
    assert (await page.next("sample", lambda sample: sample["v"][0] == 0.5))["v"] == [0.5, None, "inf"]


# -- driving


@pages
async def test_a_held_control_drives_and_its_release_stops(site, page):
    await page.take()
    await page.control(1, True)
    await page.next("helm", lambda state: state["driving"])
    await page.control(1, False)
    await page.next("helm", lambda state: not state["driving"])
    assert site.robot.calls == [("drive", 0.2, 0.0, 0.0), ("stop",)]


@pages
async def test_a_robot_that_refuses_a_command_spends_the_press(site, page):
    site.robot.refuses = Why(StopReason.BATTERY, "the battery is empty")
    await page.take()
    await page.control(7, True)
    state = await page.next("helm", lambda state: 7 in state["spent"].values())
    assert (state["why"], state["reason"]) == ("the battery is empty", "battery")


@pages
async def test_a_robot_that_stops_by_itself_spends_the_press(site, page):
    await page.take()
    await page.control(7, True)
    await page.next("helm", lambda state: state["driving"])
    site.robot.stopped_by = why_of(StopReason.WHEEL_MISMATCH)
    site.robot.changed()
    assert (await page.next("helm", lambda state: not state["driving"]))["reason"] == "wheel_mismatch"


@pages
async def test_only_a_phone_that_drives_passes_its_sensors_on(site, page):
    reading = {"alpha": 1, "beta": 2, "gamma": 3, "absolute": False, "acceleration": None, "rotation": None}
    await page.send("phone", t=5, **reading)
    await page.take()
    await page.send("phone", t=6, **reading)
    await site.until(lambda: site.robot.readings)
    assert [reading.t_s for reading in site.robot.readings] == [0.006]


def test_the_robot_stops_when_its_page_sends_nothing_more():
    async def scenario(site):
        async with site.page() as page:
            await page.take()
            await page.control(1, True)
            await page.next("helm", lambda state: state["reason"] == "command_timeout")
            assert site.robot.calls == [("drive", 0.2, 0.0, 0.0), ("stop",)]

    serving(scenario, stop_s=0.05)


def test_a_page_that_goes_away_stops_its_robot():
    async def scenario(site):
        async with site.page(name="other") as other:
            async with site.page() as page:
                await page.take()
                await page.control(1, True)
                await page.next("helm", lambda state: state["driving"])
            state = await other.next("helm", lambda state: state["why"])
            assert (state["reason"], state["driver"]) == ("page_left", None)
            assert site.robot.calls[-1] == ("stop",)

    serving(scenario)


def test_a_watch_only_page_stops_the_robot_and_cannot_drive():
    async def scenario(site):
        async with site.page(TOKENS.watch) as page:
            assert (await page.next("welcome"))["role"] == "watch"
            await page.send("take")
            assert "watching" in (await page.next("refused"))["why"]
            await page.send("stop")
            await page.next("helm", lambda state: state["latched"])
        assert ("latch",) in site.robot.calls

    serving(scenario, GUARDED)


# -- clients that are slow, silent or too many


def test_a_stalled_page_delays_no_other_and_is_closed(monkeypatch):
    """It never reads; the samples are large, so that its buffers are soon full."""
    monkeypatch.setattr(client, "STALLED_S", 1.0)

    async def scenario(site):
        site.robot.values = [0.123456789] * 4000
        async with site.page(name="good") as page, site.stalled_page():
            await page.next("helm", lambda state: len(state["names"]) == 2)
            while site.clients == 2:
                site.robot.changed()
                await page.next("sample")
            await page.take()
            await page.control(1, True)
            await page.next("helm", lambda state: state["driving"])

    serving(scenario)


def test_one_page_too_many_is_told_why_and_may_come_again(monkeypatch):
    """One whose link was lost must get its STOP button back."""
    monkeypatch.setattr("mrl_driver.apps.web.server.MOST_CLIENTS", 1)

    async def scenario(site):
        async with site.page() as first:
            await first.next("welcome")
            async with site.page() as page:
                closed = await page.next("closed")
                assert "1 pages show this robot already" in closed["why"] and closed["again"]
            async with site.session.post(f"{site.url}/session", data=HELLO) as answer:
                assert (answer.status, json.loads(await answer.text())["why"]) == (503, closed["why"])

    serving(scenario)


def test_pages_that_watch_leave_room_for_one_that_drives(monkeypatch):
    monkeypatch.setattr("mrl_driver.apps.web.server.MOST_CLIENTS", 1)
    monkeypatch.setattr("mrl_driver.apps.web.server.FOR_DRIVING", 1)

    async def scenario(site):
        async with site.page(TOKENS.watch) as watches, site.page(TOKENS.drive) as drives:
            assert "show this robot already" in (await watches.next("closed"))["why"]
            assert (await drives.next("welcome"))["role"] == "drive"

    serving(scenario, GUARDED)


def test_a_connection_counts_before_its_handshake(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    monkeypatch.setattr("mrl_driver.apps.web.server.MOST_CONNECTIONS", 2)
    monkeypatch.setattr("mrl_driver.apps.web.server.HANDSHAKE_S", LONG_S)
    settings = listening.settings_for("0.0.0.0:0")

    async def scenario(site):
        site.url = site.url.replace("http", "https")
        silent = [await asyncio.open_connection("127.0.0.1", site.server.port) for _ in range(3)]
        assert await ended(silent[0][0])
        async with site.page(settings.tokens.drive) as page:
            await page.next("welcome")
            assert await ended(silent[1][0])
        silent[2][1].close()

    serving(scenario, settings)


async def ended(reader):
    """The server has closed a connection on which it sent nothing."""
    with contextlib.suppress(ConnectionError):
        return await reader.read() == b""
    return True


HELLO = b'{"type": "hello", "token": "", "name": "page"}'
UPGRADE = (
    b"GET /ws HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
    b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: %s\r\n\r\n"
)


@pytest.mark.parametrize(
    "request_bytes",
    [
        b"GET /page/" + 300 * b"x" + b" HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET /page/" + 80 * b"%F0%9F%98%80" + b" HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"POST /session HTTP/1.1\r\nHost: localhost\r\nContent-Encoding: gzip\r\nContent-Length: 5\r\n\r\nabcde",
        UPGRADE % b"\xff\xff",
        b"GET /recordings/gone.mrl HTTP/1.1\r\nHost: localhost\r\n\r\n",
    ],
    ids=["long name", "long name in bytes", "body", "key", "recording that was deleted"],
)
def test_a_request_that_cannot_be_served_is_refused_and_the_server_goes_on(request_bytes):
    robot = FakeRobot()
    robot.recordings.files = lambda: [Recorded("gone.mrl", 1, False)]
    robot.recordings.path = mock.Mock(side_effect=ConfigError("there is no recording"))

    async def scenario(site):
        reader, writer = await asyncio.open_connection("127.0.0.1", site.server.port)
        writer.write(request_bytes)
        assert b"HTTP/1.1 4" in await reader.readuntil(b"\r\n")
        writer.close()
        await goes_on(site)

    serving(scenario, robot=robot)


async def goes_on(site):
    """The server has not been told to end, and has no page but this one."""
    await site.until(lambda: not site.clients)
    async with site.page() as page:
        await page.next("welcome")
        assert not site.server._over.done()


def test_a_page_that_floods_the_server_is_closed_but_its_stop_counts(monkeypatch):
    monkeypatch.setattr(client, "MOST_PER_S", 3)
    count, begin_s = client.Client.is_flooding, time.monotonic()
    monkeypatch.setattr(client.Client, "is_flooding", lambda page, now_s: count(page, begin_s))  # one second

    async def scenario(site):
        async with site.page() as page:
            for _ in range(3):
                await page.send("ping", t=0, heard=None, heard_t=None)
            await page.send("stop")
            await page.send("ping", t=0, heard=None, heard_t=None)
            assert "too many" in (await page.next("closed"))["why"]
            assert ("latch",) in site.robot.calls

    serving(scenario)


def test_pings_of_a_page_are_answered_and_counted(monkeypatch):
    monkeypatch.setattr(client, "MOST_PER_S", 3)
    count, begin_s = client.Client.is_flooding, time.monotonic()
    monkeypatch.setattr(client.Client, "is_flooding", lambda page, now_s: count(page, begin_s))  # one second

    async def scenario(site):
        async with site.page(autoping=False) as page:
            for _ in range(4):
                await page.link.ping()
            seen = []
            while not page.link.closed:
                seen.append(await page.link.receive())
            assert sum(each.type.name == "PONG" for each in seen) == 3
            assert any("too many" in each.data for each in seen if each.type.name == "TEXT")

    serving(scenario)


def test_a_stranger_who_pings_before_hello_is_cut_off_without_an_answer():
    async def scenario(site):
        reader, writer = await asyncio.open_connection("127.0.0.1", site.server.port)
        writer.write(UPGRADE % (22 * b"A" + b"==") + 2 * b"\x89\x80\0\0\0\0")
        await reader.readuntil(b"\r\n\r\n")
        assert await ended(reader)
        writer.close()

    serving(scenario)


# -- who may see the page


@pytest.mark.parametrize("token", ["", "f" * 32])
def test_a_wrong_token_is_refused_with_the_reason(token):
    async def scenario(site):
        async with site.page(token) as page:
            closed = await page.next("closed")
            assert "link is not valid" in closed["why"] and not closed["again"]
        hello = json.dumps({"type": "hello", "token": token, "name": ""})
        async with site.session.post(f"{site.url}/session", data=hello) as answer:
            assert answer.status == 403

    serving(scenario, GUARDED)


@pytest.mark.parametrize("way", ["page", "posting_page"])
def test_new_tokens_end_the_pages_of_old_links(way, monkeypatch):
    monkeypatch.setattr("mrl_driver.apps.web.server.TOKENS_S", 0.0)
    new, stored = Tokens("1" * 32, "2" * 32), [None]

    async def scenario(site):
        async with getattr(site, way)(TOKENS.drive) as page:
            await page.next("welcome")
            stored[0] = new
            assert "made new" in (await page.next("closed"))["why"]
        async with site.page(TOKENS.drive) as page:
            assert "not valid" in (await page.next("closed"))["why"]
        async with site.page(new.watch) as page:
            assert (await page.next("welcome"))["role"] == "watch"

    def renewed():
        found, stored[0] = stored[0], None
        return found

    serving(scenario, GUARDED._replace(renewed=renewed))


def test_a_session_serves_nobody_without_its_token():
    async def scenario(site):
        async with site.posting_page(TOKENS.drive) as page:
            await page.next("welcome")
            async with site.session.post(page.path, data='{"type": "take"}') as answer:
                assert answer.status == 404

    serving(scenario, GUARDED)


@pytest.mark.parametrize("path", ["/", "/ws", "/session"])
@pytest.mark.parametrize(
    "headers", [{"Host": "evil.example"}, {"Origin": "http://evil.example"}, {"Origin": "null"}], ids=str
)
def test_other_sites_and_names_are_refused(path, headers):
    """DNS rebinding, and pages of other sites in the browser of somebody who drives."""

    async def scenario(site):
        async with site.session.get(site.url + path, headers=headers) as answer:
            assert answer.status == 403

    serving(scenario)


def test_a_recording_needs_the_link_to_drive_and_is_in_the_list(tmp_path):
    robot = FakeRobot(tmp_path)

    async def scenario(site):
        async with site.page(TOKENS.drive) as page:
            await page.send("record", on=True)
            await page.next("recording", lambda state: state["on"])
            await page.send("record", on=False)
            ended = await page.next("recording", lambda state: not state["on"] and state["files"])
            assert ended["files"][0]["name"] == "new.mrl"
        for token, path, status in (
            ("", "new.mrl", 401),
            (TOKENS.watch, "new.mrl", 403),
            (TOKENS.drive, "new.mrl", 200),
            (TOKENS.drive, "..%2Fother", 404),
        ):
            headers = {"Authorization": f"Bearer {token}"}
            async with site.session.get(f"{site.url}/recordings/{path}", headers=headers) as answer:
                assert answer.status == status

    serving(scenario, GUARDED, robot)


def test_beyond_this_computer_the_page_is_encrypted(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    settings = listening.settings_for("0.0.0.0:0")

    async def scenario(site):
        site.url = site.url.replace("http", "https")
        for way in (site.page, site.posting_page):
            async with way(settings.tokens.drive) as page:
                assert (await page.next("welcome"))["role"] == "drive"
                site.robot.changed()
                await page.next("sample")
        await site.until(lambda: not site.clients)

    serving(scenario, settings)


def test_the_name_that_the_links_have_is_one_of_the_servers(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    settings = listening.settings_for("robot.lab.example:0")._replace(host="127.0.0.1", context=None)

    async def scenario(site):
        async with site.session.get(f"{site.url}/", headers={"Host": "robot.lab.example:8642"}) as answer:
            assert answer.status == 200

    serving(scenario, settings)


# -- files of the page


@pytest.mark.parametrize(
    "name", ["..%2Fserver.py", "vendor%2F..%2F..%2Fserver.py", "%2Fetc%2Fpasswd", "vendor", "%2E"]
)
def test_no_name_leads_out_of_the_folder_of_the_page(name):
    from yarl import URL

    async def scenario(site):
        async with site.session.get(URL(f"{site.url}/page/{name}", encoded=True)) as answer:
            assert answer.status == 404

    serving(scenario)


def test_a_file_of_the_page_is_sent_again_only_if_it_has_changed():
    async def scenario(site):
        async with site.session.get(f"{site.url}/page/main.js") as answer:
            assert answer.status == 200 and answer.headers["Content-Encoding"] in ("deflate", "gzip")
            assert "javascript" in answer.content_type and "import" in await answer.text()
            tag = {"If-None-Match": answer.headers["ETag"]}
        async with site.session.get(f"{site.url}/page/main.js", headers=tag) as answer:
            assert answer.status == 304

    serving(scenario)


# -- the end


def test_at_the_end_the_robot_is_stopped_first_and_pages_get_the_reason():
    async def scenario(site):
        async with site.page() as page:
            await page.next("welcome")
            site.robot.calls.clear()
            site.server.end("mrl web has ended")
            assert site.robot.calls == [("stop",)]
            assert await site.server.wait() == "mrl web has ended"
            closing = asyncio.ensure_future(site.server.close("mrl web has ended"))
            assert (await page.next("closed"))["why"] == "mrl web has ended"
            await closing

    serving(scenario)


def test_an_error_of_this_program_stops_the_robot_and_ends_the_server():
    robot = FakeRobot()

    async def scenario(site):
        async with site.page() as page:
            await page.take()
            robot.drive = lambda *speeds: 1 / 0
            await page.control(1, True)
            with pytest.raises(ZeroDivisionError):
                await site.server.wait()
        assert robot.calls[-1] == ("stop",)

    serving(scenario, robot=robot)


@pytest.mark.parametrize("text", ["", ":8642", "127.0.0.1:99999", "http://127.0.0.1", "::1"])
def test_what_is_no_address_is_refused(text):
    with pytest.raises(ConfigError, match="expected ADDRESS or ADDRESS:PORT"):
        listening.settings_for(text)


def throw(error):
    raise error


def test_sockets_without_a_token_take_no_place():
    async def scenario(site):
        async with contextlib.AsyncExitStack() as strangers:
            for _ in range(40):
                await strangers.enter_async_context(site.session.ws_connect(f"{site.url}/ws"))
            async with site.page(TOKENS.drive) as page:
                assert (await page.next("welcome"))["role"] == "drive"

    serving(scenario, GUARDED)


def test_a_silent_page_gives_its_place_to_the_next(monkeypatch):
    monkeypatch.setattr("mrl_driver.apps.web.server.MOST_CLIENTS", 1)

    async def scenario(site):
        async with site.page(name="silent") as silent:
            await silent.next("welcome")
            monkeypatch.setattr("mrl_driver.apps.web.server.SILENT_S", 0.0)
            async with site.page(name="next") as page:
                await page.next("welcome")
                assert "needed its place" in (await silent.next("closed"))["why"]
                assert site.clients == 1

    serving(scenario)


def test_without_a_free_descriptor_the_server_accepts_later(monkeypatch):
    async def scenario(site):
        accept, fails = site.server._socket.accept, [OSError(errno.EMFILE, "Too many open files")]
        ear = mock.Mock(
            wraps=site.server._socket, accept=lambda: accept() if not fails else throw(fails.pop())
        )
        monkeypatch.setattr(site.server, "_socket", ear)
        async with site.page() as page:
            await page.next("welcome")
        assert not fails

    serving(scenario)


def test_a_message_that_is_too_long_closes_the_page():
    async def scenario(site):
        async with site.page() as page:
            await page.next("welcome")
            await page.send("hello", token="", name="x" * messages.MOST_BYTES)
            while not page.link.closed:
                await page.link.receive()
            assert page.link.close_code == 1009

    serving(scenario)


def test_the_page_loads_nothing_from_elsewhere_and_is_in_no_frame():
    async def scenario(site):
        async with site.session.get(f"{site.url}/") as answer:
            policy = answer.headers["Content-Security-Policy"]
            assert "default-src 'self'" in policy and "frame-ancestors 'none'" in policy
            assert answer.headers["X-Content-Type-Options"] == "nosniff"

    serving(scenario)


def test_a_watch_only_page_is_told_of_no_recording():
    robot = FakeRobot()
    robot.recordings.files = lambda: [Recorded("old.mrl", 1, False)]

    async def scenario(site):
        async with site.page(TOKENS.watch) as page:
            assert (await page.next("recording"))["files"] == []

    serving(scenario, GUARDED, robot)
