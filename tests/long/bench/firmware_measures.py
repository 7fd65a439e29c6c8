"""What is measured on the firmware image, one function per figure; times are simulated.

"Turnaround" runs from the end of the request's last stop bit to the end of the reply's, "command" to that of
the I2C write that carries it out.  Requests come at random phases of a fixed seed.
"""

from statistics import median
from typing import Callable, Dict, Iterable, List, Optional, Tuple

from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.table import BAUD, COMMANDS
from tests.firmware.imu_chip import GYRO_DATA
from tests.long.bench.firmware_board import Reply, Rig, request
from tests.long.bench.report import either

REQUESTS = either(300, 15)
REQUEST_S = either(20e-3, 5e-3)  # Time of each of all requests
STREAM_COMMANDS = either(1000, 15)
STREAM_S, PERIODS_S = either((2.0, 10.0), (0.3, 0.3))
"""Time of a stream as fast as it goes, and of one with a period."""
EXACT = range(-32768, 32768, either(1, 1024))
WATCHDOG_STOPS, HANGS = either((30, 40), (2, 4))
MOVE, STOP = 0xEB, 0xFC  # motor board commands
WIDEST = 32767
BUS_FAULTS = ("sda", "scl", "absent", "stretch")
COMMAND_BYTES = 13
BYTE_CYCLES = 1360  # 10 bits at UBRR 16 with U2X
MakeRig = Callable[[], Rig]


def turnarounds_us(rig: Rig, asked: bytes) -> List[float]:
    times = []
    for _ in range(REQUESTS):
        rig.hold_counts()
        rig.replies()
        end = rig.send_somewhen(asked, 20e-3)
        reply = rig.await_value(lambda: next(iter(rig.replies()), None), end, 0.1)
        if reply is None:
            raise TimeoutError(f"no answer to {asked!r} within 0.1 s of simulated time")
        times.append(rig.microseconds(reply.end_cycle - end))
    return times


def turnaround_figures(make: MakeRig) -> Dict[str, float]:
    rig = make().settle()
    keys = {"encoders": b"@6e", "encoders_sonars": b"@8e", "info": b"@5e"}
    figures = {
        f"{key}_turnaround_us_median": median(turnarounds_us(rig, asked)) for key, asked in keys.items()
    }
    rig.close()
    return figures


def stream_of(rig: Rig, seconds: float) -> List[Reply]:
    """Frames of a running stream over a duration, the first 50 ms dropped."""
    rig.run(50e-3)
    rig.forget()
    rig.run(seconds)
    return rig.replies()[1:]


def wire_use(rig: Rig, frames: List[Reply]) -> float:
    """Share of the time between the first and the last frame's end in which a byte is on the wire."""
    begin, end = frames[0].end_cycle, frames[-1].end_cycle
    lines = frames[1:] + [one for one in rig.imu_frames if begin < one.end_cycle <= end]
    return sum(len(frame.line) for frame in lines) * BYTE_CYCLES / (end - begin)


def hertz(rig: Rig, frames: List[Reply]) -> float:
    """Mean rate of the frames [1/s]."""
    return (len(frames) - 1) / ((frames[-1].end_cycle - frames[0].end_cycle) / rig.machine.frequency_hz)


def stream_figures(make: MakeRig) -> Dict[str, float]:
    """Rate, use of the wire and jitter of the stream of 8."""
    rig = make().settle()
    rig.machine.send(request("start_stream"))
    frames = stream_of(rig, STREAM_S)
    figures = {"stream_typical_hz": hertz(rig, frames), "stream_wire_use": wire_use(rig, frames)}
    rig.machine.send(request("start_stream", 20))
    starts = [frame.start_cycle for frame in stream_of(rig, PERIODS_S)]
    rig.close()
    return {**figures, "stream_jitter_us": spread_us(rig, starts)}


def spread_us(rig: Rig, cycles: List[int]) -> float:
    """Largest minus smallest gap [us]."""
    gaps = [later - earlier for earlier, later in zip(cycles, cycles[1:])]
    return rig.microseconds(max(gaps) - min(gaps))


def imu_figures(make: MakeRig) -> Dict[str, float]:
    """The IMU's stream of 100 Hz: its rate next to a stream of 8 as fast as it goes, and the spread of the gaps between
    its readings next to one of 20 ms; and what the serial link then leaves to the stream of 8, whose frames of 27 bytes
    need all of it without the IMU."""
    rig = make().settle()
    rig.machine.send(request("start_stream"))
    frames = stream_of(rig, STREAM_S)
    imu_hz, imu_bytes = hertz(rig, rig.imu_frames), len(rig.imu_frames[-1].line)
    left_hz = (rig.machine.frequency_hz / BYTE_CYCLES - imu_hz * imu_bytes) / len(frames[-1].line)
    rig.machine.send(request("start_stream", 20))
    rig.run(0.1)
    rig.forget()
    rig.run(STREAM_S)
    reads = [one.cycle for one in rig.writes(GYRO_DATA)]
    rig.close()
    return {"imu_hz": imu_hz, "stream_left_hz": left_hz, "imu_jitter_us": spread_us(rig, reads)}


