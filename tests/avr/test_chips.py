"""Both chips against the table of what their pins can do, and what the ATmega2560 has more than the ATmega328P."""

import pytest

from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560, CHIPS, NONE
from mrl_driver.robot.wiring import servo_pins
from sim_arduino.avr.machine import MachineCrashed

WRITE, READ, WRITE_WORD = 1, 2, 3
COMMAND_S = 10e-6
PCIFR, PCICR, PCMSK, EIMSK, EICRA, EIFR = 0x3B, 0x68, 0x6B, 0x3D, 0x69, 0x3C
ADCL, ADCSRA, ADCSRB, ADMUX = 0x78, 0x7A, 0x7B, 0x7C
ADEN, ADSC, ADIE, REFS0, MUX5 = 0x80, 0x40, 0x08, 0x40, 0x08
TCCRA = {0: 0x44, 1: 0x80, 2: 0xB0, 3: 0x90, 4: 0xA0, 5: 0x120}
TIMSK = {n: 0x6E + n for n in TCCRA}
WIDE = (1, 3, 4, 5)
PIN = dict(zip("ABCDEFG", range(0x20, 0x35, 3)), **dict(zip("HJKL", range(0x100, 0x10C, 3))))
INT0, PCINT0 = 1, {"atmega328p": 3, "atmega2560": 9}
CAPT = {1: 16, 3: 31, 4: 41, 5: 46}  # vectors of the ATmega2560; those of compare units and overflow follow
TOV, OCFA, OCFB, OCFC, ICF = 0x01, 0x02, 0x04, 0x08, 0x20
CAPTURE_PINS = {4: 49, 5: 48}  # those of timers 1 and 3 are on no pin of the board
DUTY, STEPS = 76, 256


@pytest.fixture(params=CHIPS.values(), ids=CHIPS)
def chip(request):
    return request.param


class Registers:
    """A chip whose registers the program writes and reads."""

    def __init__(self, board):
        self.board, self.machine = board, board.machine

    def write(self, address, value):
        self.board.set("address", address)
        self.board.set("value", value)
        self._obey(WRITE)

    def write_word(self, address, value):
        self.board.set("address", address)
        self.board.set("word", value)
        self._obey(WRITE_WORD)

    def read(self, address):
        self.board.set("address", address)
        self._obey(READ)
        return self.board.get("value")

    def _obey(self, command):
        self.board.set("command", command)
        self.machine.run(COMMAND_S)

    def interrupts(self):
        """Numbers of interrupts by vector since the last call; vectors without any are left out."""
        counts = self.board.bytes("interrupts")
        self.machine.poke(self.machine.symbol("interrupts").address, bytes(len(counts)))
        return {vector: count for vector, count in enumerate(counts) if count}

    def pulse(self, pin):
        """The level of an input changes twice."""
        for _ in range(2):
            self.machine.set_pin(pin, not self.machine.pin(pin))
            self.machine.run(COMMAND_S)


@pytest.fixture
def registers(bench, chip):
    return Registers(bench("registers.c", chip))


@pytest.fixture
def mega(bench):
    return Registers(bench("registers.c", ATMEGA2560))


def test_each_pin_is_an_output_where_the_table_says(registers, chip):
    for number, pin in enumerate(chip.pins):
        registers.machine.set_pin(number, 0)
        registers.write(PIN[pin.port] + 1, 1 << pin.bit)
        registers.write(PIN[pin.port] + 2, 1 << pin.bit)
        high = [other for other in range(number + 1) if registers.machine.pin(other)]
        registers.write(PIN[pin.port] + 2, 0)
        assert high == [number] and not registers.read(PIN[pin.port]) >> pin.bit & 1


def test_each_pin_has_the_pin_change_interrupt_of_the_table(registers, chip):
    registers.write(PCICR, 7)
    for number, pin in enumerate(chip.pins):
        if pin.change != NONE:
            group, bit = divmod(pin.change, 8)
            registers.write(PCMSK + group, 1 << bit)
            registers.pulse(number)
            assert registers.interrupts() == {PCINT0[chip.name] + group: 2}
            registers.write(PCMSK + group, 0)
        registers.pulse(number)
        assert registers.interrupts() == {}


