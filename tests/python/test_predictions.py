"""Predictions out as MCAP: read by the packages of the format's and of ROS 2's makers, they are the numbers of the CSV."""

import csv
import math

import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from conftest import ASSETS, fit, twincal
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

QUICK = """[library]
terms = ["sin(q2)"]
generic = false
friction = ["viscous"]
offset = false
motor_inertia = false
"""
TOPICS = {"measured": "tau_meas", "nominal": "tau_nom", "calibrated": "tau", "low95": "tau_low95", "high95": "tau_high95"}


@pytest.fixture(scope="module")
def predicted(tmp_path_factory):
    """A folder with the same prediction as CSV and as MCAP."""
    folder = tmp_path_factory.mktemp("predicted")
    fit(folder, [ASSETS / "train1.parquet"], QUICK, expect=None)
    for name in ["predicted.csv", "predicted.mcap"]:
        twincal("predict", ASSETS / "heldout1.parquet", "--twin", folder / "out", "-o", folder / name, expect=None)
    return folder


def test_mcap_is_the_csv(predicted):
    with open(predicted / "predicted.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) > 100
    counts = dict.fromkeys([*TOPICS, "extrapolating"], 0)
    with open(predicted / "predicted.mcap", "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            topic = channel.topic.removeprefix("/twincal/")
            row = rows[counts[topic]]
            counts[topic] += 1
            ns = round(float(row["t"]) * 1e9)
            assert message.log_time == ns
            if topic == "extrapolating":
                assert schema.name == "std_msgs/msg/Bool"
                assert decoded.data == (row["extrapolating"] == "true")
                continue
            assert schema.name == "sensor_msgs/msg/JointState"
            assert decoded.header.stamp.sec * 10**9 + decoded.header.stamp.nanosec == ns
            assert list(decoded.position) == list(decoded.velocity) == []
            assert len(decoded.name) == len(decoded.effort) == 2
            for joint, effort in zip(decoded.name, decoded.effort):
                cell = float(row[f"{joint}.{TOPICS[topic]}"])
                assert effort == cell or math.isnan(effort) and math.isnan(cell)
    assert set(counts.values()) == {len(rows)}, counts


def earlier(folder, name, seconds):
    """The held-out log with its clock set back."""
    table = pq.read_table(ASSETS / "heldout1.parquet")
    time = pc.subtract(table["t"], seconds)
    pq.write_table(table.set_column(table.column_names.index("t"), "t", time), folder / name)
    return folder / name


def test_time_that_mcap_cannot_hold_is_refused(predicted, tmp_path):
    def predict(log, out, expect):
        return twincal("predict", log, "--twin", predicted / "out", "-o", tmp_path / out, expect=expect)

    refused = predict(earlier(tmp_path, "early.parquet", 5.0), "out.mcap", 2)
    assert "cannot stand in an MCAP file" in refused.stderr and "write .parquet or .csv" in refused.stderr
    assert not (tmp_path / "out.mcap").exists()
    predict(tmp_path / "early.parquet", "out.csv", None)
    with open(tmp_path / "out.csv", newline="") as file:
        assert float(next(csv.DictReader(file))["t"]) < 0
    # Rows that filters take are not written: their times do not count.
    predict(earlier(tmp_path, "border.parquet", 0.05), "border.mcap", None)
