"""Requests about the board: identity, status, checksum, watchdog, configuration, radio."""

import struct

from mrl_driver.protocol.table import CAPABILITIES, PARAMETERS, PROTOCOL_VERSION, REASONS

from .parameter_store import EEPROM_BYTE_S, EEPROM_LOOK_S
from .python_board import PythonBoard
from .registry import REPLIES, REQUESTS, Values

_CAPABILITY = {name: 1 << bit for bit, (name, _) in enumerate(CAPABILITIES)}


def _protocol(board: PythonBoard, _: int) -> Values:
    return PROTOCOL_VERSION, sum(_CAPABILITY[name] for name in board.capabilities)


def _status(board: PythonBoard, _: int) -> Values:
    uptime = int(board.now_s - board.started_s)
    return (uptime >> 15, uptime & 0x7FFF) + board.health.read() + board.motors.status()


def _counters(board: PythonBoard, _: int) -> Values:
    known = REASONS if board.radio and board.radio.hold.on else REASONS[:-1]
    return tuple(board.health.counters[reason.name] for reason in known)


def _set_debug(board: PythonBoard, on: int) -> None:
    board.debug = bool(on)


def _set_check(board: PythonBoard, on: int) -> None:
    board.ask_for_checks(bool(on))
    board.ask("set_check", on)


def _set_watchdog(board: PythonBoard, period: int) -> None:
    board.watchdog_ms = period
    board.health.stops_are_final = period > 0
    board.ask("set_watchdog")


def _set_baud(board: PythonBoard, rate: int) -> None:
    """The baud rate changes after the reply has left."""
    board.ask("set_baud", rate)
    board.wanted_baud = rate


# ---- configuration


def _write_config(board: PythonBoard, index: int, value: int) -> None:
    row = PARAMETERS[index]
    if not row.low <= value <= row.high:
        board.refuse("argument_range")
        return
    board.config[row.name] = value
    board.health.set_fault("id_unset", board.config["robot_id"] == 0)
    board.motors.refresh(board.now_s, row.name)
    board.ask("write_config", index)


def _save_config(board: PythonBoard) -> None:
    """The reply comes after the last byte is written."""
    changed = board.config.save()
    board.health.set_fault("eeprom", False)
    board.ask("save_config", 1, after_s=EEPROM_LOOK_S + changed * EEPROM_BYTE_S)


def _default_config(board: PythonBoard) -> None:
    board.config.set_defaults()
    board.motors.refresh(board.now_s)
    board.ask("default_config", 1)


def _config(board: PythonBoard, index: int) -> Values:
    return index, board.config.values[index]


# ---- radio


def _send_xbee(board: PythonBoard, *values: int) -> None:
    address, length = int.from_bytes(struct.pack(">4h", *values[:4]), "big"), values[4]
    text = struct.pack(f">{len(values) - 5}h", *values[5:])
    if len(text) != length + length % 2:
        board.refuse("argument_count")
    elif not board.radio or not board.radio.send(address, text[:length], board.now_s):
        board.refuse("unavailable")


def _discover_xbee(board: PythonBoard) -> None:
    if not board.radio or not board.radio.discover(board.now_s):
        board.refuse("unavailable")


def _release_hold(board: PythonBoard) -> None:
    assert board.radio
    board.ask("release_hold", board.radio.hold.release())


def _value(_: PythonBoard, value: int) -> Values:
    return (value,)


REQUESTS.update(
    {
        "set_debug": _set_debug,
        "set_check": _set_check,
        "set_watchdog": _set_watchdog,
        "set_baud": _set_baud,
        "read_config": lambda board, index: board.ask("read_config", index),
        "write_config": _write_config,
        "save_config": _save_config,
        "default_config": _default_config,
        "send_xbee": _send_xbee,
        "discover_xbee": _discover_xbee,
        "release_hold": _release_hold,
    }
)
REPLIES.update(
    {
        "robot_info": lambda board, _: (
            *board.motors.info(board.now_s),
            PROTOCOL_VERSION,
            board.config["robot_id"],
        ),
        "get_debug": lambda board, _: (int(board.debug),),
        "get_stream": lambda board, _: (int(board.stream is not None),),
        "read_protocol": _protocol,
        "read_status": _status,
        "read_counters": _counters,
        "set_check": _value,
        "set_watchdog": lambda board, _: (board.watchdog_ms,),
        "set_baud": _value,
        "read_config": _config,
        "write_config": _config,
        "save_config": _value,
        "default_config": _value,
        "xbee_text": lambda board, _: board.radio.text(),
        "discover_xbee": lambda board, _: board.radio.node(),
        "read_radio": lambda board, _: board.radio.hold.report(),
        "release_hold": _value,
    }
)