def test_each_pin_has_the_external_interrupt_of_the_table(registers, chip):
    rising = 3
    for number, pin in enumerate(chip.pins):
        if pin.external != NONE:
            registers.write(EICRA + pin.external // 4, rising << 2 * (pin.external % 4))
            registers.write(EIFR, 0xFF)
            registers.write(EIMSK, 1 << pin.external)
        registers.pulse(number)
        assert registers.interrupts() == ({} if pin.external == NONE else {INT0 + pin.external: 1})
        registers.write(EIMSK, 0)


def test_each_pin_has_the_pwm_of_the_table(registers, chip):
    for number, pin in enumerate(chip.pins):
        if pin.timer == NONE:
            continue
        wide, base = pin.timer in WIDE, TCCRA[pin.timer]
        registers.write(PIN[pin.port] + 1, 1 << pin.bit)
        if wide:
            registers.write_word(base + 8 + 2 * pin.unit, DUTY)
        else:
            registers.write(base + 3 + pin.unit, DUTY)
        registers.write(base, 2 << (6 - 2 * pin.unit) | (1 if wide else 3))
        registers.write(base + 1, 1 | (8 if wide else 0))
        before, begun = registers.machine.high_cycles(number), registers.machine.cycle
        registers.machine.run(1e-3)
        share = (registers.machine.high_cycles(number) - before) / (registers.machine.cycle - begun)
        assert (number, share) == (number, pytest.approx((DUTY + 1) / STEPS, abs=0.01))
        registers.write(base + 1, 0)  # so that the count stays below TOP
        registers.write(base, 0)


def test_each_output_of_a_wide_timer_makes_pulses_of_servos(registers, chip):
    """Fast PWM with TOP in ICR; a new length holds from the next pulse on."""
    for number in servo_pins(chip):
        pin = chip.pins[number]
        base = TCCRA[pin.timer]
        registers.write(PIN[pin.port] + 1, 1 << pin.bit)
        registers.write(base + 1, 0x1A)  # F_CPU / 8
        registers.write_word(base + 6, 39999)
        registers.write_word(base + 8 + 2 * pin.unit, 2999)
        registers.write(base, 2 << (6 - 2 * pin.unit) | 2)
        registers.machine.run(40e-3)
        registers.machine.watch_pins([number])
        registers.write_word(base + 8 + 2 * pin.unit, 1999)
        registers.machine.pin_changes()
        registers.machine.run(90e-3)
        changes = registers.machine.pin_changes()[-5:]
        rise, fall, rise_2, fall_2 = (change.cycle for change in changes[not changes[0].level :][:4])
        assert (fall - rise, rise_2 - rise, fall_2 - rise_2) == (2000 * 8, 40000 * 8, 2000 * 8)
        registers.write(base, 0)
        registers.write(base + 1, 0)


def test_top_in_icr_is_refused_in_other_modes(registers):
    with pytest.raises(MachineCrashed, match="ICR of a timer is written in mode 0"):
        registers.write_word(TCCRA[1] + 6, 39999)


def test_each_analog_pin_has_the_channel_of_the_table(registers, chip):
    registers.machine.adc_volts = lambda channel, time_s: 0.25 * channel + 0.1
    registers.write(ADCSRA, ADEN | 7)
    for pin in chip.pins:
        if pin.channel != NONE:
            registers.write(ADMUX, REFS0 | pin.channel & 7)
            registers.write(ADCSRB, MUX5 if pin.channel > 7 else 0)
            registers.write(ADCSRA, ADEN | ADSC | ADIE | 7)
            registers.machine.run(300e-6)
            count = registers.read(ADCL) | registers.read(ADCL + 1) << 8
            assert count == int((0.25 * pin.channel + 0.1) / 5.0 * 1024)
    assert sum(registers.interrupts().values()) == sum(pin.channel != NONE for pin in chip.pins)


@pytest.mark.parametrize("refs, volts", [(1, 5.0), (2, 1.1), (3, 2.56)])
def test_the_mega_has_two_internal_references(mega, refs, volts):
    mega.machine.adc_volts = lambda channel, time_s: 0.5
    mega.write(ADMUX, refs << 6)
    mega.write(ADCSRA, ADEN | ADSC | 7)
    mega.machine.run(300e-6)
    assert mega.read(ADCL) | mega.read(ADCL + 1) << 8 == int(0.5 / volts * 1024)


@pytest.mark.parametrize("chip, timer, vector", [(ATMEGA328P, 0, 14), (ATMEGA328P, 2, 7), (ATMEGA2560, 0, 21),
                                                 (ATMEGA2560, 2, 13)])  # fmt: skip
def test_a_narrow_timer_interrupts_at_its_compare_units_and_at_its_end(registers, timer, vector):
    """At prescaler 1024, as a clock."""
    base = TCCRA[timer]
    for unit, compare in enumerate((10, 20)):
        registers.write(base + 3 + unit, compare)
    registers.write(TIMSK[timer], TOV | OCFA | OCFB)
    registers.write(base + 1, 5 if timer == 0 else 7)
    registers.machine.run(3 * 256 * 1024 / 16e6)
    assert registers.interrupts() == {vector + number: 3 for number in range(3)}


@pytest.mark.parametrize("timer", WIDE)
def test_a_wide_timer_interrupts_at_its_three_compare_units_and_at_its_end(mega, timer):
    base = TCCRA[timer]
    for unit in range(3):
        mega.write_word(base + 8 + 2 * unit, 100 + unit)
    mega.write(TIMSK[timer], TOV | OCFA | OCFB | OCFC)
    mega.write_word(base + 4, 65000)
    mega.write(base + 1, 2)  # 2 MHz
    mega.machine.run((536 + 200) / 2e6)
    assert mega.interrupts() == {CAPT[timer] + n: 1 for n in range(1, 5)}


@pytest.mark.parametrize("timer, pin", CAPTURE_PINS.items())
def test_a_wide_timer_captures_the_edges_of_its_pin(mega, timer, pin):
    base = TCCRA[timer]
    mega.write(TIMSK[timer], ICF)
    mega.write(base + 1, 1)
    begun = mega.machine.cycle + 100
    found = []
    for number in range(2):
        mega.machine.set_pin(pin, 0, begun + 1000 * number)
        mega.machine.set_pin(pin, 1, begun + 1000 * number + 400)
        mega.machine.run_until(begun + 1000 * number + 500)
        found.append(int.from_bytes(mega.machine.peek(base + 6, 2), "little"))
    assert (found[1] - found[0], mega.interrupts()) == (1000, {CAPT[timer]: 2})


def test_an_output_that_two_timers_share_is_refused(mega):
    with pytest.raises(
        MachineCrashed, match="output of compare unit C of a timer is used, but not simulated"
    ):
        mega.write(TCCRA[1], 0x08)


@pytest.mark.parametrize("address", [0x43, 0x64, 0x82, 0xB6])
def test_a_register_that_is_not_simulated_is_refused(registers, address):
    """GTCCR, PRR, TCCR1C and ASSR; 0 may be written."""
    registers.write(address, 0)
    with pytest.raises(MachineCrashed, match=f"register at 0x{address:02x} is written, but not simulated"):
        registers.write(address, 0x20)


@pytest.mark.parametrize("clock", [6, 7])
def test_an_external_clock_is_refused(registers, clock):
    with pytest.raises(MachineCrashed, match=f"CS of a timer is {clock}, but external clocks are not"):
        registers.write(TCCRA[1] + 1, clock)


@pytest.mark.parametrize("uart", range(4))
def test_each_uart_of_the_mega_receives_and_sends(bench, uart):
    machine = bench("echo.c", ATMEGA2560).machine
    machine.send(b"mega", uart=uart)
    machine.run(1e-3)
    sent = [machine.sent(number) for number in range(4)]
    assert [bytes(one.data for one in each) for each in sent] == [
        bytes(value + uart for value in b"mega") if number == uart else b"" for number in range(4)
    ]
    assert {one.end_cycle - one.start_cycle for one in sent[uart]} == {1360}


def test_the_mega_reads_and_calls_above_128_kib_and_has_4_kib_of_eeprom(bench):
    board = bench("far.c", ATMEGA2560)
    board.machine.run(5e-3)
    assert (board.bytes("found"), board.get("called")) == (b"\x5a\xc3", 42)
    assert board.machine.read_eeprom(4095) == b"\x42"


def test_the_mega_has_8_kib_of_sram(bench):
    board = bench("memory.c", ATMEGA2560)
    board.set("depth", 6000)
    board.set("action", 4)
    board.machine.run(20e-3)
    assert board.get("done") and board.machine.sram_untouched() < 8192 - 6000
    board.set("stray", 0x2200)
    board.set("action", 3)
    with pytest.raises(MachineCrashed):
        board.machine.run(50e-6)


@pytest.mark.parametrize("chip, entry", [(ATMEGA328P, 4), (ATMEGA2560, 5)])
def test_the_entry_of_an_interrupt_takes_its_cycles_and_from_sleep_twice_as_many(bench, chip, entry):
    """The jump in the vector takes three; D8 is PB0 of the Uno, and D53 that of the Mega."""
    board = bench("interrupts.c", chip)
    board.set("asleep", 1)
    board.set("go", 1)
    board.machine.run(100e-6)
    led, source = (13, 8) if chip == ATMEGA328P else (11, 53)
    board.machine.watch_pins([led])
    edge = board.machine.cycle + 1000
    board.machine.set_pin(source, 0, edge)
    board.machine.run(1e-3)
    assert [change.cycle - edge for change in board.machine.pin_changes()] == [2 * entry + 3]


def test_the_mega_sends_on_its_i2c_bus_and_holds_its_pins(bench):
    board = bench("twi.c", ATMEGA2560)
    written = []
    board.machine.on_transfer = written.append
    for index, (control, value) in enumerate([(0xA4, 0), (0x84, 0x30), (0x94, 0), (0xFF, 0)]):
        board.machine.poke(board.machine.symbol("control").address + index, bytes([control]))
        board.machine.poke(board.machine.symbol("value").address + index, bytes([value]))
    board.set("go", 1)
    board.machine.run(1e-3)
    board.machine.hang_bus("sda")
    assert [(each.kind, each.address) for each in written] == [("nack", 0x18)]
    assert (board.machine.pin(20), board.machine.pin(21)) == (0, 1)


def test_the_watchdog_resets_the_mega(bench):
    board = bench("watchdog.c", ATMEGA2560)
    for name, value in {"starts": 0, "stay_off": 0x5A, "mode": 1}.items():
        board.set(name, value)
    board.machine.run(15.5e-3)
    before = board.get("starts")
    board.machine.run(1.2e-3)
    assert (before, board.get("starts"), board.get("flags_at_start")) == (0, 1, 0x08)
