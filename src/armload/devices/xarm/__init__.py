"""UFACTORY xArm: the form of a payload."""
