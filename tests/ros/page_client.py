"""A page without a browser: a WebSocket that holds a control, and the messages of the server."""

import asyncio
import contextlib
import json
import threading
import time

from tests.waiting import wait_until

PERIOD_S = 0.05


class PageClient:
    """Connects to the page at `url`; its thread sends as a page does.

    Attributes:
        seen: all messages of the server.
        last: the newest message of each type.
    """

    def __init__(self, url, name="tests"):
        self.seen, self.last = [], {}
        self._url, self._name = url, name
        self._speeds, self._press = None, 0
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), daemon=True)
        self._thread.start()
        self.wait(lambda: "welcome" in self.last, "a welcome")

    def hold(self, linear, angular=0.0):
        """Press a control and hold it; another press than the one before."""
        self._press += 1
        self._speeds = {"linear": linear, "angular": angular, "lateral": 0.0}

    def let_go(self):
        """Release the control."""
        self._speeds = None

    def say(self, kind, **fields):
        """Send another message."""
        self._loop.call_soon_threadsafe(self._waiting.put_nowait, {"type": kind, **fields})

    def release(self):
        """Release the emergency stop that the newest message showed."""
        self.say("release", heard=self._heard[0])

    def wait(self, condition, what="a message"):
        return wait_until(condition, step_s=0.02, what=f"{what} of the page")

    def after(self, kind, condition=lambda message: True):
        """Wait for a message that arrives from now on, and return it."""
        begin = len(self.seen)
        found = []

        def arrived():
            found[:] = [each for each in self.seen[begin:] if each["type"] == kind and condition(each)]
            return found

        self.wait(arrived, kind)
        return found[0]

    def close(self):
        self.say("close")
        self._thread.join()

    async def _serve(self):
        import aiohttp

        self._loop, self._waiting = asyncio.get_running_loop(), asyncio.Queue()
        async with aiohttp.ClientSession() as session, session.ws_connect(self._url + "ws") as socket:
            await socket.send_str(json.dumps({"type": "hello", "token": "", "name": self._name}))
            reader = asyncio.ensure_future(self._read(socket))
            with contextlib.suppress(ConnectionError):  # the server has gone
                await self._write(socket)
            await socket.close()
            await reader

    async def _read(self, socket):
        async for message in socket:
            got = json.loads(message.data)
            self._heard = got["at"], time.monotonic() * 1000
            self.seen.append(got)
            self.last[got["type"]] = got

    async def _write(self, socket):
        number = 0
        while "welcome" not in self.last:
            await asyncio.sleep(0.005)
        while True:
            number += 1
            speeds, (heard, heard_t) = self._speeds, self._heard
            times = {"t": time.monotonic() * 1000, "heard": heard, "heard_t": heard_t}
            control = {"type": "control", "seq": number, "press": self._press, "held": bool(speeds)}
            await socket.send_str(json.dumps({**control, **times, **(speeds or {})}))
            try:
                message = await asyncio.wait_for(self._waiting.get(), PERIOD_S)
            except asyncio.TimeoutError:
                continue
            if message["type"] == "close":
                return
            await socket.send_str(json.dumps(message))
