"""Handlers of the requests about the board: identity, status, checksum, watchdog, configuration, radio."""

import struct
from typing import Sequence

from mrl_driver.protocol.table import BY_NAME, CAPABILITIES, PARAMETERS, PROTOCOL_VERSION, REASONS

from .parameter_store import EEPROM_BYTE_S, EEPROM_LOOK_S
from .python_board import PythonBoard
from .registry import Values, reply, request

_CAPABILITY = {name: 1 << bit for bit, (name, _) in enumerate(CAPABILITIES)}


@reply("robot_info")
def _robot_info(board: PythonBoard, _: int) -> Values:
    return (*board.motors.info(board.now_s), PROTOCOL_VERSION, board.config["robot_id"])


@request
def set_debug(board: PythonBoard, on: int) -> None:
    """16."""
    board.debug = bool(on)


@reply("get_debug")
def _debug(board: PythonBoard, _: int) -> Values:
    return (int(board.debug),)


@reply("get_stream")
def _stream(board: PythonBoard, _: int) -> Values:
    return (int(board.stream is not None),)


@reply("read_protocol")
def _protocol(board: PythonBoard, _: int) -> Values:
    return PROTOCOL_VERSION, sum(_CAPABILITY[name] for name in board.capabilities)


@reply("read_status")
def _status(board: PythonBoard, _: int) -> Values:
    uptime = int(board.now_s - board.started_s)
    return (uptime >> 15, uptime & 0x7FFF) + board.health.read() + board.motors.status()


@reply("read_counters")
def _counters(board: PythonBoard, _: int) -> Values:
    known = REASONS if board.radio and board.radio.hold.on else REASONS[:-1]
    return tuple(board.health.counters[reason.name] for reason in known)


# ---- checksum, watchdog, configuration


@request
def set_check(board: PythonBoard, on: int) -> None:
    """32."""
    board.ask_for_checks(bool(on))
    board.ask(BY_NAME["set_check"].code, on)


@request
def set_watchdog(board: PythonBoard, period: int) -> None:
    """33."""
    board.watchdog_ms = period
    board.health.stops_are_final = period > 0
    board.ask(BY_NAME["set_watchdog"].code)


@request
def read_config(board: PythonBoard, index: int) -> None:
    """34."""
    board.ask(BY_NAME["read_config"].code, index)


@request
def write_config(board: PythonBoard, index: int, value: int) -> None:
    """35."""
    row = PARAMETERS[index]
    if not row.low <= value <= row.high:
        board.refuse("argument_range")
        return
    board.config[row.name] = value
    board.health.set_fault("id_unset", board.config["robot_id"] == 0)
    board.motors.refresh(board.now_s, row.name)
    board.ask(BY_NAME["write_config"].code, index)


@request
def save_config(board: PythonBoard) -> None:
    """36: the reply comes after the last byte is written."""
    changed = board.config.save()
    board.health.set_fault("eeprom", False)
    board.ask(BY_NAME["save_config"].code, 1, after_s=EEPROM_LOOK_S + changed * EEPROM_BYTE_S)


@request
def default_config(board: PythonBoard) -> None:
    """37."""
    board.config.set_defaults()
    board.motors.refresh(board.now_s)
    board.ask(BY_NAME["default_config"].code, 1)


@reply("read_config", "write_config")
def _config(board: PythonBoard, index: int) -> Values:
    return index, board.config.values[index]


@request
def set_baud(board: PythonBoard, rate: int) -> None:
    """45: the baud rate changes after the reply has left."""
    board.ask(BY_NAME["set_baud"].code, rate)
    board.wanted_baud = rate


@reply("set_baud", "set_check", "save_config", "default_config", "release_hold")
def _value(_: PythonBoard, value: int) -> Values:
    return (value,)


@reply("set_watchdog")
def _watchdog(board: PythonBoard, _: int) -> Values:
    return (board.watchdog_ms,)


# ---- radio


@request
def send_xbee(board: PythonBoard, *values: int) -> None:
    """38."""
    *address, length = values[:5]
    text = struct.pack(f">{len(values) - 5}h", *values[5:])
    if len(text) != length + length % 2:
        board.refuse("argument_count")
    elif not board.radio or not board.radio.send(_address(address), text[:length], board.now_s):
        board.refuse("unavailable")


def _address(words: Sequence[int]) -> int:
    return int.from_bytes(struct.pack(">4h", *words), "big")


@reply("xbee_text")
def _xbee_text(board: PythonBoard, _: int) -> Values:
    return board.radio.text() if board.radio else None


@request
def discover_xbee(board: PythonBoard) -> None:
    """40."""
    if not board.radio or not board.radio.discover(board.now_s):
        board.refuse("unavailable")


@reply("discover_xbee")
def _node(board: PythonBoard, _: int) -> Values:
    return board.radio.node() if board.radio else None


@reply("read_radio")
def _radio(board: PythonBoard, _: int) -> Values:
    return board.radio.hold.report() if board.radio else None


@request
def release_hold(board: PythonBoard) -> None:
    """50."""
    assert board.radio
    board.ask(BY_NAME["release_hold"].code, board.radio.hold.release())
