"""The greeting alone: what is asked, how often, when it is believed, and when it ends."""

import pytest

from mrl_driver.errors import BoardError, BoardTimeout, NotARobot, WrongRobot
from mrl_driver.protocol import Frame
from mrl_driver.protocol.table import BY_NAME, STOP_CODE, WRAP
from mrl_driver.session import handshake
from mrl_driver.session.sensor_polling import SENSOR_STREAM

PLAIN, CHECKED = False, True
INFO, INFO_2013 = Frame(5, (2500, 172, 1200, 2, 1)), Frame(5, (2500, 172, 1200, 1, 1))
CHECK, WATCHDOG, SONARS, ENVIRONMENT, OMNI = 1, 2, 16, 32, 128
FAULT_MOTOR_BOARD, FAULT_SENSOR = 1, 16
READ_PROTOCOL, SET_CHECK, OMNI_STREAM = (
    BY_NAME[name].code for name in ("read_protocol", "set_check", "start_omni_stream")
)
SENSING = BY_NAME[SENSOR_STREAM].code
INFO_OF_2013 = BY_NAME["robot_info"].code + WRAP
TO_ANSWER_S, TO_ASK_S = 8.0, 2.0  # A board has 8 s for its first answer, and 2 s for each later one


def protocol(bits=CHECK | WATCHDOG, version=2):
    return Frame(READ_PROTOCOL, (version, bits))


def status(faults=0):
    return Frame(30, (0, 1, 1, 0, faults, 0))


class Hello(handshake.Handshake):
    """A greeting that keeps what it sends."""

    def __init__(self, plan=handshake.Plan(), admit=lambda board: None, **options):  # noqa: B008
        self.sent = []
        super().__init__(plan, self._keep, admit, 0.0, **options)

    def _keep(self, code, *args, checked=None, wrapped=None):
        self.sent.append(((code + WRAP * bool(wrapped), *args), checked))

    def hear(self, checked, *frames):
        for frame in frames:
            self.on_frame(frame, self.due_s, checked)
        return self

    def ask(self, times=1, checked=PLAIN):
        """What it sends when the board is silent, tick by tick: the requests, `stop` left out."""
        asked = []
        for _ in range(times):
            self.sent.clear()
            self.tick(self.due_s, checked)
            asked.append([words[0] for words, _ in self.sent if words != (STOP_CODE,)])
        return asked

    def ends_at(self, checked=PLAIN):
        """The time at which a silent board ends the greeting, and how."""
        while self.due_s < 60.0:
            now = self.due_s
            try:
                self.tick(now, checked)
            except (BoardError, BoardTimeout, NotARobot) as error:
                return now, str(error)
        raise AssertionError("the greeting does not end")


# -- what the board's answers say


def test_answers_are_converted_to_units():
    assert handshake.board_of((2512, 172, 1230, 2, 4)) == handshake.Board(4, 2, 1.72, 12.30, 25.12)


@pytest.mark.parametrize(
    "lacking, unmeasured", [("no_battery", "battery_v"), ("no_temperature", "temperature_c")]
)
def test_only_what_is_not_measured_is_nan(lacking, unmeasured):
    board = handshake.with_measured(handshake.board_of(INFO.args), frozenset([lacking]))
    assert [name for name, value in board._asdict().items() if value != value] == [unmeasured]


@pytest.mark.parametrize(
    "other, alike",
    [
        ((2999, 172, 1249, 2, 1), True),
        ((2500, 172, 1250, 2, 1), False),
        ((3000, 172, 1200, 2, 1), False),
        ((2500, 172, 1200, 2, 2), False),
    ],
    ids=["near", "battery", "temperature", "id"],
)
def test_answers_are_alike_if_battery_and_temperature_are_near_and_the_rest_is_equal(other, alike):
    assert handshake.are_alike(handshake.board_of(INFO.args), handshake.board_of(other)) is alike


# -- the first request


WHO = [INFO_OF_2013, READ_PROTOCOL]  # Boards of 2013 answer the one, ours the other
WHO_TWICE = [*WHO, READ_PROTOCOL]  # The board may want checksums


def test_each_third_question_is_sent_in_the_other_form_too():
    hello = Hello()
    assert hello.ask(6) == [WHO, WHO, WHO_TWICE] * 2
    assert [checked for words, checked in hello.sent if words == (READ_PROTOCOL,)] == [True, False]


def test_a_board_that_answers_is_asked_in_its_own_form():
    hello = Hello()
    hello.ask(2)
    assert hello.hear(PLAIN, INFO_2013).ask() == [WHO]


def test_a_board_that_has_fallen_silent_is_asked_in_the_other_form_again():
    hello = Hello().hear(PLAIN, INFO_2013)
    assert hello.ask(3)[-1] == WHO_TWICE


