"""Intel HEX: what a packaged image is read from."""

import pytest

from sim_arduino.avr import intel_hex

END = ":00000001FF"


def test_records_are_pieces_at_their_addresses():
    """Data at 0x0010, then at 0x10000 through a segment and through a linear base."""
    text = f":0200100001F0FD\n:020000021000EC\n:0100000055AA\n:020000040001F9\n:0100020066 97\n{END}\n"
    pieces = [(0x10, b"\x01\xf0"), (0x10000, b"\x55"), (0x10002, b"\x66")]
    assert intel_hex.read(text.replace(" ", "")) == pieces


@pytest.mark.parametrize(
    "text, reason",
    [
        (f":0200100001F0FE\n{END}", "line 1 is ':0200100001F0FE', expected a record"),
        (f":0300100001F0FC\n{END}", "line 1"),
        (f"0200100001F0FD\n{END}", "line 1"),
        (f":zz\n{END}", "non-hexadecimal"),
        (":0200100001F0FD\n", "ends the file is missing"),
    ],
)
def test_what_is_damaged_is_refused(text, reason):
    with pytest.raises(ValueError, match=reason):
        intel_hex.read(text)