def count_age_figures(make: MakeRig) -> Dict[str, float]:
    """Largest time from the reading of counts to the first byte of their frame, in a running stream."""
    rig = make().settle()
    rig.machine.send(request("start_stream"))
    rig.motors.changing = True
    ages = [
        frame.start_cycle / rig.machine.frequency_hz - rig.motors.count_reads[counts_of(frame)]
        for frame in stream_of(rig, 0.2)
    ]
    rig.close()
    return {"count_age_ms_max": 1e3 * max(ages)}


def counts_of(frame: Reply) -> Tuple[int, int]:
    values = frame.line.split(b"e")[0].split(b",")
    return int(values[1]), int(values[2])


def checked_stream_figures(make: MakeRig) -> Dict[str, float]:
    """Use of the wire with check value, sequence and board time, and frames that the decoder refuses."""
    rig = make().settle()
    rig.ask(request("set_check", 1))
    rig.machine.send(request("start_stream", checked=True))
    frames = stream_of(rig, 1.0)
    decoder = FrameDecoder(REPLIES, checked=True)
    events = [event for frame in frames for event in decoder.feed(frame.line)]
    rig.close()
    bad = sum(not isinstance(event, Frame) for event in events)
    return {"stream_checked_wire_use": wire_use(rig, frames), "stream_checked_frames_bad": bad}


def command_delays_us(rig: Rig, command: bytes, code: int, count: int) -> List[float]:
    """Delays of commands at random phases, one every 5 to 15 ms."""
    delays = []
    for _ in range(count):
        rig.forget()
        end = rig.send_somewhen(command, 10e-3)
        rig.machine.run_until(end + int(5e-3 * rig.machine.frequency_hz))
        writes = [write for write in rig.writes(code) if write.cycle > end]
        if not writes:
            raise TimeoutError(f"{command!r} reached no motor board within 5 ms of simulated time")
        delays.append(rig.microseconds(writes[0].cycle - end))
    return delays


def command_figures(make: MakeRig) -> Dict[str, float]:
    """Delays of move and stop, idle and behind a full-rate stream."""
    rig = make().settle()
    idle = command_delays_us(rig, b"@11,500,-800e", MOVE, REQUESTS)
    rig.machine.send(request("start_stream"))
    moves = command_delays_us(rig, b"@11,500,-800e", MOVE, STREAM_COMMANDS)
    stops = command_delays_us(rig, b"@13e", STOP, REQUESTS)
    rig.close()
    return {
        "move_idle_us_max": max(idle),
        "move_streaming_us_max": max(moves),
        "stop_streaming_us_max": max(stops),
    }


def moves_at(make: MakeRig, rate_hz: float, seconds: float) -> bool:
    """Do all 13-byte commands of a rate arrive unaltered and in order behind a full-rate stream?"""
    rig = make().settle()
    rig.machine.send(request("start_stream"))
    rig.run(0.1)
    rig.forget()
    rig.machine.set_host_baud(BAUD, max(0.0, 1 / rate_hz - COMMAND_BYTES * 10 / BAUD) / COMMAND_BYTES)
    sent = [(100 + i % 400, -100 - i % 700) for i in range(int(rate_hz * seconds))]
    end = rig.machine.send(b"".join(b"@11,%d,%de" % pair for pair in sent))
    rig.machine.run_until(end + int(10e-3 * rig.machine.frequency_hz))
    done = [pair_of(write.data) for write in rig.writes(MOVE)]
    lost = rig.machine.bytes_lost
    rig.close()
    return done == sent and lost == 0


def pair_of(data: bytes) -> Tuple[int, int]:
    """Linear and angular speed of a differential command to the motor board."""
    return int.from_bytes(data[1:3], "big", signed=True), int.from_bytes(data[3:5], "big", signed=True)


def rate_figures(make: MakeRig) -> Dict[str, float]:
    """The highest rate that loses nothing, in steps of 1 % down from the wire's."""
    rate = BAUD / (10 * COMMAND_BYTES)
    while rate > 1 and not moves_at(make, rate, STREAM_S):
        rate *= 0.99
    return {"commands_streaming_hz": rate}


def exact_figures(make: MakeRig) -> Dict[str, float]:
    """How many of all first arguments of command 11 arrive exactly; a short run tries some and reckons for all."""
    rig = make().settle(linear_ceiling=WIDEST, angular_ceiling=WIDEST)
    exact = sum(exact_in(rig, EXACT[start : start + 4096]) for start in range(0, len(EXACT), 4096))
    rig.close()
    return {"int16_exact": exact * EXACT.step}


def exact_in(rig: Rig, values: Iterable[int]) -> int:
    """How many values of a range arrive, each as itself and in its turn."""
    rig.forget()
    wanted = list(values)
    end = rig.machine.send(b"".join(b"@11,%d,0e" % value for value in wanted))
    rig.machine.run_until(end + int(10e-3 * rig.machine.frequency_hz))
    arrived = [pair_of(write.data)[0] for write in rig.writes(MOVE)]
    if len(arrived) == len(wanted):
        return sum(got == value for got, value in zip(arrived, wanted))
    return len(set(arrived) & set(wanted))


