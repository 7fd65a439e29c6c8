"""The environment build's image on the simulated chip: dust pulses through the capture input, inputs at their pins."""

from pathlib import Path

import pytest

from mrl_driver.protocol import REPLIES, FrameDecoder
from sim_arduino.avr.machine import AvrMachine

IMAGE = Path(__file__).resolve().parent.parent.parent / "build" / "firmware" / "mrl_firmware_environment.elf"
HZ = 16_000_000
DUST = 8
VOLTS = {0: 2.0, 2: 1.0}
LITRES = 0.2832


@pytest.fixture
def chip():
    machine = AvrMachine(IMAGE)
    machine.adc_volts = lambda channel, time_s: VOLTS.get(channel, 0.0)
    machine.set_pin(DUST, 1)
    machine.run(0.1)
    machine.sent()
    yield machine
    machine.close()


def ask(machine, wire):
    machine.sent()
    machine.send(wire)
    machine.run(0.02)
    return FrameDecoder(REPLIES).feed(bytes(byte.data for byte in machine.sent()))[0]


def test_alcohol(chip):
    """2.0 V of 5 V are 409 counts."""
    assert ask(chip, b"@20e").args == (1023 - 409,)


def test_dust_pulses_are_timed(chip):
    """15 ms low every 500 ms for ten seconds: 3 % of the time."""
    begin = chip.cycle
    for n in range(20):
        chip.set_pin(DUST, 0, begin + int((0.5 * n + 0.2) * HZ))
        chip.set_pin(DUST, 1, begin + int((0.5 * n + 0.215) * HZ))
    chip.run(10.0)
    wanted = (1.1 * 27 - 3.8 * 9 + 520 * 3) / LITRES
    assert ask(chip, b"@21e").args[0] == pytest.approx(wanted, rel=0.03)


def test_dust_pulses_beside_a_full_stream_of_commands(chip):
    """The capture register holds the edge's time until the interrupt comes."""
    begin = chip.cycle
    chip.send(b"@30e" * 2500)
    for n in range(20):
        chip.set_pin(DUST, 0, begin + int((0.05 * n + 0.02) * HZ))
        chip.set_pin(DUST, 1, begin + int((0.05 * n + 0.0215) * HZ))
    chip.run(1.2)
    wanted = (1.1 * 15.6 - 3.8 * 6.25 + 520 * 2.5) / LITRES
    assert ask(chip, b"@21e").args[0] == pytest.approx(wanted, rel=0.15)