def test_a_patient_greeting_always_asks_in_both_forms():
    assert Hello(patient=True).ask(2) == [WHO_TWICE] * 2


def test_one_that_then_stays_silent_is_asked_the_first_question_again():
    """Another board may be there now."""
    assert Hello(patient=True).hear(PLAIN, protocol()).ask(9)[-2:] == [[5, 5], WHO_TWICE]


@pytest.mark.parametrize("answer, form", [(protocol(), False), (INFO_2013, None)], ids=["ours", "unknown"])
def test_the_stop_has_the_form_of_the_board_as_soon_as_that_is_known(answer, form):
    """Until then, the session chooses the one of the last board."""
    forms = []
    hello = handshake.Handshake(
        handshake.Plan(),
        lambda code, *_, wrapped=None, **__: forms.append((code, wrapped)),
        lambda board: None,
        0.0,
    )
    hello.on_frame(answer, 0.0, PLAIN)
    hello.tick(0.0, PLAIN)
    assert forms[0] == (STOP_CODE, form)


def test_after_other_bytes_the_boards_text_is_turned_off_in_plain():
    """A frame after text on the same line is not decoded."""
    hello = Hello()
    hello.heard(b"[INFO]", 0.0)
    hello.tick(0.0, CHECKED)
    assert hello.sent[1] == ((16, 0), False)


def test_bytes_of_a_board_that_is_known_are_no_text_before_the_greeting():
    hello = Hello().hear(CHECKED, INFO)
    hello.heard(b"[INFO]", 0.0)
    hello.ask(8)
    assert hello.ask() == [WHO_TWICE]


# -- when it ends without a board


def test_silence_ends_it_after_eight_seconds():
    assert Hello().ends_at() == (
        TO_ANSWER_S,
        "no answer to '@29e': check that the board is powered, that this is its port, and that it is flashed",
    )


def test_a_pause_of_this_program_prolongs_it_by_the_pause():
    hello = Hello()
    hello.ask()
    hello.tick(9.0, PLAIN)
    assert hello.ends_at()[0] == TO_ANSWER_S + 9.0 - handshake.RETRY_S


JUNK = bytes(range(128, 159)) + b"\x7f"  # The fewest that count
TEXT = bytes(range(32, 127)) + b"\r\n\t"


def test_bytes_that_are_no_text_mean_another_baud_rate_four_seconds_after_the_first():
    hello = Hello()
    hello.ask(4)
    hello.heard(JUNK[:30], 1.0)
    hello.heard(JUNK[30:], 2.0)
    assert hello.ends_at() == (
        5.0,
        f"this port sends text at another baud rate, or another device is on it (got {JUNK[:24]!r}, expected "
        "'@29,...e'): check baud",
    )


def test_text_and_a_few_other_bytes_are_another_device():
    hello = Hello()
    hello.heard(TEXT + JUNK[1:], 0.0)
    assert hello.ends_at() == (
        TO_ANSWER_S,
        f"no answer to '@29e', but other bytes ({TEXT[:24]!r}): another device or firmware, or check baud; flash the "
        "board with: mrl flash --port PORT",
    )


DIFFERING = (
    "answers request 5 differently each time, expected the same answer 5 times in a row: the line damages what is "
    "sent; use a shorter or better cable, away from the motor wires"
)


def test_answers_that_differ_end_it_with_the_line_as_the_cause():
    assert Hello().hear(PLAIN, INFO).ends_at() == (TO_ANSWER_S, f"the device on this port {DIFFERING}")


# -- a board that falls silent


def test_a_board_that_stays_silent_for_two_more_seconds_ends_it():
    assert Hello().hear(CHECKED, INFO).ends_at(CHECKED) == (
        2 * TO_ASK_S,
        "the board (robot id 1) does not answer request 29 any more; reset it and try again",
    )


@pytest.mark.parametrize(
    "info, stream, hangs",
    [(INFO_2013, SENSOR_STREAM, True), (INFO_2013, None, False), (INFO, SENSOR_STREAM, False)],
    ids=["2013 with sensors", "2013", "ours"],
)
def test_the_thermopile_is_named_for_a_board_of_2013_that_may_hang_on_it(info, stream, hangs):
    hello = Hello(admit=lambda board: stream).hear(
        PLAIN, *[protocol()] * (info is INFO), *[info] * handshake.ALIKE
    )
    hint = (
        ": a 2013 board hangs if its thermopile does not answer, so check its wires, or if the board has sonars choose "
        "build sonar"
    )
    assert hello.ends_at()[1] == (
        f"the board (robot id 1) does not answer request 29 any more{hint if hangs else ''}; reset it and try again"
    )


