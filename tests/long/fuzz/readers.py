"""Everything that reads, one row each: `INPUTS`.

A row reads bytes as its user would, and raises `Forbidden` for what they must never cause.
"""

import contextlib
import functools
import itertools
import math
import os
import socket
import struct
from pathlib import Path
from typing import Any, Callable, Dict, List, Tuple
from unittest import mock

from mrl_driver.apps.calibration import calibration_files, ground_truth, sonar_procedures
from mrl_driver.apps.review import drive_data, page
from mrl_driver.apps.review.findings import find
from mrl_driver.apps.tip_over import vehicle_file
from mrl_driver.apps.web import guard, messages
from mrl_driver.apps.web.helm import Control as PageControl
from mrl_driver.apps.web.helm import Drive, Go, Helm
from mrl_driver.driver import parameter_file
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.recording_summary import summarise
from mrl_driver.errors import ConfigError
from mrl_driver.host import access, named_robots
from mrl_driver.protocol import REQUESTS, Frame, FrameDecoder
from mrl_driver.protocol.hold_text import HoldText
from mrl_driver.protocol.table import BY_NAME, SETTINGS
from mrl_driver.recording.recording import Recording
from mrl_driver.robot import models
from mrl_driver.safety.message_age import MessageAge
from mrl_driver.session.events import Ready
from mrl_driver.transport import address
from mrl_driver.transport.listener import TcpListener, UdpListener
from mrl_driver.transport.relay import STOP, STOP_2013, STOPS, Bridge
from ros1_bridge.relay import relay_frames
from sim_arduino.avr.elf import read_image
from sim_arduino.board import parameter_store
from sim_arduino.board.radio_port import RadioHold
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.faults.key_values import robot_errors, sonar_errors
from sim_arduino.hardware.xbee import PacketReader
from sim_arduino.replay import mirror
from sim_arduino.serve.control import Control
from sim_arduino.world import grid_map, world_file
from tests.conformance.bench import Bench
from tests.driver.talk import Talk
from tests.firmware.pc_board import SONARS
from tests.long.fuzz.judge import CORPORA, Forbidden, Input, require_line

WATCHDOG_MS = 250
STOPPED_S = 0.7
"""Silence of the host after which no motor is driven [s]: watchdog 0.25 s, and the last bytes on the line before it."""
MOVES = {BY_NAME[name].code for name in ("move_differential", "move_motors", "move_motors_pid", "move_omni")}
MOST_WALLS = 1_000_000
DRAWN_M = 0.05  # Cells of the map that `world_node` draws [m]


def _write(folder: Path, name: str, data: bytes) -> str:
    path = folder / name
    path.write_bytes(data)
    return str(path)


def _file(input_name: str) -> Callable[[bytes, Path], object]:
    """A reader of `FILES`."""
    name, read = FILES[input_name]
    return lambda data, folder: read(_write(folder, name, data))


def _text(read: Callable[[str], object]) -> Callable[[bytes, Path], object]:
    """A reader of short texts, such as those of the command line."""
    return lambda data, folder: read(data[:2000].decode("utf-8", "replace"))


# -- files


def recording(data: bytes, folder: Path) -> None:
    """`mrl replay`, `mrl review`, `mrl plot` and `mrl export`."""
    path = _write(folder, "drive.mrl", data)
    figures = summarise(RecordedDriver(path))
    for key in ("robot", "started", "port"):
        figures[key] is None or str(figures[key])
    for line, problem in Recording(path).skipped.items():
        require_line(f"{line}: {problem}")
    made = _page(path)
    if made.count("<script") != _scripts():
        raise Forbidden("the recording brings a script into the page")


def _page(path: str) -> str:
    driven = drive_data.read(RecordedDriver(path, "auto"))
    return page.render(driven, find(driven))


@functools.lru_cache(maxsize=None)
def _scripts() -> int:
    return _page(str(CORPORA / "recording" / "drive.mrl")).count("<script")


def names(path: str) -> None:
    with mock.patch.object(named_robots, "path", lambda: path):
        for target in named_robots.read().values():
            if target.port is not None:
                address.require_port(target.port)


