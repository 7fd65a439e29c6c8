"""The timers against the ATmega328P data sheet, "8-bit Timer/Counter0 with PWM", "16-bit Timer/Counter1 with PWM" and
"8-bit Timer/Counter2".
"""

import random

import pytest

from sim_arduino.avr.machine import MachineCrashed

OUTPUTS = {0: (6, 5), 1: (9, 10), 2: (11, 3)}  # pins of the compare units A and B
NARROW = (0, 2)  # timers with 8 bits
PRESCALERS = {n: (1, 8, 32, 64, 128, 256, 1024) if n == 2 else (1, 8, 64, 256, 1024) for n in OUTPUTS}
NORMAL, PHASE_CORRECT, CTC, FAST, PHASE_CORRECT_TO_A, FAST_TO_A = 0, 1, 2, 3, 5, 7
WIDE_MODES = {NORMAL: 0, PHASE_CORRECT: 1, CTC: 4, FAST: 5}  # those of timer 1; PWM with 8 bits
TOGGLE, CLEAR, SET = 1, 2, 3
TOV, OCFA, OCFB = 1, 2, 4
ALL_PINS = 0xFF
WRITE_A, WRITE_B, WRITE_CONTROL_A, WRITE_CONTROL_B, WRITE_COUNT, READ = range(1, 7)
CLEAR_FLAGS, DIRECTION, PORT, CLEAR_BY_SBI, SLEEP = range(7, 12)
HOUR_CYCLES = 3600 * 16000000
COMMAND_S = 10e-6  # the sketch has obeyed
DUTIES = (0, 1, 100, 254, 255)


class Timer:
    """A timer of the sketch that has just started.

    Args:
        number: 0 to 2.
        mode: waveform generation mode of an 8-bit timer, 0 to 7.
        com: compare output modes of the units A and B.
        compare: values of the compare registers A and B.
        divider: of the prescaler.
        watched: the outputs' edges are collected.
        enable: the interrupts' enable bits.
    """

    def __init__(
        self, bench, number, mode, com, compare, divider=1, watched=True, enable=0, outputs=ALL_PINS, count=0
    ):
        self.board = bench("pwm.c")
        self.machine, self.pins = self.board.machine, OUTPUTS[number]
        mode = WIDE_MODES[mode] if number == 1 else mode
        self.control_a = com[0] << 6 | com[1] << 4 | mode & 3
        self.control_b = (mode & 4) << 1 | PRESCALERS[number].index(divider) + 1
        settings = {"timer": number, "control_a": self.control_a, "control_b": self.control_b}
        settings.update(enable=enable, compare_a=compare[0], compare_b=compare[1])
        settings.update(outputs=outputs, count=count, go=1)
        for name, value in settings.items():
            self.board.set(name, value)
        if watched:
            self.machine.watch_pins(self.pins)
        self.machine.run(COMMAND_S)

    def tell(self, command, value=0):
        self.board.set("value", value)
        self.board.set("command", command)
        self.machine.run(COMMAND_S)

    def read(self, name):
        """`count`, `flags` or `pins` as the program reads them now."""
        self.tell(READ)
        return self.board.get(name)

    def edges(self, unit, cycles):
        """(level, cycle) of an output's changes in the next cycles."""
        self.machine.pin_changes()
        self.machine.run_until(self.machine.cycle + cycles)
        return [
            (each.level, each.cycle) for each in self.machine.pin_changes() if each.pin == self.pins[unit]
        ]

    def wave(self, unit, cycles):
        """Sets of the output's periods and high times in the next cycles."""
        edges = self.edges(unit, cycles)
        rises = [cycle for level, cycle in edges if level]
        pairs = zip(edges, edges[1:])
        return {b - a for a, b in zip(rises, rises[1:])}, {b[1] - a[1] for a, b in pairs if a[0]}

    def shares_high(self, period, rounds=20):
        """Shares of the time in which the outputs are high, over this many periods [cycle] or some more."""
        self.machine.run_until(self.machine.cycle + 2 * period)  # behind the first round
        begun, end = self.machine.cycle, self.machine.cycle + rounds * period
        before = [self.machine.high_cycles(pin) for pin in self.pins]
        # instructions last several cycles
        while (self.machine.cycle - begun) % period or self.machine.cycle < end:
            rest = period - (self.machine.cycle - begun) % period
            self.machine.run_until(max(end, self.machine.cycle + rest))
        cycles = self.machine.cycle - begun
        return [(self.machine.high_cycles(pin) - high) / cycles for pin, high in zip(self.pins, before)]