def boot_figures(make: MakeRig) -> Dict[str, float]:
    """From the sketch's first instruction to the answer to requests that come every 10 ms."""
    rig = make()
    for tenth in range(100):
        rig.machine.send(b"@5e", int((1e-3 + tenth * 10e-3) * rig.machine.frequency_hz))
    reply = rig.await_value(lambda: next(iter(rig.replies()), None), 0, 5.0)
    rig.close()
    if reply is None:
        raise TimeoutError("no answer within 5 s of the sketch's start")
    return {"boot_to_answer_ms": 1e3 * reply.end_cycle / rig.machine.frequency_hz}


def end_refusal(rig: Rig) -> None:
    """After its own stop a board refuses moves until the host has stopped the robot."""
    rig.machine.send(b"@13e")
    rig.run(10e-3)


def watchdog_figures(make: MakeRig) -> Dict[str, float]:
    """From the last byte of the host to the stop on the bus, watchdog 250 ms, at random phases."""
    rig = make().settle()
    rig.ask(request("set_watchdog", 250))
    delays = []
    for _ in range(WATCHDOG_STOPS):
        end_refusal(rig)
        rig.forget()
        end = rig.send_somewhen(b"@11,300,0e", 0.1)
        rig.machine.run_until(end + int(0.4 * rig.machine.frequency_hz))
        stops = [stop for stop in rig.writes(STOP) if stop.cycle > end]
        assert rig.writes(MOVE), "the board refused the move"
        delays.append(1e-3 * rig.microseconds(stops[0].cycle - end) if stops else float("inf"))
    rig.close()
    return {"watchdog_stop_ms_max": max(delays)}


def pauses_ms(rig: Rig, seconds: float) -> List[float]:
    """Waiting times of a request that needs no I2C, asked again and again."""
    pauses = []
    until = rig.machine.cycle + int(seconds * rig.machine.frequency_hz)
    while rig.machine.cycle < until:
        rig.replies()
        end = rig.machine.send(request("get_stream"))
        reply = rig.await_value(lambda: stream_answer(rig), end, 1.0)
        pauses.append(1e-3 * rig.microseconds(reply.start_cycle - end) if reply else 1000.0)
    return pauses


def stream_answer(rig: Rig) -> Optional[Reply]:
    """The first new answer to get_stream; it may stand behind a frame that a failed read left unfinished."""
    for reply in rig.replies():
        at = reply.line.find(b"@17,")
        if at >= 0:
            return Reply(
                reply.line[at:], reply.end_cycle - BYTE_CYCLES * (len(reply.line) - at), reply.end_cycle
            )
    return None


def hang_figures(make: MakeRig) -> Dict[str, float]:
    """The longest pause of a board that is asked while its bus breaks in four ways at random phases."""
    rig = make().settle()
    pauses = []
    for number in range(HANGS):
        rig.machine.send(b"@11,300,0e@6e")
        rig.run(rig.random.random() * 3e-3)
        rig.break_part(BUS_FAULTS[number % 4])
        pauses += pauses_ms(rig, 0.12)
        rig.break_part("")
        pauses += pauses_ms(rig, 0.1)
    rig.close()
    return {"bus_hang_blocked_ms_max": max(pauses)}


def every_request() -> List[bytes]:
    """One valid request of every row, least and most arguments, extremes of their ranges."""
    frames = []
    for row in COMMANDS:
        if row.name == "xbee_text":
            continue
        for count in {len(row.request) - row.optional, len(row.request)}:
            fields = row.request[:count]
            frames.append(encode_request(row.code, *(field.low for field in fields)))
            frames.append(encode_request(row.code, *(field.high for field in fields)))
    return frames


BAD_INPUT = (
    b"@99e",
    b"@11,+5,0e",
    b"@11,1e",
    b"@11,1,2,3,4e",
    b"@11,99999,0e",
    b"@" * 40,
    b"x" * 300,
    bytes(range(256)),
)


def use_everything(rig: Rig) -> None:
    """All commands, bad input, each stream for a while, and broken parts while driving."""
    for frame in every_request() + list(BAD_INPUT):
        rig.machine.send(frame)
        rig.run(REQUEST_S)
    for fault in (*rig.FAULTS, ""):
        rig.machine.send(request("move_differential", 300, -300) + request("start_stream"))
        rig.break_part(fault)
        rig.run(0.3)
    for name in ("start_sensor_stream", "start_sensor_ldr_stream", "start_compass_stream"):
        rig.machine.send(request(name))
        rig.run(0.1)


def memory_figures(make: MakeRig) -> Dict[str, float]:
    """SRAM that nothing has touched after everything was used, plain and checked, and flash in use."""
    rig = make().settle()
    use_everything(rig)
    rig.machine.send(request("set_check", 1))
    for frame in every_request():
        rig.machine.send(frame)
        rig.run(REQUEST_S)
    free = rig.machine.sram_untouched()
    rig.close()
    return {"sram_free_bytes": free, "flash_bytes": sum(len(data) for _, data in rig.machine.image_flash)}
