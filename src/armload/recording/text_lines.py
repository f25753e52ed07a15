"""The lines of a text file, or why it is none."""

from __future__ import annotations

from armload.errors import RecordingError


def refuse_zeros(where: str, line: int) -> None:
    """Raise RecordingError: a file system may have promised blocks that it never wrote."""
    raise RecordingError(f"{where}, line {line}: the file holds zero bytes: expected text; it is binary or damaged")


def lines_of(data: bytes, where: str) -> list[str]:
    """The lines of a file, without their ends; the last is what follows the last line end.

    Raises:
        RecordingError: it is empty, or no text in UTF-8; names the line.
    """
    if not data.strip():
        raise RecordingError(f"{where} is empty: expected a header line and one line per sample")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        if data.startswith((b"\xff\xfe", b"\xfe\xff")):
            raise RecordingError(f"{where} is UTF-16: expected a CSV file in UTF-8; save it as that") from None
        line = data.count(b"\n", 0, error.start) + 1
        raise RecordingError(
            f"{where}, line {line}: byte 0x{data[error.start]:02x} is not text: expected a CSV file in UTF-8; the file "
            "is binary, damaged or in another encoding"
        ) from None
    whole = text.rstrip("\0")
    if "\0" in whole:
        refuse_zeros(where, text.count("\n", 0, text.index("\0")) + 1)
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