WAVES = [  # mode, compare output modes and values of A and B, counts of (period, high time) of A and B
    (FAST, (CLEAR, CLEAR), (100, 20), (256, 101), (256, 21)),
    (FAST, (CLEAR, CLEAR), (0, 20), (256, 1), (256, 21)),
    (PHASE_CORRECT, (CLEAR, CLEAR), (100, 20), (510, 200), (510, 40)),
    (CTC, (TOGGLE, TOGGLE), (49, 7), (100, 50), (100, 50)),
    (NORMAL, (TOGGLE, TOGGLE), (49, 7), (512, 256), (512, 256)),
    (FAST_TO_A, (TOGGLE, CLEAR), (79, 19), (160, 80), (80, 20)),
    (PHASE_CORRECT_TO_A, (TOGGLE, CLEAR), (80, 20), (320, 160), (160, 40)),
]
DIVIDERS = [(number, divider) for number, dividers in PRESCALERS.items() for divider in dividers]


def has_mode(number, mode):
    """NORMAL takes timer 1 65536 counts a round."""
    return number in NARROW or mode in (PHASE_CORRECT, CTC, FAST)


@pytest.mark.parametrize(
    "number, divider, mode, com, compare, a, b",
    [(*timer, *wave) for timer in DIVIDERS for wave in WAVES if has_mode(timer[0], wave[0])],
)
def test_waves_have_the_periods_and_pulses_of_the_data_sheet(
    bench, number, divider, mode, com, compare, a, b
):
    timer = Timer(bench, number, mode, com, compare, divider)
    timer.machine.run_until(timer.machine.cycle + a[0] * divider)
    for unit, (period, high) in enumerate((a, b)):
        assert timer.wave(unit, 4 * period * divider) == ({period * divider}, {high * divider})


@pytest.mark.parametrize("number", OUTPUTS)
@pytest.mark.parametrize("mode, cycles", [(FAST, 256), (PHASE_CORRECT, 510)])
@pytest.mark.parametrize("duty", DUTIES)
def test_an_inverted_output_is_the_opposite(bench, number, mode, cycles, duty):
    """COM 3 in the PWM modes."""
    timer = Timer(bench, number, mode, (CLEAR, SET), (duty, duty), watched=False)
    assert sum(timer.shares_high(cycles)) == 1


@pytest.mark.parametrize("number", OUTPUTS)
@pytest.mark.parametrize("duty", DUTIES)
def test_the_time_high_of_fast_pwm(bench, number, duty):
    """OCR = 0 leaves a spike of one count, OCR = TOP is high for ever."""
    timer = Timer(bench, number, FAST, (CLEAR, CLEAR), (duty, 255 - duty), watched=False)
    assert timer.shares_high(256) == [(duty + 1) / 256, (256 - duty) / 256]


@pytest.mark.parametrize("number", OUTPUTS)
@pytest.mark.parametrize("duty", DUTIES)
def test_the_time_high_of_phase_correct_pwm(bench, number, duty):
    """OCR = 0 is low for ever, OCR = TOP high."""
    timer = Timer(bench, number, PHASE_CORRECT, (CLEAR, CLEAR), (duty, 255 - duty), watched=False)
    assert timer.shares_high(510) == [duty / 255, (255 - duty) / 255]


def test_fast_pwm_loads_a_compare_value_at_bottom(bench):
    timer = Timer(bench, 0, FAST, (CLEAR, 0), (100, 0), 64)
    timer.machine.run_until(timer.machine.cycle + 256 * 64)
    (rise,) = [cycle for level, cycle in timer.edges(0, 256 * 64) if level]
    timer.machine.run_until(rise + 256 * 64 + 10 * 64)
    timer.machine.pin_changes()
    timer.tell(WRITE_A, 50)
    edges = timer.edges(0, 2 * 256 * 64)
    assert edges[0] == (0, rise + 256 * 64 + 101 * 64)
    assert edges[1:3] == [(1, rise + 2 * 256 * 64), (0, rise + 2 * 256 * 64 + 51 * 64)]


@pytest.mark.parametrize("divider", [64, 1024])
@pytest.mark.parametrize("number", NARROW)
@pytest.mark.parametrize(
    "mode, counts, expected",
    [(NORMAL, 256, 10), (CTC, 100, 0), (FAST, 256, 10), (FAST_TO_A, 100, 10), (PHASE_CORRECT, 510, 10),
     (PHASE_CORRECT_TO_A, 198, 10)],
)  # fmt: skip
def test_overflows_interrupt(bench, number, mode, counts, expected, divider):
    """At MAX in normal and CTC mode, at TOP in fast PWM, at BOTTOM in phase-correct PWM."""
    timer = Timer(bench, number, mode, (0, 0), (99, 10), divider, enable=TOV, count=5)
    timer.machine.run_until(timer.machine.cycle + 10 * counts * divider)
    assert timer.board.get("overflows") == expected