NO_ANSWER = "the {} of robot 1 does not answer its Arduino: check its power and the I2C wires"


@pytest.mark.parametrize(
    "stream, faults, words",
    [
        (None, FAULT_MOTOR_BOARD, NO_ANSWER.format("motor board")),
        (SENSOR_STREAM, FAULT_SENSOR, NO_ANSWER.format("thermopile")),
        (None, FAULT_SENSOR, "does not answer request 29"),
        (SENSOR_STREAM, FAULT_MOTOR_BOARD, "does not answer request 29"),
    ],
)
def test_a_fault_is_named_if_it_keeps_the_stream_from_starting(stream, faults, words):
    hello = Hello(handshake.Plan(check=False), lambda board: stream)
    hello.hear(CHECKED, INFO, protocol(0), status(faults))
    assert words in hello.ends_at(CHECKED)[1]


# -- who is believed


def test_three_equal_plain_answers_are_believed_and_not_two():
    hello = Hello().hear(PLAIN, *[INFO] * (handshake.ALIKE - 1))
    assert hello.board is None
    assert hello.hear(PLAIN, INFO).board == handshake.board_of(INFO.args) and handshake.ALIKE == 3


def test_the_next_answer_is_asked_for_at_once():
    hello = Hello()
    hello.ask()
    hello.on_frame(INFO, 0.01, PLAIN)
    assert hello.due_s == 0.01


def refuse(board):
    raise WrongRobot("another")


def test_five_plain_answers_refuse_a_board_and_not_four():
    hello = Hello(admit=refuse).hear(PLAIN, *[INFO] * (handshake.ALIKE_TO_REFUSE - 1))
    with pytest.raises(WrongRobot):
        hello.hear(PLAIN, INFO)
    assert handshake.ALIKE_TO_REFUSE == 5


def test_a_refusal_under_the_checksum_counts_at_once():
    with pytest.raises(WrongRobot):
        Hello(admit=refuse).hear(CHECKED, INFO)


def test_the_stream_of_the_last_board_is_ended_before_it_is_asked_for_more():
    assert ((19,), None) in Hello().hear(CHECKED, INFO).sent


# -- the protocol


def greeted(plan=handshake.Plan(), admit=lambda board: None):  # noqa: B008
    """A board that is known by its plain answers; the protocol is asked for."""
    return Hello(plan, admit).hear(PLAIN, protocol(), *[INFO] * handshake.ALIKE)


@pytest.mark.parametrize("version", [2, 3])
def test_a_board_with_newer_firmware_is_not_taken_for_one_of_2013(version):
    """It answers in the form of 2013 alone."""
    infos = [Frame(5, (2500, 172, 1200, version, 1))] * handshake.ALIKE
    if version > 2:
        with pytest.raises(WrongRobot, match="does not tell its protocol"):
            Hello().hear(PLAIN, *infos)
    else:
        assert Hello().hear(PLAIN, *infos).ask() == [[18 + WRAP]]


@pytest.mark.parametrize(
    "check, bits, answers",
    [(True, CHECK, 1), (True, WATCHDOG, 3), (False, CHECK, 3)],
    ids=["will be asked again", "without checksums", "not planned"],
)
def test_a_plain_protocol_is_believed_at_once_only_if_it_is_asked_for_again(check, bits, answers):
    hello = greeted(handshake.Plan(check=check))
    hello.hear(PLAIN, *[protocol(bits)] * (answers - 1))
    assert hello.board.capabilities == frozenset()
    assert hello.hear(PLAIN, protocol(bits)).board.capabilities == handshake.capabilities_of(bits)


def test_plain_answers_after_one_under_the_checksum_are_not_believed():
    hello = Hello().hear(CHECKED, INFO).hear(PLAIN, *[protocol(CHECK, 3)] * handshake.ALIKE_TO_REFUSE)
    assert "watchdog" in hello.hear(CHECKED, protocol()).board.capabilities


def test_plain_answers_are_no_answer_to_who_is_there_under_the_checksum():
    """The board was reset just after the checksum had been turned on."""
    hello = greeted().hear(PLAIN, protocol(), Frame(SET_CHECK, (1,)))
    assert hello.hear(PLAIN, *[INFO] * handshake.ALIKE_TO_REFUSE).ask(1, CHECKED) == [[INFO.code]]


@pytest.mark.parametrize("jump", [(600, 0, 0), (0, 0, 60)], ids=["temperature", "battery"])
def test_plain_answers_whose_readings_jump_are_not_believed(jump):
    hello = Hello()
    for number in range(handshake.ALIKE_TO_REFUSE):
        readings = tuple(value + number * step for value, step in zip(INFO.args, jump))
        hello.hear(PLAIN, Frame(5, (*readings, *INFO.args[3:])))
    assert hello.board is None


