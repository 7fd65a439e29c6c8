"""Bootloaders on a pty, as far as avrdude speaks with them: STK500 version 1 of the Uno and Nano, 2 of the Mega."""

import os
import select
import termios
import threading
import tty
from functools import reduce
from operator import xor

SYNC, OK, END = 0x14, 0x10, 0x20
ARGUMENTS = {0x30: 0, 0x41: 1, 0x42: 20, 0x45: 5, 0x50: 0, 0x51: 0, 0x55: 2, 0x56: 4, 0x74: 3, 0x75: 0}
"""Bytes after each command, but for the page that 0x64 writes, whose length stands in it."""
ATMEGA328P, ATMEGA2560 = b"\x1e\x95\x0f", b"\x1e\x98\x01"
START, TOKEN, HEAD = 0x1B, 0x0E, 5
SIGN_ON, GET_PARAMETER, LOAD_ADDRESS, PROGRAM, READ, SIGNATURE = 0x01, 0x03, 0x06, 0x13, 0x14, 0x1B


class Bootloader:
    """Serves one pty until `close`; `flash` holds what was written.  At another baud rate it sends rubbish."""

    FLASH_BYTES = 32768

    def __init__(self, signature=ATMEGA328P, damaged=False, baud=termios.B115200, damaged_write=False):
        self.baud, self.damaged_write = baud, damaged_write
        self.flash = bytearray(b"\xff" * self.FLASH_BYTES)
        self.signature, self.damaged = signature, damaged
        self.address = 0
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        self.path = os.ttyname(self.slave)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self):
        data = b""
        while not self._end.is_set():
            if select.select([self.master], [], [], 0.02)[0]:
                data += os.read(self.master, 4096)
            if data and termios.tcgetattr(self.slave)[4] != self.baud:
                os.write(self.master, b"\0" * len(data))
                data = b""
            while data:
                size = self._size(data)
                if size is None or len(data) < size:
                    break
                frame, data = data[:size], data[size:]
                os.write(self.master, self._answer(frame))

    @staticmethod
    def _size(data):
        if data[0] != 0x64:
            return ARGUMENTS.get(data[0], 0) + 2
        return 5 + (data[1] << 8 | data[2]) if len(data) >= 3 else None

    def _answer(self, frame):
        if frame[0] == 0x64 and self.damaged_write:
            return bytes([0, OK])
        return bytes([SYNC]) + self._do(frame[0], frame[1:-1]) + bytes([OK]) if frame[-1] == END else b""

    def _do(self, code, args):
        if code == 0x41:
            return b"\x03"
        if code == 0x55:
            self.address = (args[0] | args[1] << 8) * 2
        elif code == 0x56:
            return b"\x00"
        elif code == 0x64:
            page = args[3:]
            self.flash[self.address : self.address + len(page)] = page
        elif code == 0x74:
            return self._read(args[0] << 8 | args[1])
        elif code == 0x75:
            return self.signature
        return b""

    def _read(self, size):
        page = bytes(self.flash[self.address : self.address + size])
        return page[::-1] if self.damaged else page

    def close(self):
        self._end.set()
        self._thread.join()
        os.close(self.slave)
        os.close(self.master)


class MegaBootloader(Bootloader):
    """The bootloader of a Mega 2560: frames with a sequence number, a length and the exclusive or of their bytes."""

    FLASH_BYTES = 256 * 1024

    def __init__(self, signature=ATMEGA2560, **options):
        super().__init__(signature, **options)

    @staticmethod
    def _size(data):
        if data[0] != START:
            return 1
        return HEAD + (data[2] << 8 | data[3]) + 1 if len(data) >= HEAD else None

    def _answer(self, frame):
        if frame[0] != START:
            return b""
        body = frame[HEAD:-1]
        answer = bytes([body[0], 0]) + self._do(body[0], body[1:])
        answer = bytes([START, frame[1], *len(answer).to_bytes(2, "big"), TOKEN]) + answer
        return answer + bytes([reduce(xor, answer)])

    def _do(self, code, args):
        if code == SIGN_ON:
            return b"\x08AVRISP_2"
        if code == GET_PARAMETER:
            return b"\x02"
        if code == SIGNATURE:
            return bytes([self.signature[args[3]], 0])
        if code == LOAD_ADDRESS:
            self.address = (int.from_bytes(args, "big") & 0x7FFFFFFF) * 2
        elif code == PROGRAM:
            page = args[9:]
            self.flash[self.address : self.address + len(page)] = page
            self.address += len(page)
        elif code == READ:
            size = args[0] << 8 | args[1]
            found, self.address = self._read(size), self.address + size
            return found + b"\0"
        return b""
