"""Files that are there whole or not at all."""

from pathlib import Path


def write_whole(path: Path, content: bytes | str) -> None:
    """Write a file; on a full disk none is left, since half of it would be taken for the whole.

    Parameters
    ----------
    path : Path
        Overwritten.
    content : bytes or str
        Text is written in UTF-8.

    Raises
    ------
    OSError
        If it can't be written, with its name.
    """
    try:
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    except OSError as error:
        if path.is_file():
            path.unlink()
        raise OSError(error.errno, error.strerror, str(path)) from error
