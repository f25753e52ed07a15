"""KUKA LBR iiwa: the form of a payload."""
