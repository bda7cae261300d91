"""Folders of files, on this machine or in an object store."""

from __future__ import annotations

import os
import posixpath
import secrets
import time
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, TypeVar

from twincal.errors import Error, UsageError

Place = str | os.PathLike[str] | tuple[Any, str]
"""A path, a URI, or a file system of pyarrow or fsspec with a path."""

_BLOCK = 4 << 20
_WAITS = (0.5, 2.0)
"""Seconds before the second and the third attempt at what the network refused."""
_LEFTOVER = 3600.0
"""Age in s from which an unfinished file belongs to no process that still writes it."""

_OBJECTS = {"s3", "s3a", "gs", "gcs", "abfs", "az"}
"""Stores that have no folders."""

T = TypeVar("T")


class Item(NamedTuple):
    """A file of a store."""

    name: str
    """Path below the store's folder, parts separated by "/"."""
    size: int
    """Bytes."""
    tag: str
    """Changes with the content: entity tag or time of the last change."""


class Store(Protocol):
    """A folder; names are paths below it."""

    root: str

    def shown(self, name: str) -> str:
        """Path or URI of a file, for people and for later commands."""
        ...

    def items(self, name: str = "") -> list[Item]:
        """The file of this name, or all files below it; none where there is nothing."""
        ...

    def fetch(self, name: str, to: str) -> None:
        """Copies a file to a path of this machine."""
        ...

    def put(self, name: str, data: bytes) -> None:
        """Writes a file, complete or not at all."""
        ...


def persist(action: Callable[[], T]) -> T:
    """The action's result; what the network refuses is tried three times.

    A file that is missing or forbidden, and errors of twincal, are raised at once.
    """
    for wait in (*_WAITS, None):
        try:
            return action()
        except (Error, FileNotFoundError, PermissionError):
            raise
        except OSError:
            if wait is None:
                raise
            time.sleep(wait)
    raise AssertionError


class LocalStore:
    """A folder of this machine, or one that all machines of a cluster see under one path."""

    def __init__(self, root: str) -> None:
        self.root = os.path.abspath(root)
        # In the names of unfinished files: which run they are of. Its processes get it with the store.
        self._token = secrets.token_hex(8)

    def shown(self, name: str) -> str:
        return os.path.join(self.root, name) if name else self.root

    def items(self, name: str = "") -> list[Item]:
        place = self.shown(name)
        if os.path.isfile(place):
            return [self._item(place)]
        found = []
        for folder, _, files in os.walk(place):
            paths = (os.path.join(folder, file) for file in files)
            found += [self._item(path) for path in paths if os.path.isfile(path)]
        return sorted(found)

    def _item(self, path: str) -> Item:
        stat = os.stat(path)
        name = os.path.relpath(path, self.root).replace(os.sep, "/")
        return Item(name, stat.st_size, str(stat.st_mtime_ns))

    def fetch(self, name: str, to: str) -> None:
        import shutil

        shutil.copyfile(os.path.join(self.root, name), to)

    def put(self, name: str, data: bytes) -> None:
        import tempfile

        folder, file = os.path.split(os.path.join(self.root, name))
        os.makedirs(folder, exist_ok=True)
        prefix = f".twincal-{self._token}-"
        handle, part = tempfile.mkstemp(prefix=prefix, suffix=".part", dir=folder)
        try:
            with os.fdopen(handle, "wb") as to:
                to.write(data)
                to.flush()
                os.fsync(to.fileno())
            os.chmod(part, 0o644)
            os.replace(part, os.path.join(folder, file))
        except BaseException:
            os.unlink(part)
            raise

    def sweep(self, *, own: bool = False) -> None:
        """Removes unfinished files of processes that were killed; `own`: of this run, when none of its processes writes any more."""
        mine = f".twincal-{self._token}-"
        for folder, _, files in os.walk(self.root):
            for file in files:
                if file.startswith(".twincal-") and file.endswith(".part"):
                    path = os.path.join(folder, file)
                    old = time.time() - os.stat(path).st_mtime > _LEFTOVER
                    if old or (own and file.startswith(mine)):
                        os.unlink(path)


