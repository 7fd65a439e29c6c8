"""What each row of the table does on the Python board: one request handler per row, one reply builder per reply.

The handlers' names are the rows' names; a test fails if a row has none.
"""

from . import motion_handlers, sensor_handlers, service_handlers
from .registry import REPLIES, REQUESTS

__all__ = ["REPLIES", "REQUESTS", "motion_handlers", "sensor_handlers", "service_handlers"]
