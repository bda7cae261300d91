"""Good files of every form that twincal reads, all of the same short log of the planar arm, with one number or record changed on request.

    write_log("mcap", folder, table)       # table: dict of columns t, q1, q2, qd1, qd2, tau1, tau2
"""

import io
import sqlite3
import struct
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
from mcap.writer import CompressionType, Writer

ASSETS = Path(__file__).resolve().parents[2] / "crates/twincal-cli/assets"
JOINTS = ("shoulder", "elbow")
ROWS = 1500
SCHEMA = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
METADATA = """rosbag2_bagfile_information:
  version: 5
  storage_identifier: mcap
  duration:
    nanoseconds: 1499000000
  starting_time:
    nanoseconds_since_epoch: 0
  message_count: 1500
  topics_with_message_count:
    - topic_metadata:
        name: /joint_states
        type: sensor_msgs/msg/JointState
        serialization_format: cdr
        offered_qos_profiles: ""
      message_count: 1500
  compression_format: ""
  compression_mode: ""
  relative_file_paths:
    - bag_0.mcap
  files:
    - path: bag_0.mcap
      starting_time:
        nanoseconds_since_epoch: 0
      duration:
        nanoseconds: 1499000000
      message_count: 1500
"""


def good_table():
    """The first rows of the planar arm's first log."""
    read = pyarrow.parquet.read_table(ASSETS / "train1.parquet").slice(0, ROWS)
    names = ("t", "q1", "q2", "qd1", "qd2", "tau1", "tau2")
    return {name: read[name].to_numpy().copy() for name in names}


class Cdr:
    """Little-endian CDR, aligned behind its header of four bytes."""

    def __init__(self):
        self.bytes = bytearray(b"\x00\x01\x00\x00")

    def number(self, form, value):
        """One number at its alignment."""
        size = struct.calcsize(form)
        self.bytes += b"\x00" * (-(len(self.bytes) - 4) % size)
        self.bytes += struct.pack("<" + form, value)

    def text(self, value):
        """A string with its length and its NUL."""
        raw = value if isinstance(value, bytes) else value.encode()
        self.number("I", len(raw) + 1)
        self.bytes += raw + b"\x00"


def joint_state(sec, nanosec, names, lists, length=None):
    """One sensor_msgs/JointState; `length` is written instead of the lengths of its lists of numbers."""
    out = Cdr()
    out.number("i", sec)
    out.number("I", nanosec)
    out.text("")
    out.number("I", len(names))
    for name in names:
        out.text(name)
    for values in lists:
        out.number("I", len(values) if length is None else length)
        for value in values:
            out.number("d", value)
    return bytes(out.bytes)


def messages(table, change=None):
    """(log time in ns, message) of every row; `change(row, parts)` may change the parts of a message."""
    out = []
    for row in range(len(table["t"])):
        time = table["t"][row]
        nanoseconds = int(round(min(max(np.nan_to_num(time, nan=-1.0), -2e9), 2e9) * 1e9))
        lists = [[table[f"{channel}{j}"][row] for j in (1, 2)] for channel in ("q", "qd", "tau")]
        parts = {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9, "names": JOINTS, "lists": lists, "length": None,
                 "log_time": max(nanoseconds, 0)}  # fmt: skip
        if change is not None:
            change(row, parts)
        log_time = parts.pop("log_time")
        out.append((log_time, joint_state(**parts)))
    return out


def mcap_bytes(rows, compression=CompressionType.ZSTD):
    """An MCAP file of messages."""
    file = io.BytesIO()
    writer = Writer(file, compression=compression)
    writer.start("ros2", "study")
    schema = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", SCHEMA.encode())
    channel = writer.register_channel("/joint_states", "cdr", schema)
    for number, (time, data) in enumerate(rows):
        writer.add_message(channel, time, data, time, number)
    writer.finish()
    return file.getvalue()


def write_sqlite(path, rows):
    """A rosbag2 database of messages."""
    path.unlink(missing_ok=True)
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT)")
        base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
        base.execute("INSERT INTO topics VALUES(1, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr', '')")
        base.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(1, ?, ?)", rows)
    base.close()


def csv_bytes(table):
    """CSV with every digit."""
    rows = [",".join(table)]
    rows += [",".join(repr(float(value)) for value in row) for row in zip(*table.values())]
    return ("\n".join(rows) + "\n").encode()


def arrow_bytes(table, stream):
    """Arrow IPC: file or stream."""
    arrow = pyarrow.table(table)
    file = io.BytesIO()
    with (pyarrow.ipc.new_stream if stream else pyarrow.ipc.new_file)(file, arrow.schema) as writer:
        writer.write_table(arrow)
    return file.getvalue()


def log_bytes(form, table):
    """The file of a table of numbers in this form (not for SQLite and folders)."""
    if form == "csv":
        return csv_bytes(table)
    if form in ("arrow", "arrows"):
        return arrow_bytes(table, form == "arrows")
    file = io.BytesIO()
    if form == "parquet":
        pyarrow.parquet.write_table(pyarrow.table(table), file)
    elif form == "npz":
        np.savez(file, **table)
    elif form == "mcap":
        return mcap_bytes(messages(table))
    return file.getvalue()


def write_log(form, folder, table, change=None):
    """Writes the log; returns the file whose bytes are damaged and the path that the program is given."""
    folder.mkdir(parents=True, exist_ok=True)
    if form == "db3":
        path = folder / "log.db3"
        write_sqlite(path, messages(table, change))
        return path, path
    if form == "rosbag2":
        bag = folder / "bag"
        bag.mkdir(exist_ok=True)
        (bag / "bag_0.mcap").write_bytes(mcap_bytes(messages(table, change)))
        (bag / "metadata.yaml").write_text(METADATA)
        return bag / "metadata.yaml", bag
    path = folder / f"log.{form}"
    path.write_bytes(mcap_bytes(messages(table, change)) if form == "mcap" else log_bytes(form, table))
    return path, path