def world(path: str) -> None:
    found = world_file.load(path)
    if len(found.walls) > MOST_WALLS:
        raise Forbidden(f"{len(found.walls)} walls")
    grid_map.draw(found, DRAWN_M)


def picture(data: bytes, folder: Path) -> None:
    _write(folder, "map.pgm", data)
    world(_write(folder, "map.yaml", b"image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n"))


def calibration(path: str) -> None:
    progress = calibration_files.Progress(path, "traxbot", "straight", {"distance_m": 2.0})
    progress.other_runs()
    progress.runs()


def truth(path: str) -> None:
    pose = ground_truth.truth_file(path)()
    if not all(map(math.isfinite, pose)):
        raise Forbidden(f"the true pose is {pose}")


def tokens(path: str) -> None:
    os.chmod(path, 0o600)
    with mock.patch.object(access, "folder", lambda: os.path.dirname(path)):
        found = access.tokens()
    if found.role("") or found.role("x"):
        raise Forbidden("a wrong token is accepted")


def mirrored(data: bytes, folder: Path) -> None:
    moved = mock.Mock()
    mirror.follow(moved, data.decode("utf-8", "replace").splitlines())
    for call in moved.moved.call_args_list:
        if not all(map(math.isfinite, call.args)):
            raise Forbidden(f"the robot is at {call.args}")


# -- messages and connections


def page_message(data: bytes, folder: Path) -> None:
    """A message of a page that does not have the helm: it moves nothing."""
    message = messages.parse(data).value
    helm = Helm()
    for client, may_drive in ((1, True), (2, False)):
        helm.join(client, may_drive, 0.0)
    if isinstance(message, PageControl):
        acts = [act for client in (1, 2) for act in helm.control(client, message, 0.01)]
        if any(isinstance(act, (Drive, Go)) for act in acts):
            raise Forbidden("a page without the helm drives")
        speeds = (message.linear_m_s, message.angular_rad_s, message.lateral_m_s)
        if not all(abs(speed) <= messages.MOST_SPEED for speed in speeds):
            raise Forbidden(f"speeds are {speeds}")


def page_request(data: bytes, folder: Path) -> None:
    """Headers of a request, which must not lead to the page by a name that is not this computer's."""
    lines = data[:600].decode("latin-1").split("\n")
    headers = dict(line.partition(": ")[::2] for line in lines)
    why = guard.why_not(headers, ("lab3",), False)
    if why:
        require_line(why)
    elif "evil" in guard.headers_of(headers.get("Host", ""))["Content-Security-Policy"].split(";")[0]:
        raise Forbidden("another site is allowed")


def relay(data: bytes, folder: Path) -> None:
    """What another master's relay sends: no message without a known age counts as fresh."""
    frames, age = relay_frames.FrameReader(), MessageAge(60.0, 0.1)
    for part in (data[:7], data[7:]):
        for event in frames.feed(part):
            if isinstance(event, relay_frames.Hello) and event.name:
                require_line(event.name)
            if isinstance(event, relay_frames.Pong):
                age.heard(event.sent_s, event.answered_s)
            elif isinstance(event, relay_frames.Message) and age.age_s(event.stamp_s, 100.0) == -math.inf:
                raise Forbidden("a message from the end of time counts as fresh")


def port_address(text: str) -> None:
    with contextlib.suppress(ConfigError):
        address.parse(text, listening=True)
    address.require_port(text)


def client_of_tcp(data: bytes, folder: Path) -> None:
    """A client of `mrl serve`, or another program, which begins with no frame: the robot is stopped when it leaves."""
    told: List[str] = []
    link = _WrittenLink()
    listener = TcpListener(address.parse("tcp://127.0.0.1:0", listening=True))
    bridge = Bridge(lambda: link, lambda error: None, listener, told.append)  # type: ignore[arg-type]
    with socket.create_connection(("127.0.0.1", listener.address.port)) as end:
        end.sendall(data)
    stops = STOPS * STOP, STOPS * STOP_2013
    _run_until(bridge, link, lambda: link.written.endswith(stops))
    for line in told:
        require_line(line)
    if not (data in link.written if data[:1] in b"@\r\n" else link.written in stops):
        raise Forbidden("bytes were lost, or those of another program reached the board")


