"""ADC, input capture, pins, EEPROM, memory."""

import pytest

from sim_arduino.avr.machine import AvrMachine, MachineCrashed

CONVERSION_CYCLES = 13 * 128  # 104 us at prescaler 128
FIRST_CONVERSION_CYCLES = 25 * 128
POLL_CYCLES = 24
EEPROM_WRITE_S = 3.4e-3
FAN, DUST = 7, 8


def convert(board, channel=0, go=1):
    board.set("channel", channel)
    board.set("go", go)
    board.machine.run(400e-6)
    return board.get("result")


def test_a_conversion_takes_13_adc_clocks_and_the_first_one_25(bench):
    board = bench("adc.c")
    elapsed = []
    for _ in range(2):
        convert(board)
        elapsed.append(board.get("elapsed"))
    for found, cycles in zip(elapsed, (FIRST_CONVERSION_CYCLES, CONVERSION_CYCLES)):
        assert 0 <= found - cycles <= POLL_CYCLES + 128


@pytest.mark.parametrize(
    "volts, count", [(0.0, 0), (1.5, 307), (2.0, 409), (0.8, 163), (2.5, 512), (5.0, 1023), (6.0, 1023)]
)
def test_counts_are_volts_over_the_reference(bench, volts, count):
    board = bench("adc.c")
    board.machine.adc_volts = lambda channel, time_s: volts
    assert convert(board) == count


def test_input_capture_measures_a_pulse(bench):
    """A low pulse of 10 ms on D8 is 20000 counts of 2 MHz."""
    board = bench("capture.c")
    machine = board.machine
    machine.set_pin(DUST, 0, machine.cycle + 1600)
    machine.set_pin(DUST, 1, machine.cycle + 1600 + 160000)
    machine.run(12e-3)
    falling, rising = board.words("captured")[:2]
    assert (board.get("count"), (rising - falling) & 0xFFFF) == (2, 20000)


def test_watched_pins_report_their_changes(bench):
    board, called = bench("memory.c"), []
    board.machine.on_pin = lambda pin, level, time_s: called.append((pin, level))
    board.machine.watch_pins([FAN])
    board.set("action", 7)
    board.machine.run(50e-6)
    assert called == [(FAN, 0), (FAN, 1), (FAN, 0)]
    _, first, second = board.machine.pin_changes()
    assert (first.level, second.level, second.cycle - first.cycle) == (1, 0, 2)


def test_eeprom_outlives_power(bench):
    machine = bench("memory.c").machine
    machine.write_eeprom(0, b"robot")
    machine.power_cycle(1)
    assert machine.read_eeprom(0, 5) == b"robot"


def test_a_stray_write_stops_the_machine_for_good(bench):
    board = bench("memory.c")
    board.set("action", 3)
    told = []
    for _ in range(2):
        with pytest.raises(MachineCrashed, match="pc 0x") as crash:
            board.machine.run(50e-6)
        told.append(str(crash.value).partition(",")[0])
    assert told[0] == told[1]


def test_the_same_inputs_give_the_same_cycles(sketch):
    def run():
        with AvrMachine(sketch("uart.c"), seed=3) as machine:
            machine.run(200e-6)
            machine.poke(machine.symbol("outgoing_count").address, b"\x09")
            machine.run(2e-3)
            return machine.sent()

    assert run() == run() != b""


def test_writing_eeprom_takes_3_4_ms(bench):
    board = bench("memory.c")
    board.set("action", 2)
    board.machine.run(5e-3)
    assert board.machine.read_eeprom(5, 1) == b"\x42"
    assert board.get("elapsed") * 4e-6 == pytest.approx(EEPROM_WRITE_S, abs=20e-6)
