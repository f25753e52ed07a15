"""The simulator as a live source."""
