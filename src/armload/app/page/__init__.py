"""A live stream's estimates as a page in the browser."""

from armload.app.page.drawing import Box, com_region, equivalent_box

__all__ = ["Box", "com_region", "equivalent_box"]
