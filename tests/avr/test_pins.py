"""Pins: pin-change and external interrupts, planned edges, cycles driven high, resets."""

import pytest

LED, A, B, PORT_PIN, PWM_PIN = 13, 2, 4, 7, 5
INT_PINS = (2, 3)  # of INT0 and INT1
GROUP_B, GROUP_D = 1, 4  # bits of PCICR and PCIFR
PCIFR, PCMSK0 = 0x3B, 0x6B  # registers
READ, CLEAR, CLEAR_BY_SBI, ENABLE, DIRECTION, PORT, TOGGLE = range(1, 8)
PWM, INTERRUPTS_OFF, INTERRUPTS_ON, CBI_OF_FLAG = range(8, 12)
# data sheet, "Interrupt Response Time"; the vector is a JMP
ENTRY_CYCLES, VECTOR_CYCLES, WAKE_CYCLES = 4, 3, 4
LOOP_INSTRUCTION_CYCLES = 2  # the longest one of the sketch's loop
COMMAND_S = 20e-6
LOW, ANY, FALLING, RISING = 0, 1, 2, 3


def started(bench, **settings):
    """The sketch with these variables set, and D2 and D4 low."""
    board = bench("pins.c")
    for pin in (A, B):
        board.machine.set_pin(pin, 0)
    for name, value in dict({"mask": 1 << A | 1 << B, "enable": GROUP_D, "go": 1}, **settings).items():
        board.set(name, value)
    board.machine.watch_pins([LED, A, B, PORT_PIN])
    board.machine.run(COMMAND_S)
    board.machine.pin_changes()
    return board


def tell(board, command, value=0):
    board.set("value", value)
    board.set("command", command)
    board.machine.run(COMMAND_S)


def shown(board):
    """Cycles at which the interrupt's routine began since the last call."""
    return [change.cycle for change in board.machine.pin_changes() if change.pin == LED]


def test_a_pin_change_wakes_the_chip(bench):
    board = started(bench, asleep=1)
    edge = board.machine.cycle + 12345
    board.machine.plan_edges(A, [edge])
    board.machine.run(2e-3)
    assert shown(board) == [edge + WAKE_CYCLES + ENTRY_CYCLES + VECTOR_CYCLES]


def test_an_edge_behind_the_entry_interrupts_again(bench):
    """The entry clears the flag; three cycles later another edge sets it."""
    board = started(bench, asleep=1)
    edge = board.machine.cycle + 1000
    board.machine.plan_edges(A, [edge, edge + WAKE_CYCLES + ENTRY_CYCLES + 3])
    board.machine.run(1e-3)
    assert (board.get("changes"), board.machine.pin(A)) == (2, 0)


def test_the_flag_is_set_while_the_group_is_off(bench):
    board = started(bench, enable=0)
    board.machine.plan_edges(A, [board.machine.cycle + 100])
    board.machine.run(COMMAND_S)
    tell(board, READ)
    before = (board.get("changes"), board.get("flags"))
    tell(board, ENABLE, GROUP_D)
    assert (before, board.get("changes")) == ((0, GROUP_D), 1)


@pytest.mark.parametrize(
    "command, left", [(CLEAR, GROUP_D), (CLEAR_BY_SBI, GROUP_B), (CBI_OF_FLAG, GROUP_B | GROUP_D)]
)
def test_a_one_clears_its_flag_alone(bench, command, left):
    """With SBI, the program clears the flag of D; with a write of 1, that of B; with CBI, none."""
    board = started(bench, enable=0, masked_pin_change=1)
    board.machine.plan_edges(A, [board.machine.cycle + 100])
    board.machine.plan_edges(8, [board.machine.cycle + 100])
    board.machine.run(COMMAND_S)
    tell(board, command, GROUP_B)
    tell(board, READ)
    assert board.get("flags") == left


