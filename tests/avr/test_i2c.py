"""TWI master: clock, bytes, START and STOP, acknowledge, faults."""

import pytest

TWINT, TWEA, TWSTA, TWSTO, TWEN = 0x80, 0x40, 0x20, 0x10, 0x04
GO = TWINT | TWEN
SCL_100K, SCL_400K = 160, 40  # cycles per clock at TWBR 72 and 12
POLL_CYCLES = 20  # of the program's waiting loop, and its own instructions; they depend on the compiler
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


RECEIVE, RECEIVE_LAST = (GO | TWEA, 0), (GO, 0)


def send(value):
    return (GO, value)


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


READ = [START, send(0x30), send(0xD8), START, send(0x31), RECEIVE, RECEIVE, RECEIVE_LAST, STOP]


def test_a_write_reports_its_states_and_brings_its_bytes(bench):
    slave = Slave()
    board = run_script(bench, WRITE, slave)
    assert list(board.bytes("status")[:4]) == [0x08, 0x18, 0x28, 0x28]
    assert (slave.written, board.get("done")) == ([b"\xeb\x01"], 1)


@pytest.mark.parametrize("answer", [b"\x11\x22\x33", b"\x11"])
def test_a_read_after_repeated_start_reports_its_states_and_brings_bytes(bench, answer):
    slave = Slave(answer)
    board = run_script(bench, READ, slave)
    assert list(board.bytes("status")[:8]) == [0x08, 0x18, 0x28, 0x10, 0x40, 0x50, 0x50, 0x58]
    assert board.bytes("received")[5:8] == answer.ljust(3, b"\xff")
    assert slave.written == [b"\xd8"] and slave.times[0] < slave.times[1]


@pytest.mark.parametrize("line", ["sda", "scl"])
def test_a_start_waits_while_the_bus_hangs(bench, line):
    board, slave = bench("twi.c"), Slave()
    board.machine.i2c[MOTOR_BOARD] = slave
    board.machine.hang_bus(line)
    start_script(board, WRITE)
    board.machine.run(20e-3)
    assert (board.get("done"), board.bytes("status")[0], slave.written) == (0, 0, [])
    board.machine.hang_bus(None)
    board.machine.run(1e-3)
    assert slave.written == [b"\xeb\x01"]


def test_an_absent_slave_does_not_acknowledge(bench):
    write = run_script(bench, [START, send(0x30), STOP])
    read = run_script(bench, [START, send(0x31), STOP])
    assert (write.bytes("status")[1], read.bytes("status")[1]) == (0x20, 0x48)


def test_a_slave_that_refuses_a_byte_ends_the_write_there(bench):
    board, slave = bench("twi.c"), Slave()
    board.machine.i2c[MOTOR_BOARD] = slave
    board.machine.nack_after(1)
    start_script(board, WRITE)
    board.machine.run(2e-3)
    assert (board.bytes("status")[3], slave.written) == (0x30, [b"\xeb"])


def test_sda_going_low_in_a_transfer_loses_arbitration(bench):
    board = bench("twi.c")
    board.machine.i2c[MOTOR_BOARD] = Slave()
    start_script(board, WRITE[:3], bit_rate=72)
    board.machine.run_until(board.machine.cycle + 12 * SCL_100K)
    board.machine.hang_bus("sda")
    board.machine.run(1e-3)
    assert board.bytes("status")[2] == 0x38


@pytest.mark.parametrize("line, pins", [("sda", 0x20), ("scl", 0x10), (None, 0x30)])
def test_a_hung_line_reads_low_on_its_pin(bench, line, pins):
    board = bench("memory.c")
    board.machine.hang_bus(line)
    board.set("action", 5)
    board.machine.run(50e-6)
    assert board.get("pins_seen") & 0x30 == pins


def test_switching_the_interface_off_releases_the_bus(bench):
    board = run_script(bench, [START, send(0x30), (0, 0), START, STOP], Slave())
    assert list(board.bytes("status")[:4]) == [0x08, 0x18, 0xF8, 0x08]


def test_a_slaves_exception_comes_out_of_run(bench):

    class Broken(Slave):
        def write(self, data, time_s):
            raise RuntimeError("broken slave")

    with pytest.raises(RuntimeError, match="broken slave"):
        run_script(bench, WRITE, Broken())


def test_the_interrupt_repeats_while_twint_stays(bench):
    """A vector that does not clear TWINT is entered again and again, one instruction apart."""
    board = bench("twi_interrupt.c")
    board.set("handle", 0)
    board.set("go", 1)
    board.machine.run(200e-6)
    before = board.get("passes")
    assert board.get("interrupts") > 20
    board.machine.run(1e-3)
    assert board.get("passes") > before
