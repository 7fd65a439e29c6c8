"""The bootloader of an Uno or Nano on a pty: STK500 version 1, as far as avrdude speaks it, over a flash of 32 KiB."""

import os
import select
import termios
import threading
import tty

SYNC, OK, END = 0x14, 0x10, 0x20
ARGUMENTS = {0x30: 0, 0x41: 1, 0x42: 20, 0x45: 5, 0x50: 0, 0x51: 0, 0x55: 2, 0x56: 4, 0x74: 3, 0x75: 0}
"""Bytes after each command, but for the page that 0x64 writes, whose length stands in it."""
ATMEGA328P = b"\x1e\x95\x0f"


class Bootloader:
    """Serves one pty until `close`; `flash` holds what was written.  At another baud rate it sends rubbish."""

    def __init__(self, signature=ATMEGA328P, damaged=False, baud=termios.B115200):
        self.baud = baud
        self.flash = bytearray(b"\xff" * 32768)
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
                if frame[-1] == END:
                    os.write(self.master, bytes([SYNC]) + self._do(frame[0], frame[1:-1]) + bytes([OK]))

    @staticmethod
    def _size(data):
        if data[0] != 0x64:
            return ARGUMENTS.get(data[0], 0) + 2
        return 5 + (data[1] << 8 | data[2]) if len(data) >= 3 else None

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
            size = args[0] << 8 | args[1]
            page = bytes(self.flash[self.address : self.address + size])
            return page[::-1] if self.damaged else page
        elif code == 0x75:
            return self.signature
        return b""

    def close(self):
        self._end.set()
        self._thread.join()
        os.close(self.slave)
        os.close(self.master)
