"""The harness's C interface for ctypes: structures, callbacks and signatures of `board.h`."""

import ctypes
from ctypes import (
    POINTER,
    Structure,
    c_char_p,
    c_double,
    c_int,
    c_size_t,
    c_uint8,
    c_uint32,
    c_uint64,
    c_void_p,
)
from typing import Any, Dict, List, Tuple

from .build import SimulatorMissing, build, library_path

RUN_CRASHED = 1

PRESENT = ctypes.CFUNCTYPE(c_int, c_uint8, c_uint64)
WRITE = ctypes.CFUNCTYPE(None, c_uint8, POINTER(c_uint8), c_int, c_uint64)
READ = ctypes.CFUNCTYPE(c_int, c_uint8, POINTER(c_uint8), c_int, c_uint64)
ADC = ctypes.CFUNCTYPE(c_double, c_int, c_uint64)
PIN = ctypes.CFUNCTYPE(None, c_int, c_int, c_int, c_uint64)


class Hooks(Structure):
    """hooks_t: callbacks through which the board reaches the hardware outside the chip."""

    _fields_ = [("present", PRESENT), ("write", WRITE), ("read", READ), ("adc", ADC), ("pin", PIN)]


class Sent(Structure):
    """sent_byte_t: one byte that left the transmitter."""

    _fields_ = [("start", c_uint64), ("end", c_uint64), ("data", c_uint8)]


class PinEvent(Structure):
    """pin_event_t: one change of a watched pin."""

    _fields_ = [("cycle", c_uint64), ("port", c_uint8), ("bit", c_uint8), ("level", c_uint8)]


_BOARD = _UART = c_void_p
_SIGNATURES: Dict[str, Tuple[Any, List[Any]]] = {
    "mrl_create": (_BOARD, [c_uint32, POINTER(Hooks)]),
    "mrl_destroy": (None, [_BOARD]),
    "mrl_load": (None, [_BOARD, c_char_p, c_uint32, c_uint32]),
    "mrl_run_until": (c_int, [_BOARD, c_uint64]),
    "mrl_stall_until": (None, [_BOARD, c_uint64]),
    "mrl_stop": (None, [_BOARD]),
    "mrl_reset": (None, [_BOARD]),
    "mrl_brown_out": (None, [_BOARD, c_uint64]),
    "mrl_power_cycle": (None, [_BOARD, c_char_p]),
    "mrl_set_reset_flags": (None, [_BOARD, c_int]),
    "mrl_cycle": (c_uint64, [_BOARD]),
    "mrl_pc": (c_uint32, [_BOARD]),
    "mrl_interrupts_on": (c_int, [_BOARD]),
    "mrl_crash_pc": (c_uint32, [_BOARD]),
    "mrl_resets": (c_uint64, [_BOARD]),
    "mrl_ram_end": (c_uint32, [_BOARD]),
    "mrl_slept": (c_uint64, [_BOARD]),
    "mrl_next_event": (c_uint64, [_BOARD]),
    "mrl_data": (POINTER(c_uint8), [_BOARD]),
    "mrl_message": (c_char_p, []),
    "mrl_uart": (_UART, [_BOARD, c_int]),
    "mrl_uart_send": (None, [_UART, c_char_p, c_size_t, c_uint64]),
    "mrl_uart_set_host": (None, [_UART, c_double, c_double]),
    "mrl_uart_line_free": (c_double, [_UART]),
    "mrl_uart_lost": (c_uint64, [_UART]),
    "mrl_uart_bit": (c_uint64, [_UART]),
    "mrl_uart_sent": (POINTER(Sent), [_UART, POINTER(c_size_t)]),
    "mrl_twi_set_hang": (None, [_BOARD, c_int, c_int]),
    "mrl_twi_set_stretch": (None, [_BOARD, c_int]),
    "mrl_twi_set_nack_after": (None, [_BOARD, c_int]),
    "mrl_pin_set": (None, [_BOARD, c_int, c_int, c_int]),
    "mrl_pin_plan": (None, [_BOARD, c_int, c_int, c_int, c_uint64]),
    "mrl_plan_edges": (None, [_BOARD, c_int, c_int, POINTER(c_uint64), c_size_t]),
    "mrl_pin_high_cycles": (c_uint64, [_BOARD, c_int, c_int]),
    "mrl_pin_level": (c_int, [_BOARD, c_int, c_int]),
    "mrl_pin_watch": (None, [_BOARD, c_int, c_int]),
    "mrl_pin_changes": (POINTER(PinEvent), [_BOARD, POINTER(c_size_t)]),
    "mrl_eeprom": (POINTER(c_uint8), [_BOARD]),
}

_loaded: Dict[str, ctypes.CDLL] = {}


def load(chip: str) -> ctypes.CDLL:
    """The harness library for a chip with its signatures set; it is compiled first if necessary.

    Raises:
        SimulatorMissing: the harness cannot be compiled or loaded here; the message names the Debian packages.
    """
    path = str(build(library_path(chip), chip))
    if path not in _loaded:
        try:
            library = ctypes.CDLL(path)
        except OSError as error:
            raise SimulatorMissing(f"{error}: on Debian, apt-get install libsimavr2") from error
        for name, (result, arguments) in _SIGNATURES.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
        _loaded[path] = library
    return _loaded[path]
