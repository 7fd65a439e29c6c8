"""TWI master: clock, bytes, START and STOP, acknowledge, faults."""

import pytest

TWINT, TWEA, TWSTA, TWSTO, TWEN = 0x80, 0x40, 0x20, 0x10, 0x04
GO = TWINT | TWEN
SCL_100K, SCL_400K = 160, 40  # cycles per clock at TWBR 72 and 12
POLL_CYCLES = 20  # of the program's waiting loop, and its own instructions; they depend on the compiler
PROGRAM_CYCLES = 80  # between two steps of the script
START, STOP = (GO | TWSTA, 0), (GO | TWSTO, 0)
MOTOR_BOARD = 0x18


class Slave:
    """Remembers writes, answers reads with `answer`."""

    def __init__(self, answer=b"\x01\x02\x03\x04"):
        self.answer, self.written, self.times = answer, [], []

    def write(self, data, time_s):
        self.written.append(data)
        self.times.append(time_s)
        return True

    def read(self, count, time_s):
        self.times.append(time_s)
        return self.answer


def send(value):
    return (GO, value)


def receive(acknowledge=True):
    return (GO | (TWEA if acknowledge else 0), 0)


def start_script(board, steps, bit_rate=12, prescaler=0):
    board.set("bit_rate", bit_rate)
    board.set("prescaler", prescaler)
    for index, (control, value) in enumerate(steps + [(0xFF, 0)]):
        board.machine.poke(board.machine.symbol("control").address + index, bytes([control]))
        board.machine.poke(board.machine.symbol("value").address + index, bytes([value]))
    board.set("go", 1)


def run_script(bench, steps, slave=None, **settings):
    """The board after `steps`; `slave` sits at the motor board's address."""
    board = bench("twi.c")
    if slave is not None:
        board.machine.i2c[MOTOR_BOARD] = slave
    start_script(board, steps, **settings)
    board.machine.run(5e-3)
    return board


WRITE = [START, send(0x30), send(0xEB), send(0x01), STOP]


@pytest.mark.parametrize(
    "bit_rate, prescaler, scl", [(72, 0, SCL_100K), (12, 0, SCL_400K), (12, 1, 112), (2, 2, 80), (1, 3, 144)]
)
def test_a_byte_takes_nine_clocks(bench, bit_rate, prescaler, scl):
    """SCL is F_CPU / (16 + 2 TWBR 4^PS)."""
    board = run_script(bench, WRITE, Slave(), bit_rate=bit_rate, prescaler=prescaler)
    assert 0 <= board.words("elapsed")[1] - 9 * scl <= POLL_CYCLES


@pytest.mark.parametrize("step", [0, 4])
def test_start_and_stop_take_one_clock(bench, step):
    """10 us at 100 kHz."""
    board = run_script(bench, WRITE, Slave(), bit_rate=72)
    assert 0 <= board.words("elapsed")[step] - SCL_100K <= POLL_CYCLES


def test_a_write_reports_start_and_acknowledged_bytes(bench):
    """Status codes of master transmitter mode."""
    board = run_script(bench, WRITE, Slave())
    assert list(board.bytes("status")[:4]) == [0x08, 0x18, 0x28, 0x28]


def test_a_slave_gets_the_bytes_of_a_write(bench):
    """Without the address."""
    slave = Slave()
    run_script(bench, WRITE, slave)
    assert slave.written == [b"\xeb\x01"]


def test_stop_clears_its_own_bit(bench):
    """The program's wait for TWSTO to clear ends."""
    assert run_script(bench, WRITE, Slave()).get("done") == 1


READ = [START, send(0x30), send(0xD8), START, send(0x31), receive(), receive(), receive(False), STOP]


def test_a_read_after_repeated_start_reports_its_states(bench):
    """Status codes of master receiver mode."""
    board = run_script(bench, READ, Slave())
    assert list(board.bytes("status")[:8]) == [0x08, 0x18, 0x28, 0x10, 0x40, 0x50, 0x50, 0x58]


def test_a_read_brings_the_slaves_bytes(bench):
    """In order, from the first after the address."""
    board = run_script(bench, READ, Slave(b"\x11\x22\x33"))
    assert board.bytes("received")[5:8] == b"\x11\x22\x33"


def test_beyond_the_slaves_bytes_the_bus_reads_ones(bench):
    """Nobody pulls SDA down."""
    board = run_script(bench, READ, Slave(b"\x11"))
    assert board.bytes("received")[5:8] == b"\x11\xff\xff"


def test_a_repeated_start_ends_the_write(bench):
    """The slave has its register address before it is read."""
    slave = Slave()
    run_script(bench, READ, slave)
    assert slave.written == [b"\xd8"] and slave.times[0] < slave.times[1]


def test_a_slave_hears_of_a_read_when_its_address_is_through(bench):
    """Nine clocks after the repeated START that ended the write, plus the program's own cycles."""
    slave, transfers = Slave(), []
    board = bench("twi.c")
    board.machine.i2c[MOTOR_BOARD] = slave
    board.machine.on_transfer = transfers.append
    start_script(board, READ)
    board.machine.run(1e-3)
    assert 0 <= transfers[1].cycle - transfers[0].cycle - 9 * SCL_400K <= PROGRAM_CYCLES