class ArrowStore:
    """A folder of a file system of `pyarrow.fs`."""

    def __init__(self, files: Any, root: str) -> None:
        self.files, self.root = files, root.rstrip("/")

    def shown(self, name: str) -> str:
        return f"{self.files.type_name}://{posixpath.join(self.root, name)}"

    def items(self, name: str = "") -> list[Item]:
        from pyarrow.fs import FileSelector, FileType

        place = posixpath.join(self.root, name) if name else self.root
        info = self.files.get_file_info(place)
        if info.type == FileType.File:
            return [self._item(info)]
        selector = FileSelector(place, allow_not_found=True, recursive=True)
        every = self.files.get_file_info(selector)
        return sorted(self._item(own) for own in every if own.type == FileType.File)

    def _item(self, info: Any) -> Item:
        name = posixpath.relpath(info.path, self.root or "/")
        return Item(name, info.size, str(info.mtime_ns))

    def fetch(self, name: str, to: str) -> None:
        with (
            self.files.open_input_stream(posixpath.join(self.root, name)) as source,
            open(to, "wb") as file,
        ):
            while block := source.read(_BLOCK):
                file.write(block)

    def put(self, name: str, data: bytes) -> None:
        place = posixpath.join(self.root, name)
        if self.files.type_name not in _OBJECTS:
            self.files.create_dir(posixpath.dirname(place), recursive=True)
        # One call: a stream that closes after half of the data would leave half a file.
        with self.files.open_output_stream(place) as file:
            file.write(data)


class FsspecStore:
    """A folder of a file system of fsspec."""

    def __init__(self, files: Any, root: str) -> None:
        self.files, self.root = files, root.rstrip("/")

    def shown(self, name: str) -> str:
        return str(self.files.unstrip_protocol(posixpath.join(self.root, name)))

    def items(self, name: str = "") -> list[Item]:
        place = posixpath.join(self.root, name) if name else self.root
        self.files.invalidate_cache()
        try:
            every = self.files.find(place, detail=True)
        except FileNotFoundError:
            return []
        return sorted(self._item(path, info) for path, info in every.items())

    def _item(self, path: str, info: dict[str, Any]) -> Item:
        name = posixpath.relpath(path, self.root or "/")
        keys = ("ETag", "etag", "LastModified", "mtime", "updated", "created")
        tag = next((str(info[key]) for key in keys if info.get(key) is not None), "")
        return Item(name, int(info["size"]), tag)

    def fetch(self, name: str, to: str) -> None:
        self.files.get_file(posixpath.join(self.root, name), to)

    def put(self, name: str, data: bytes) -> None:
        place = posixpath.join(self.root, name)
        if not _OBJECTS & _protocols(self.files):
            self.files.makedirs(posixpath.dirname(place), exist_ok=True)
        self.files.pipe_file(place, data)


def store_of(what: str, place: object) -> Store:
    """The folder that a path, a URI, or a file system with a path names.

    Parameters
    ----------
    what : str
        What messages call the argument.
    place : Place

    Returns
    -------
    Store

    Raises
    ------
    TypeError
        For anything else.
    twincal.errors.UsageError
        For a URI that neither pyarrow nor fsspec opens.
    """
    if isinstance(place, tuple):
        if len(place) != 2 or not isinstance(place[1], str):
            raise TypeError(f"{what} is a tuple; give a file system and a path as text")
        return _wrapped(what, *place)
    if not isinstance(place, (str, os.PathLike)):
        raise TypeError(f"{what} is of {type(place).__name__}; give a path, a URI or a pair")
    text = os.fspath(place)
    if "://" not in text:
        return LocalStore(text)
    reasons = []
    for opened in (_of_arrow, _of_fsspec):
        try:
            return _wrapped(what, *opened(text))
        except (ImportError, ValueError) as error:
            reasons.append(str(error))
    raise UsageError(
        f"{what} {text}: cannot be opened ({'; '.join(reasons)})",
        "install pyarrow, or fsspec with the package for this store",
    )


def _of_arrow(uri: str) -> tuple[Any, str]:
    from pyarrow.fs import FileSystem

    files, path = FileSystem.from_uri(uri)
    return files, path


def _of_fsspec(uri: str) -> tuple[Any, str]:
    from fsspec.core import url_to_fs

    files, path = url_to_fs(uri)
    return files, path


def _protocols(files: Any) -> set[str]:
    """Names of a file system of fsspec in URIs."""
    return {files.protocol} if isinstance(files.protocol, str) else set(files.protocol)


def _wrapped(what: str, files: Any, path: str) -> Store:
    """A store of a file system, whichever library it is of."""
    if hasattr(files, "get_file_info"):
        return LocalStore(path) if files.type_name == "local" else ArrowStore(files, path)
    if hasattr(files, "get_file") and hasattr(files, "find"):
        is_local = "file" in _protocols(files)
        return LocalStore(path) if is_local else FsspecStore(files, path)
    raise TypeError(f"{what} has a {type(files).__name__}; give a file system of pyarrow or fsspec")
