"""Holds by other robots, and stops by the board itself: what the board does, and what its host learns."""

from typing import List

import pytest

from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.hold_text import HoldText
from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.protocol.table import BY_NAME, HOLD_STATES
from sim_arduino.board.python_board import CHECK_SILENCE_S
from sim_arduino.hardware.xbee import RECEIVED, PacketReader, RadioFit, XBee, packet

BOARD, HOLDER, OTHER = 0x0013A20040000001, 0x0013A20040000002, 0x0013A200400000F3
SILENCE = 5
SILENCE_S = SILENCE * 0.1  # Parameter 26 [100 ms], short, because simulated time is dear
HEARD_S = 0.07  # A hold text and the board's answer have passed both lines and the air
READ_RADIO = BY_NAME["read_radio"].code


class Robot:
    """The radio of another robot, with a host that reads it at once."""

    def __init__(self, bench, address: int):
        self.bench = bench
        medium = bench.plant.world.radio
        self.xbee = XBee(medium, f"robot {address}", RadioFit(address), lambda: (0.0, 0.0))

    def say(self, kind: str, number: int) -> List[HoldText]:
        """Sends a hold text; the answers."""
        return self.say_bytes(HoldText(kind, number).data)

    def say_bytes(self, data: bytes) -> List[HoldText]:
        head = b"\x10\0" + BOARD.to_bytes(8, "big") + b"\xff\xfe\0\0"
        self.xbee.receive(packet(head + data), self.bench.now_s)
        self.bench.run(HEARD_S)
        reader = PacketReader()
        got = [data for each in self.xbee.take(self.bench.now_s) for data in reader.feed(each)]
        return [HoldText.parse(data[12:]) for data in got if data[0] == RECEIVED]


def radio_bench(benches, **stored):
    return benches("omni3md", radio=RadioFit(BOARD), stored=stored)


@pytest.fixture
def bench(benches):
    """A TraxBot whose board lets others hold it, after the time in which it listens."""
    made = radio_bench(benches, radio_hold=SILENCE)
    made.run(SILENCE_S)
    return made


@pytest.fixture
def robot(bench):
    return Robot(bench, HOLDER)


def state(bench) -> str:
    return HOLD_STATES[bench.reply("read_radio")[0]][0]


def holders(bench) -> int:
    return bench.reply("read_radio")[1]


def ignored(bench) -> int:
    return bench.reply("read_radio")[2]


def drives(bench) -> bool:
    bench.ask("move_differential", 200, 0)
    return bench.is_driven()


def states_sent(bench, seconds: float) -> List[str]:
    frames = FrameDecoder(REPLIES).feed(bench.run(seconds))
    return [HOLD_STATES[frame.args[0]][0] for frame in frames if frame.code == READ_RADIO]


def test_hold_stops_the_robot_and_says_so(bench, robot):
    bench.ask("move_differential", 200, 0)
    assert robot.say("hold", 1) == [HoldText("held", 1)]
    assert not bench.is_driven()
    assert bench.stop_reason() == "held"


MOVES = [
    ("calibrate",), ("move_motors_pid", 20, 20), ("move_motors", 20, 20), ("move_differential", 200, 0),
    ("move_to_position", 1, 20, 500), ("move_omni", 20, 0, 0),
]  # fmt: skip


def test_held_robot_refuses_all_moves(bench, robot):
    robot.say("hold", 1)
    for move in MOVES:
        bench.ask(*move)
    assert not bench.is_driven()
    assert bench.counters() == {"held": len(MOVES)}


def test_freed_robot_stands_until_its_host_moves_it(bench, robot):
    bench.ask("move_differential", 200, 0)
    robot.say("hold", 1)
    assert robot.say("free", 1) == [HoldText("freed", 1)]
    assert not bench.is_driven()
    assert drives(bench)


def test_held_robot_takes_a_stop(bench, robot):
    robot.say("hold", 1)
    bench.ask("stop")
    assert bench.counters() == {}


def test_parameter_off_the_text_is_for_the_host_and_the_robot_drives_on(benches):
    bench = radio_bench(benches)
    bench.ask("move_differential", 200, 0)
    assert Robot(bench, HOLDER).say("hold", 1) == []
    assert bench.is_driven()
    assert b"@39,19,-24064,16384,2,4,-1976,1e" in bench.text
    assert state(bench) == "off"


def test_board_without_the_parameter_replies_without_the_reason_of_a_hold(benches):
    assert len(radio_bench(benches).reply("read_counters")) == 11


@pytest.mark.parametrize("data", [b"\xf8H\0", b"\xf8H\0\1x", b"HOLD", b"\xf8h\0\1", b"\xf8X\0\1"])
def test_other_texts_do_not_hold(bench, robot, data):
    assert robot.say_bytes(data) == []
    assert state(bench) == "free"


