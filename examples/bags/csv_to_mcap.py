"""Writes a CSV log as an MCAP file of sensor_msgs/JointState, as a robot's recorder would have.

    pip install mcap==1.6.0 mcap-ros2-support==0.6.0
    python csv_to_mcap.py run0.csv run0.mcap Joint1 Joint2      # LOG, file to write, joint names in the order of q1, q2, ...

Columns t, q1 ..., qd1 ..., tau1 ... as in examples/double_pendulum; what is missing stays an empty array. Stamps are seconds after
an arbitrary start.
"""

import csv
import sys

from mcap_ros2.writer import Writer

START = 1_700_000_000
DEFINITION = """std_msgs/Header header
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


def record(target, joints, rows):
    """One message per row (seconds, positions, velocities, efforts, and a topic where it is not /joint_states)."""
    with open(target, "wb") as out:
        writer = Writer(out)
        schema = writer.register_msgdef("sensor_msgs/msg/JointState", DEFINITION)
        for number, (t, position, velocity, effort, *topic) in enumerate(rows):
            stamp = START * 10**9 + round(t * 1e9)
            header = {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": ""}
            message = {"header": header, "name": joints, "position": position, "velocity": velocity, "effort": effort}
            writer.write_message(*(topic or ["/joint_states"]), schema, message, stamp, stamp, number)
        writer.finish()


def main(source, target, joints):
    """The rows of a CSV log as messages."""

    def numbers(row, short):
        names = [f"{short}{j + 1}" for j in range(len(joints))]
        return [float(row[name]) for name in names] if names[0] in row else []

    with open(source, newline="") as log:
        rows = csv.DictReader(log)
        record(target, joints, ((float(row["t"]), *(numbers(row, short) for short in ("q", "qd", "tau"))) for row in rows))


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2], sys.argv[3:])