def client_of_udp(data: bytes, folder: Path) -> None:
    """Datagrams; an empty one, or one of another sender, changes nothing."""
    listener = UdpListener(address.parse("udp://127.0.0.1:0", listening=True))
    ends = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    try:
        for end, piece in zip(itertools.cycle(ends), (data[i : i + 999] for i in range(0, len(data), 999))):
            end.sendto(piece, ("127.0.0.1", listener.address.port))
            listener.read()
            listener.attend()
            listener.write(piece)
    finally:
        for each in (*ends, listener):
            each.close()


class _WrittenLink:
    """A link whose board says nothing."""

    port = "/dev/ttyACM0"

    def __init__(self) -> None:
        self.written = b""
        self._ends = os.pipe()

    def fileno(self) -> int:
        return self._ends[0]

    def read(self, timeout_s: float) -> bytes:
        return b""

    def write(self, data: bytes) -> None:
        self.written += data

    def close(self) -> None:
        for end in self._ends:
            os.close(end)


def _run_until(bridge: Bridge, link: Any, done: Callable[[], bool]) -> None:
    link.read = lambda timeout_s: (bridge.stop() if done() else None) and b"" or b""
    bridge.run()


# -- boards


def line_from_board(data: bytes, folder: Path) -> None:
    """What a board sends to a driver that has given no command: the driver sends no move."""
    talk = Talk().until_ready()
    talk.to_host = lambda passed: b""
    sent_s, garbage = talk.now, data
    for start in range(0, len(garbage), 500):
        talk.events += talk.session.receive(garbage[start : start + 500], talk.now)
        talk.step()
    moves = [
        event
        for checked in (False, True)
        for event in FrameDecoder(REQUESTS, checked).feed(talk.sent_since(sent_s))
        if isinstance(event, Frame) and event.code in MOVES
    ]
    if moves or not talk.seen(Ready):
        raise Forbidden(f"the driver sent {moves}")


def line_to_board(data: bytes, folder: Path) -> None:
    """What a host sends to the board: after its last frame, the robot stops."""
    for engine in _engines():
        bench = Bench(engine).wake()
        bench.ask("set_watchdog", WATCHDOG_MS)
        for start in range(0, min(len(data), 2000), 100):
            bench.send(data[start : start + 100], 0.01)
        bench.run(STOPPED_S)
        if bench.is_driven():
            raise Forbidden(f"the motors of the {engine} board are driven")
        _close(bench)


def eeprom(data: bytes, folder: Path) -> None:
    """An EEPROM image after one byte that says whether its checksum is made right.

    Nothing moves at the start, accepted parameters leave the watchdog at work, and firmware and emulator agree.
    """
    image = bytearray(data[1:1025].ljust(1024, b"\xff"))
    if data[:1] != b"0":
        _sign(image)
    found = {engine: _started(engine, bytes(image)) for engine in _engines()}
    if len(set(found.values())) > 1:
        raise Forbidden(f"firmware and emulator differ: {found}")


def _sign(image: bytearray) -> None:
    from binascii import crc_hqx

    at = parameter_store.BLOCK_AT
    end = at + 1 + 2 * len(SETTINGS)
    image[end : end + 2] = crc_hqx(bytes(image[at:end]), 0xFFFF).to_bytes(2, "little")


def _started(engine: str, image: bytes) -> Tuple[Any, ...]:
    with mock.patch("tests.conformance.bench.ready_eeprom", lambda robot, stored: image):
        bench = Bench(engine)
    bench.run(0.2)
    if bench.is_driven():
        raise Forbidden(f"the {engine} board drives at its start")
    stored = tuple(bench.reply("read_config", row.number)[1] for row in SETTINGS if not row.capability)
    bench.ask("set_watchdog", WATCHDOG_MS)
    bench.ask("move_differential", 100, 0)
    bench.run(STOPPED_S)
    if bench.is_driven():
        raise Forbidden(f"the {engine} board drives on after its host is silent")
    _close(bench)
    return stored


def _engines() -> List[str]:
    return ["python", "pc"] if SONARS.exists() else ["python"]


def _close(bench: Bench) -> None:
    with contextlib.suppress(AttributeError):
        bench.board.close()


