"""Exceptions. Each has one sentence, that of the command line."""


class Error(Exception):
    """A failure of the library."""


class UsageError(Error, ValueError):
    """An argument that can never work, or arguments that do not go together."""


class FileError(Error, OSError):
    """A file could not be read or written."""


class MissingFileError(FileError, FileNotFoundError):
    """A file does not exist."""


class MalformedError(Error, ValueError):
    """The content of a file violates its format."""


class EmptySceneError(Error, ValueError):
    """The inputs together hold nothing to draw."""


class NoMemoryError(Error, MemoryError):
    """The system has too little memory."""


class DeviceError(Error, RuntimeError):
    """No adapter fits, a limit of the adapter is too small, or the device failed."""


class StudyError(Error, RuntimeError):
    """A study ran, but a configuration did not do what the study states.

    ``rows`` has the measurements, as :func:`epsplat.study` returns them.
    """

    rows: list = []