def test_holder_is_named(bench, robot):
    robot.say("hold", 1)
    assert bench.reply("read_radio") == (3, 1, 0, 0, 0x13, -0x5E00, 0x4000, 2)


def test_old_hold_after_its_end_has_no_effect(bench, robot):
    """The radio may deliver a text again, later; the answer names the number that a new hold must exceed."""
    robot.say("hold", 7)
    robot.say("free", 7)
    assert robot.say("hold", 7) == [HoldText("freed", 7)]
    assert state(bench) == "free" and ignored(bench) == 1
    assert robot.say("hold", 8) == [HoldText("held", 8)]


def test_numbers_wrap(bench, robot):
    robot.say("hold", 0xFFFF)
    robot.say("free", 0xFFFF)
    assert robot.say("hold", 0) == [HoldText("held", 0)]


def test_holder_that_has_started_again_learns_the_number(bench, robot):
    """Its own counter began anew: the old end of the hold has no effect, the number in force has."""
    robot.say("hold", 500)
    assert robot.say("free", 1) == [HoldText("held", 500)]
    assert robot.say("free", 500) == [HoldText("freed", 500)]


def test_end_from_another_robot_is_ignored_and_counted(bench, robot):
    robot.say("hold", 1)
    assert Robot(bench, OTHER).say("free", 1) == [HoldText("freed", 1)]
    assert state(bench) == "held" and ignored(bench) == 1


def test_each_holder_must_end_its_hold(bench, robot):
    other = Robot(bench, OTHER)
    robot.say("hold", 1)
    other.say("hold", 9)
    assert holders(bench) == 2
    robot.say("free", 1)
    assert not drives(bench)
    other.say("free", 9)
    assert drives(bench)


def test_fifth_holder_gets_no_answer(bench):
    robots = [Robot(bench, OTHER + n) for n in range(5)]
    answers = [robot.say("hold", 1) for robot in robots]
    assert answers == [[HoldText("held", 1)]] * 4 + [[]]
    assert holders(bench) == 4 and ignored(bench) == 1


def test_silent_holder_is_told_and_holds_on(bench, robot):
    robot.say("hold", 1)
    bench.reply("read_radio")
    assert states_sent(bench, SILENCE_S) == ["silent"]
    assert not drives(bench)


def test_repeated_hold_is_not_silent(bench, robot):
    for _ in range(4):
        robot.say("hold", 1)
        bench.run(SILENCE_S / 2)
    assert state(bench) == "held"


def test_host_releases_a_silent_holder(bench, robot):
    robot.say("hold", 1)
    bench.run(SILENCE_S)
    bench.ask("set_check", 1)
    assert bench.reply("release_hold") == (0,)
    bench.ask("set_check", 0)
    assert drives(bench)


def test_holder_that_still_speaks_is_not_released(bench, robot):
    robot.say("hold", 1)
    bench.ask("set_check", 1)
    assert bench.reply("release_hold") == (1,)
    assert not drives(bench)


def test_released_holder_that_speaks_again_holds_again(bench, robot):
    robot.say("hold", 1)
    bench.run(SILENCE_S)
    bench.ask("set_check", 1)
    bench.ask("release_hold")
    assert robot.say("hold", 1) == [HoldText("held", 1)]


def test_started_board_listens_before_it_moves(benches):
    """A holder repeats its hold in this time, so a board that was reset while it was held is held again."""
    bench = radio_bench(benches, radio_hold=SILENCE)
    assert state(bench) == "listening" and not drives(bench)
    assert Robot(bench, HOLDER).say("hold", 3) == [HoldText("held", 3)]
    bench.run(SILENCE_S)
    assert state(bench) == "silent"


def test_parameter_set_to_0_ends_all_holds(bench, robot):
    robot.say("hold", 1)
    bench.ask("set_check", 1)
    bench.write_config("radio_hold", 0)
    assert drives(bench)


def test_changes_are_sent_to_a_host_that_has_asked(bench, robot):
    bench.reply("read_radio")
    robot.say("hold", 1)
    robot.say("free", 1)
    assert [frame.args[0] for frame in sent_by_itself(bench)][-2:] == [3, 1]


def test_changes_are_not_sent_to_a_host_that_has_not_asked(bench, robot):
    robot.say("hold", 1)
    assert sent_by_itself(bench) == []


def sent_by_itself(bench) -> List[Frame]:
    return [
        event
        for event in FrameDecoder(REPLIES).feed(bench.text)
        if isinstance(event, Frame) and event.code == READ_RADIO
    ]


LOST_S = 5.0  # Longer than the module tries to find a radio


def test_text_that_reaches_no_radio_is_counted_and_told(bench):
    bench.reply("read_radio")
    bench.ask("send_xbee", 0, 0, 0, 77, 2, 0x4142)
    bench.run(LOST_S)
    assert sent_by_itself(bench)[-1].args[3] == 1