def radio(data: bytes, folder: Path) -> None:
    """Packets of radios: the texts of one never end the hold of another, and a hold in force has stopped the motors."""
    stops: List[float] = []
    hold = RadioHold({"radio_hold": 10}, lambda: stops.append(1.0), -100.0)  # type: ignore[arg-type]
    hold.run(0.0)
    first = HoldText("hold", 7).data
    hold.receive(1, first, 0.0)
    packets = [*PacketReader().feed(data), *(data[i : i + 4] for i in range(0, len(data), 5))]
    for number, found in enumerate(packets):
        hold.receive(2 + number % 9, found, 0.001 * number)
        hold.answers()
        if not hold.held or not stops:
            raise Forbidden("another radio has ended a hold")
        if not all(-32768 <= value <= 32767 for value in hold.report()):
            raise Forbidden(f"the report is {hold.report()}")


# -- the emulator's control channel


class _Port:
    """A port that only notes whether it is plugged."""

    path, plugged = "/dev/pts/0", True

    def plug(self) -> None:
        self.plugged = True

    def unplug(self) -> None:
        self.plugged = False


def control(data: bytes, folder: Path) -> None:
    """Orders to `mrl-sim --control`; the board goes on.  Hundreds of floods are slow, because they were ordered."""
    engine = FaultyEngine(Bench("python").board, seed=1)
    reading, writing = os.pipe()
    try:
        os.write(writing, data[:1500])
        os.close(writing)
        orders = Control(engine, reading, lambda path: None, require_line)
        port: Any = _Port()
        while orders.fd is not None:
            orders.attend(port)
        for step in range(5):
            engine.receive(b"@15e")
            engine.advance(0.02 * step)
    finally:
        os.close(reading)


_YAML = b"- ;~;? ;&x ;*x;<<: ;!!int ;!!float ;|;>;{};[];---\n".split(b";")
_WORLD = b"walls;boxes;robots;map;image;heat;ambient;north;[0, 0, 0]".split(b";") + _YAML
_ROBOT = b"drive;none;omni;mecanum;tracked;sonars;imu;laser;build".split(b";") + _YAML
_REMARKS = (
    b"model ;session ;pose ;stop ;phone ;checked;plain;opened ;lost;</script><script>; > ; < ;"
    b" ! ;\\x00;\\n;@8,1,2,3,4,5e;@11,100,0e;@13e;@12e"
).split(b";")
_JSON = b'{";":;[[1]];NaN;Infinity;"type":;"held":true;"goal":[1,2];null'.split(b";")
_FRAMES = b"@;e;,;@13e;@11,100,0e;@8,1,2,3,4,5e;@e;-;\r\n".split(b";")
_FAULTS = (
    b"fault ;unplug;plug;reset;stall ;freeze ;clear;at=;lasts=;every=;rate=;loss:;flood:;"
    b"text:period=0.001;split:gap=0,size=1;repeat:;delay:;direction=to_host"
).split(b";")
FILES: Dict[str, Tuple[str, Callable[[str], object]]] = {
    "robot_yaml": ("own.yaml", models.load),
    "world_yaml": ("world.yaml", world),
    "parameter_yaml": ("lab3.yaml", parameter_file.read),
    "names_yaml": ("robots.yaml", names),
    "vehicle_yaml": ("arm.yaml", vehicle_file.read),
    "calibration_state": ("state.json", calibration),
    "truth": ("truth.jsonl", truth),
    "sonar_points": ("points.csv", sonar_procedures.read_points),
    "access_tokens": ("tokens.json", tokens),
    "firmware_image": ("image.elf", lambda path: read_image(Path(path))),
    "recording": ("drive.mrl", Recording),
}
"""Readers of one file: its name, and what reads it."""
INPUTS: Tuple[Input, ...] = (
    Input("recording", recording, _REMARKS, 20),
    Input("robot_yaml", _file("robot_yaml"), _ROBOT, 2),
    Input("world_yaml", _file("world_yaml"), _WORLD),
    Input("map_picture", picture, (b"P2", b"P5", b"#", b" 65535 "), 2),
    Input("parameter_yaml", _file("parameter_yaml"), _YAML),
    Input("names_yaml", _file("names_yaml"), (b"port", b"tcp://a:1", *_YAML)),
    Input("vehicle_yaml", _file("vehicle_yaml"), (b"contacts", b"payloads", *_YAML)),
    Input("calibration_state", _file("calibration_state"), _JSON),
    Input("truth", _file("truth"), _JSON),
    Input("sonar_points", _file("sonar_points"), (b"-", b'"', b"#", b",,")),
    Input("access_tokens", _file("access_tokens"), _JSON),
    Input("firmware_image", _file("firmware_image"), (b"\x7fELF\x01", b":00000001FF", b":02000002")),
    Input("page_message", page_message, _JSON),
    Input("page_request", page_request, (b"Host: ", b"Origin: ", b"http://evil", b"[::1]", b"@", b"localhost")),
    Input("relay", relay, (b"\x01", b"\x02", b"\x03", b"\x06\x10\0\0\0", b"\x05\x08\0\0\0")),
    Input("port_address", _text(port_address), (b"tcp://", b"udp://", b"?bind=", b"[", b"]", b"@")),
    Input("tcp_client", client_of_tcp, _FRAMES, 20),
    Input("udp_client", client_of_udp, _FRAMES, 2),
    Input("line_from_board", line_from_board, _FRAMES, 40),
    Input("line_to_board", line_to_board, _FRAMES, 40),
    Input("eeprom", eeprom, (b"\xff\xff", b"\0\0", b"\x80\x7f"), 40),
    Input("radio", radio, (b"\x7e\0\x0f\x90", b"\xf8H", b"\xf8F")),
    Input("control", control, _FAULTS, 20),
    Input("errors", _text(lambda text: (robot_errors(text), sonar_errors(text))), (b"slip=", b"noise=", b".yaml")),
    Input("mirror_lines", mirrored, (b'"pose":', *_JSON)),
)  # fmt: skip
BY_INPUT = {each.name: each for each in INPUTS}


