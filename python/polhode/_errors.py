"""What is raised; messages are those of the library."""


class Error(Exception):
    """What went wrong, in one line: what was found where, and what would be valid."""


class InputError(Error, ValueError):
    """What was asked for is wrong."""


class FileError(Error, OSError):
    """A file cannot be read, written or replaced."""


class RunError(Error, RuntimeError):
    """A run failed: a device was lost, for instance."""


for _class in (Error, InputError, FileError, RunError):
    _class.__module__ = "polhode"