def test_builds_without_a_radio_refuse(omni3md):
    omni3md.ask("read_radio")
    omni3md.ask("set_check", 1)
    omni3md.ask("release_hold")
    assert omni3md.counters() == {"unavailable": 2}


WATCHDOG_MS = 60
SILENT_S = 0.07
MOVE = ("move_differential", 150, 0)


def refused_for(bench) -> str:
    """Sends a move; the stop reason in the status that answers it."""
    (status,) = bench.ask(*MOVE)
    assert status.code == BY_NAME["read_status"].code
    return STOP_REASONS[status.args[3]]


@pytest.fixture
def stopped(bench):
    """A robot that its board has stopped, because the host was silent."""
    bench.ask("set_watchdog", WATCHDOG_MS)
    bench.ask(*MOVE)
    bench.run(SILENT_S)
    return bench


def test_moves_are_refused_and_answered_with_the_status_until_the_host_has_stopped_the_robot(stopped):
    assert refused_for(stopped) == "link_watchdog" and not stopped.is_driven()
    assert stopped.counters() == {"unavailable": 1}
    stopped.ask("stop")
    assert stopped.ask(*MOVE) == [] and stopped.is_driven()


def test_a_move_of_speed_zero_is_refused_too_and_does_not_end_it(stopped):
    stopped.ask("move_differential", 0, 0)
    stopped.ask(*MOVE)
    assert not stopped.is_driven()


def test_a_host_that_turns_the_watchdog_off_can_drive_as_in_2013(stopped):
    stopped.ask("set_watchdog", 0)
    assert stopped.ask(*MOVE) == [] and stopped.is_driven()


def test_a_host_of_2013_can_drive_after_the_session_of_another_has_ended_without_a_stop(bench):
    bench.ask("set_check", 1)
    bench.ask("set_watchdog", WATCHDOG_MS)
    bench.ask(*MOVE)
    bench.run(SILENT_S)
    bench.ask("set_check", 0)
    bench.ask(*MOVE)
    assert bench.is_driven()
    bench.run(SILENT_S)
    bench.ask(*MOVE)
    assert bench.is_driven()


def after_the_checksums(bench, watchdog_ms):
    """A robot whose board has stopped it and ended the checksums, and a move that the line has held up meanwhile."""
    bench.ask("set_check", 1)
    bench.ask("set_watchdog", watchdog_ms)
    bench.ask(*MOVE)
    bench.run(CHECK_SILENCE_S + SILENT_S)
    bench.checked = False
    return encode_request(BY_NAME[MOVE[0]].code, *MOVE[1:], checked=True)


@pytest.mark.parametrize(("watchdog_ms", "reason"), [(WATCHDOG_MS, "link_watchdog"), (5000, "check_ended")])
def test_a_move_that_the_line_held_up_until_the_checksums_have_ended_is_refused(bench, watchdog_ms, reason):
    held_up = after_the_checksums(bench, watchdog_ms)
    bench.send(held_up)
    assert not bench.is_driven() and bench.stop_reason() == reason
    bench.ask("stop")
    bench.send(held_up)
    assert bench.is_driven()


def test_a_host_that_turns_off_checksums_which_have_ended_can_drive_as_in_2013(bench):
    after_the_checksums(bench, WATCHDOG_MS)
    bench.send(encode_request(BY_NAME["set_check"].code, 0, checked=True))
    bench.ask(*MOVE)
    assert bench.is_driven()


def test_a_stop_by_the_host_is_not_one_of_them(bench):
    bench.ask("set_watchdog", 1000)
    for _ in range(2):
        bench.ask(*MOVE)
        assert bench.is_driven()
        bench.ask("stop")


def test_after_a_hold_by_radio_the_host_must_stop_the_robot_too(benches):
    bench = benches("omni3md", radio=RadioFit(BOARD), stored={"radio_hold": SILENCE})
    bench.run(SILENCE_S)
    bench.ask("set_watchdog", 1000)
    bench.ask(*MOVE)
    robot = Robot(bench, HOLDER)
    robot.say("hold", 1)
    robot.say("free", 1)
    assert refused_for(bench) == "held" and not bench.is_driven()
    bench.ask("stop")
    bench.ask(*MOVE)
    assert bench.is_driven()


def test_a_motor_board_that_comes_back_does_not_drive_on(benches):
    bench = benches("omni3md")
    bench.ask("set_watchdog", 1000)
    bench.ask(*MOVE)
    bench.plant.motor_board.present = False
    bench.ask("start_stream", 10, wait_s=0.1)
    bench.plant.motor_board.present = True
    bench.ask("stop_stream", wait_s=0.3)
    assert refused_for(bench) == "motor_board" and not bench.is_driven()
    bench.ask("stop")
    bench.ask(*MOVE)
    assert bench.is_driven()