def test_a_plain_protocol_that_differs_begins_the_count_again():
    hello = greeted(handshake.Plan(check=False))
    hello.hear(PLAIN, protocol(3), protocol(3), protocol(2), protocol(2))
    assert hello.board.capabilities == frozenset()


def test_another_protocol_needs_five_equal_plain_answers():
    hello = greeted().hear(PLAIN, *[protocol(CHECK, 3)] * (handshake.ALIKE_TO_REFUSE - 1))
    with pytest.raises(WrongRobot, match="protocol 3, this driver 2"):
        hello.hear(PLAIN, protocol(CHECK, 3))


def test_another_protocol_under_the_checksum_counts_at_once():
    with pytest.raises(WrongRobot):
        Hello().hear(CHECKED, INFO, protocol(CHECK, 3))


def test_a_board_is_admitted_again_with_capabilities_that_are_sure():
    admitted = []
    hello = greeted(admit=admitted.append).hear(PLAIN, protocol(), Frame(SET_CHECK, (1,)))
    assert [bool(board.capabilities) for board in admitted] == [False]
    hello.hear(CHECKED, INFO, protocol())
    assert [bool(board.capabilities) for board in admitted] == [False, False, True]


def test_a_board_without_checksums_is_admitted_again_after_three_answers():
    admitted = []
    greeted(handshake.Plan(check=False), admitted.append).hear(PLAIN, *[protocol()] * handshake.ALIKE)
    assert [bool(board.capabilities) for board in admitted] == [False, True]


# -- what is set


def test_a_board_that_is_sure_is_not_asked_twice():
    hello = Hello().hear(CHECKED, INFO, protocol(), Frame(SET_CHECK, (1,)))
    assert hello.ask(1, CHECKED) == [[33]]


def test_a_checksum_that_is_on_already_stays():
    """Whether this driver wants it or not; the request also ends what another program has set."""
    hello = Hello(handshake.Plan(check=False)).hear(CHECKED, INFO, protocol(CHECK))
    hello.ask(1, CHECKED)
    assert ((SET_CHECK, 1), CHECKED) in hello.sent


def begun(stream, bits, plan=handshake.Plan(check=False)):  # noqa: B008
    """A greeting up to its status; a model that needs a stream says so once it knows the capabilities."""
    hello = Hello(plan, lambda board: stream if board.protocol == 2 else None)
    return hello.hear(CHECKED, INFO, protocol(bits), status())


@pytest.mark.parametrize(
    "stream, bits, code, frame",
    [
        (None, 0, 18, 8),
        ("start_omni_stream", OMNI, OMNI_STREAM, OMNI_STREAM),
        (SENSOR_STREAM, ENVIRONMENT | OMNI, SENSING, SENSING),
    ],
)
def test_the_stream_of_the_model_is_started_and_its_first_frame_ends_the_greeting(stream, bits, code, frame):
    hello = begun(stream, bits)
    assert hello.ask() == [[code]] and not hello.done
    assert hello.hear(CHECKED, Frame(frame, (0,) * 6)).done
    assert hello.board.capabilities == handshake.capabilities_of(bits)


@pytest.mark.parametrize("stream, bits", [("start_omni_stream", 0), (SENSOR_STREAM, SONARS)])
def test_a_board_without_the_stream_of_the_model_is_refused(stream, bits):
    with pytest.raises(WrongRobot, match="this robot model needs"):
        begun(stream, bits)


def of_2013(stream, plan=handshake.Plan()):  # noqa: B008
    return Hello(plan, lambda board: stream).hear(PLAIN, *[INFO_2013] * handshake.ALIKE)


def test_a_board_of_2013_has_no_three_wheels():
    with pytest.raises(WrongRobot, match="three wheels"):
        of_2013("start_omni_stream")


def test_a_board_of_2013_that_does_not_know_the_stream_of_sensors_gets_the_usual_one():
    hello = of_2013(SENSOR_STREAM)
    hello.ask(7)
    hello.hear(PLAIN, *[INFO_2013] * (handshake.DEAF - 1))
    assert hello.ask() == [[INFO_OF_2013, SENSING + WRAP]]
    assert hello.hear(PLAIN, INFO_2013).ask() == [[18 + WRAP]]


def test_the_stream_of_sensors_shows_that_a_board_of_2013_has_them():
    hello = of_2013(SENSOR_STREAM).hear(PLAIN, Frame(SENSING, (0,) * 6))
    assert (hello.done, hello.board.capabilities) == (True, {"environment"})
