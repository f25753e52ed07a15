"""What a live stream says, as lines of JSON or as a page in the browser."""

from armload.live.headless import line_of, lines
from armload.live.history import History
from armload.live.session import Entry, Session
from armload.live.shapes import Box, com_region, equivalent_box, equivalent_ellipsoid

__all__ = [
    "Box",
    "Entry",
    "History",
    "Session",
    "com_region",
    "equivalent_box",
    "equivalent_ellipsoid",
    "line_of",
    "lines",
]