def test_an_absent_slave_does_not_acknowledge(bench):
    """SLA+W NACK, SLA+R NACK."""
    write = run_script(bench, [START, send(0x30), STOP])
    read = run_script(bench, [START, send(0x31), STOP])
    assert (write.bytes("status")[1], read.bytes("status")[1]) == (0x20, 0x48)


def test_a_slave_that_is_switched_off_does_not_acknowledge(bench):
    """`present` is asked at each address."""
    slave = Slave()
    slave.present = False
    assert run_script(bench, WRITE[:2] + [STOP], slave).bytes("status")[1] == 0x20


def test_a_slave_that_refuses_a_byte_ends_the_write_there(bench):
    """Data NACK after one byte; that byte is not delivered."""
    board, slave = bench("twi.c"), Slave()
    board.machine.i2c[MOTOR_BOARD] = slave
    board.machine.nack_after(1)
    start_script(board, WRITE)
    board.machine.run(2e-3)
    assert (board.bytes("status")[3], slave.written) == (0x30, [b"\xeb"])


def test_stretching_lengthens_a_byte(bench):
    """By the cycles asked for."""
    board = bench("twi.c")
    board.machine.i2c[MOTOR_BOARD] = Slave()
    board.machine.stretch_clock(1000)
    start_script(board, WRITE)
    board.machine.run(2e-3)
    assert 0 <= board.words("elapsed")[1] - 9 * SCL_400K - 1000 <= POLL_CYCLES


@pytest.mark.parametrize("line", ["sda", "scl"])
def test_a_hung_bus_never_starts(bench, line):
    """START waits for ever."""
    board = bench("twi.c")
    board.machine.hang_bus(line)
    start_script(board, WRITE)
    board.machine.run(20e-3)
    assert board.get("done") == 0 and board.bytes("status")[0] == 0


def test_a_freed_bus_goes_on(bench):
    """The pending START happens."""
    board, slave = bench("twi.c"), Slave()
    board.machine.i2c[MOTOR_BOARD] = slave
    board.machine.hang_bus("scl")
    start_script(board, WRITE)
    board.machine.run(1e-3)
    board.machine.hang_bus(None)
    board.machine.run(1e-3)
    assert slave.written == [b"\xeb\x01"]


def test_sda_going_low_in_a_transfer_loses_arbitration(bench):
    """Status 0x38 instead of an acknowledge."""
    board = bench("twi.c")
    board.machine.i2c[MOTOR_BOARD] = Slave()
    start_script(board, WRITE[:3], bit_rate=72)
    board.machine.run_until(board.machine.cycle + 12 * SCL_100K)
    board.machine.hang_bus("sda")
    board.machine.run(1e-3)
    assert board.bytes("status")[2] == 0x38


@pytest.mark.parametrize("line, pins", [("sda", 0x20), ("scl", 0x10), (None, 0x30)])
def test_a_hung_line_reads_low_on_its_pin(bench, line, pins):
    """A4 is SDA, A5 is SCL."""
    board = bench("memory.c")
    board.machine.hang_bus(line)
    board.set("action", 5)
    board.machine.run(50e-6)
    assert board.get("pins_seen") & 0x30 == pins


def test_clock_pulses_by_hand_free_sda(bench):
    """Nine pulses on A5 free a slave that waits for eight."""
    board = bench("memory.c")
    board.machine.hang_bus("sda", release_clocks=8)
    board.set("action", 6)
    board.machine.run(100e-6)
    assert board.get("pins_seen") & 0x10 == 0x10


def test_too_few_pulses_free_nothing(bench):
    """Nine pulses do not free a slave that waits for ten."""
    board = bench("memory.c")
    board.machine.hang_bus("sda", release_clocks=10)
    board.set("action", 6)
    board.machine.run(100e-6)
    assert board.get("pins_seen") & 0x10 == 0


def test_the_interrupt_comes_with_twint(bench):
    """One START, one interrupt."""
    board = bench("twi_interrupt.c")
    board.set("go", 1)
    board.machine.run(200e-6)
    assert board.get("interrupts") == 1


def test_the_interrupt_repeats_while_twint_stays(bench):
    """A vector that does not clear TWINT is entered again and again, one instruction apart."""
    board = bench("twi_interrupt.c")
    board.set("handle", 0)
    board.set("go", 1)
    board.machine.run(200e-6)
    assert board.get("interrupts") > 20


def test_between_two_interrupts_the_program_goes_on(bench):
    """One instruction each time, even when the flag stays."""
    board = bench("twi_interrupt.c")
    board.set("handle", 0)
    board.set("go", 1)
    board.machine.run(200e-6)
    before = board.get("passes")
    board.machine.run(1e-3)
    assert board.get("passes") > before


def test_switching_the_interface_off_releases_the_bus(bench):
    """The next START is none of a transfer under way."""
    board = run_script(bench, [START, send(0x30), (0, 0), START, STOP], Slave())
    assert list(board.bytes("status")[:4]) == [0x08, 0x18, 0xF8, 0x08]


def test_a_slaves_exception_comes_out_of_run(bench):
    """It is not lost on its way through C."""

    class Broken(Slave):
        def write(self, data, time_s):
            raise RuntimeError("broken slave")

    with pytest.raises(RuntimeError, match="broken slave"):
        run_script(bench, WRITE, Broken())
