"""Imports the handlers of the Python board: one request handler per row of the table, one builder per reply.

Each handler has the name of its row; a test fails if a row has no handler.
"""

from . import motion_handlers, sensor_handlers, service_handlers
from .registry import REPLIES, REQUESTS

__all__ = ["REPLIES", "REQUESTS", "motion_handlers", "sensor_handlers", "service_handlers"]