def _kept(reader: str, name: str) -> bytes:
    return (CORPORA / reader / name).read_bytes()


def _long_names() -> bytes:
    """An image with many symbols, all of whose names lie in one text of a megabyte."""
    header = list(struct.unpack("<16sHHIIIIIHHHHHH", _kept("firmware_image", "tiny.elf")[:52]))
    count, names_at = 20_000, 52 + 2 * 40
    header[6], header[10], header[11], header[12] = 52, 0, 40, 2
    symbols_at = names_at + 1_000_000
    sections = ((3, names_at, 1_000_000, 0), (2, symbols_at, 16 * count, 0))
    return b"".join(
        (
            struct.pack("<16sHHIIIIIHHHHHH", *header),
            *(
                struct.pack("<10I", 0, kind, 0, 0, at, size, link, 0, 0, 0)
                for kind, at, size, link in sections
            ),
            b"a" * 999_999 + b"\0",
            *(struct.pack("<IIIBBH", 1 + number, number, 1, 0, 0, 1) for number in range(count)),
        )
    )


HOSTILE: Tuple[Tuple[str, str, Callable[[], bytes]], ...] = (
    ("map_picture", "a number of 20000 digits", lambda: b"P2 9 9 255\n" + b"9" * 20_000 + b" 1" * 160_000),
    (
        "map_picture",
        "a chessboard",
        lambda: b"P5 4000 4000 255\n" + (b"\0\xff" * 2000 + b"\xff\0" * 2000) * 2000,
    ),
    ("map_picture", "a header of blanks", lambda: b"P5" + b" " * 50_000_000),
    ("world_yaml", "far walls", lambda: b"walls: [[-1000, -1000, 1000, 1000]]"),
    ("world_yaml", "long walls", lambda: b"walls: [" + b"[-1000, 0, 1000, 0], " * 20_000 + b"]"),
    ("firmware_image", "long names", _long_names),
    ("recording", "lines that are none", lambda: _kept("recording", "drive.mrl") + b"\nx" * 5_000_000),
)
"""Inputs of strangers that are too long for the corpora: what they want, and what makes them."""


def require_input(name: str) -> Input:
    """The row with this name.

    Raises:
        ConfigError: there is none.
    """
    if name not in BY_INPUT:
        raise ConfigError(f"input {name!r} is unknown, expected {', '.join(BY_INPUT)}")
    return BY_INPUT[name]