@pytest.mark.parametrize("pin", range(20))
def test_a_change_of_any_pin_flags_its_group(bench, pin):
    board = bench("memory.c")  # all pins are inputs
    group, bit = (2, pin) if pin < 8 else (0, pin - 8) if pin < 14 else (1, pin - 14)
    board.machine.poke(PCMSK0 + group, bytes([1 << bit]))
    for changed in range(20):
        board.machine.set_pin(changed, not board.machine.pin(changed))
        flag = board.machine.peek(PCIFR)[0]
        board.machine.poke(PCIFR, b"\0")
        assert flag == (1 << group if changed == pin else 0)


@pytest.mark.parametrize("number, pin", list(enumerate(INT_PINS)))
@pytest.mark.parametrize("sense, expected", [(ANY, 4), (FALLING, 2), (RISING, 2)])
def test_an_external_interrupt_has_a_sense(bench, sense, expected, number, pin):
    board = started(bench, enable=0, sense=sense << 2 * number, external=1 << number)
    begun = board.machine.cycle
    board.machine.plan_edges(pin, range(begun + 500, begun + 2500, 500))
    board.machine.run(1e-3)
    assert board.get("externals") == expected


def test_the_time_high_of_an_output_is_exact(bench):
    board = started(bench)
    tell(board, DIRECTION, 1 << PORT_PIN)
    for value in (1 << PORT_PIN, 0, 1 << PORT_PIN, 0):
        tell(board, PORT, value)
    begun, first, second, third, last = [
        each.cycle for each in board.machine.pin_changes() if each.pin == PORT_PIN
    ]
    assert board.machine.high_cycles(PORT_PIN) == second - first + last - third


def test_pwm_drives_its_pin_only_while_it_is_an_output(bench):
    board = started(bench)
    tell(board, DIRECTION, 1 << PWM_PIN)
    tell(board, PWM, 255)
    board.machine.run(1e-3)
    tell(board, DIRECTION, 0)
    high = board.machine.high_cycles(PWM_PIN)
    board.machine.run(1e-3)
    assert board.machine.high_cycles(PWM_PIN) == high > 0


@pytest.mark.parametrize("pin", [PORT_PIN, PWM_PIN])
@pytest.mark.parametrize("action", ["reset", "brown_out", "power_cycle"])
def test_a_reset_lets_all_pins_float(bench, action, pin):
    board = started(bench)
    tell(board, DIRECTION, 1 << pin)
    tell(board, PORT, 1 << pin)
    if pin == PWM_PIN:
        tell(board, PWM, 255)
    board.machine.run(1e-3)
    before = board.machine.high_cycles(pin)
    getattr(board.machine, action)()
    board.machine.run(1e-3)
    assert board.machine.high_cycles(pin) == before > 0


def test_a_brown_out_holds_the_chip_in_reset(bench):
    """The sketch starts afterwards; what nobody drives is not counted meanwhile."""
    board = started(bench)
    tell(board, DIRECTION, 1 << PORT_PIN)
    tell(board, PORT, 1 << PORT_PIN)
    begun, high, resets = board.machine.cycle, board.machine.high_cycles(PORT_PIN), board.machine.resets
    board.machine.brown_out(0.05)
    assert (board.machine.cycle - begun, board.machine.pc, board.machine.resets - resets) == (800000, 0, 1)
    assert board.machine.high_cycles(PORT_PIN) == high


@pytest.mark.parametrize("writing, offset", [*((0, offset) for offset in range(5)), (1, 4000)])
def test_a_pin_change_interrupts_after_the_running_instruction(bench, writing, offset):
    """Four cycles for the entry, three for the jump in the vector; also while a program writes PCICR all the time."""
    board = started(bench, writing=writing)
    edge = board.machine.cycle + 1000 + offset
    board.machine.plan_edges(A, [edge])
    board.machine.run(1e-3)
    (routine,) = shown(board)
    assert 0 <= routine - edge - ENTRY_CYCLES - VECTOR_CYCLES < LOOP_INSTRUCTION_CYCLES
