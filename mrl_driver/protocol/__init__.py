"""The wire format: the table of commands, and bytes to frames and back.  No I/O; imports only errors.

`decoder` parses frames, `encoder` writes them, and `table` says which there are.
"""

from .decoder import FrameDecoder
from .directions import REPLIES, REQUESTS, REQUESTS_TO_ANY, Direction
from .encoder import encode_reply, encode_request
from .frames import Event, Frame, Garbage, Stamp, check_value
