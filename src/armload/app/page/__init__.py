"""A live stream's estimates as a page in the browser."""

from armload.app.page.drawing import Box, com_region, equivalent_box
from armload.app.page.history import History
from armload.app.page.session import Entry, Session

__all__ = ["Box", "Entry", "History", "Session", "com_region", "equivalent_box"]