@pytest.mark.parametrize("number", OUTPUTS)
def test_pwm_that_nobody_watches_has_no_events(bench, number):
    ends = []
    for watched in (False, True):
        timer = Timer(bench, number, FAST, (CLEAR, CLEAR), (100, 100), watched=watched)
        timer.tell(SLEEP)
        ends.append(timer.machine.next_event_cycle - timer.machine.cycle)
    assert ends[0] > HOUR_CYCLES > 256 >= ends[1]


def random_settings(seed):
    draw = random.Random(seed)
    number = draw.choice(list(OUTPUTS))
    modes = [NORMAL, PHASE_CORRECT, CTC, FAST, PHASE_CORRECT_TO_A, FAST_TO_A]
    return {
        "number": number,
        "mode": draw.choice([mode for mode in modes if number in NARROW or mode in WIDE_MODES]),
        "com": (draw.randrange(4), draw.randrange(4)),
        "compare": (draw.choice([0, 1, 3, 77, 254, 255]), draw.choice([0, 1, 2, 77, 200, 255])),
        "divider": draw.choice(PRESCALERS[number]),
        "count": draw.choice([0, 5, 255]),
    }


@pytest.mark.parametrize("seed", range(60))
def test_the_time_high_in_closed_form_is_that_of_the_edges(bench, seed):
    """A watched output is followed edge by edge; the other one is counted in rounds."""
    settings, draw = random_settings(seed), random.Random(seed)
    steps = [
        (draw.randrange(1, 400000), draw.choice([WRITE_A, WRITE_B, READ, WRITE_COUNT])) for _ in range(6)
    ]
    high = []
    for watched in (True, False):
        timer, draw = Timer(bench, watched=watched, **settings), random.Random(seed)
        for cycles, command in steps:
            timer.machine.run_until(timer.machine.cycle + cycles)
            timer.tell(command, draw.randrange(256))
        high.append(
            [timer.machine.high_cycles(pin) for pin in timer.pins]
            + [timer.read("count"), timer.read("flags")]
        )
    assert high[0] == high[1]


@pytest.mark.parametrize("divider", [64, 1024])
@pytest.mark.parametrize("number", NARROW)
@pytest.mark.parametrize(
    "mode, round_counts, matches",
    [(NORMAL, 256, 10), (CTC, 100, 10), (FAST, 256, 10), (FAST_TO_A, 100, 10), (PHASE_CORRECT, 510, 20)],
)
def test_matches_interrupt_once_a_round_and_in_phase_correct_pwm_on_both_slopes(
    bench, number, mode, round_counts, matches, divider
):
    timer = Timer(bench, number, mode, (0, 0), (99, 10), divider, enable=OCFA | OCFB)
    timer.machine.run_until(timer.machine.cycle + 10 * round_counts * divider)
    assert (timer.board.get("matches_a"), timer.board.get("matches_b")) == (matches, matches)


@pytest.mark.parametrize("mode, interrupts", [(FAST, (10, 10, 10)), (PHASE_CORRECT, (10, 20, 20))])
def test_timer_1_interrupts_in_pwm(bench, mode, interrupts):
    """Overflows and matches of A and B, over ten rounds."""
    timer = Timer(bench, 1, mode, (CLEAR, CLEAR), (99, 10), 64, enable=TOV | OCFA | OCFB, count=5)
    timer.machine.run_until(timer.machine.cycle + 10 * (256 if mode == FAST else 510) * 64)
    assert tuple(timer.board.get(name) for name in ("overflows", "matches_a", "matches_b")) == interrupts


@pytest.mark.parametrize("wgm", [2, 3, *range(6, 12), 13, 15])
def test_a_mode_of_timer_1_that_is_not_simulated_is_refused(bench, wgm):
    timer = Timer(bench, 1, NORMAL, (0, 0), (0, 0))
    with pytest.raises(MachineCrashed, match="WGM of a 16-bit timer is .*, but only 0, 1, 4, 5, 12"):
        timer.tell(WRITE_CONTROL_A, wgm & 3)
        timer.tell(WRITE_CONTROL_B, (wgm & 12) << 1 | 1)
