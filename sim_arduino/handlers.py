"""What each row of the table does on the Python board: one request handler per row, one reply builder per reply.

The handlers' names are the rows' names; a test fails if a row has none.
"""

from . import motion_rows, sensor_rows, service_rows
from .rows import REPLIES, REQUESTS

__all__ = ["REPLIES", "REQUESTS", "motion_rows", "sensor_rows", "service_rows"]
