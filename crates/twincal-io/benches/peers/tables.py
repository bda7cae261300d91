"""pyarrow's least time to read the tables named on the command line, s per file, on one thread; `--copy FROM TO` writes a Parquet file
again as pyarrow does unless told otherwise. Called by table_to_recording.rs."""

import sys
import time

import pyarrow as pa
from pyarrow import csv, feather, parquet

pa.set_cpu_count(1)
READERS = {
    "csv": lambda path: csv.read_csv(path, read_options=csv.ReadOptions(use_threads=False)),
    "parquet": lambda path: parquet.read_table(path, use_threads=False),
    "arrow": lambda path: feather.read_table(path, use_threads=False),
}
if sys.argv[1:2] == ["--copy"]:
    parquet.write_table(parquet.read_table(sys.argv[2]), sys.argv[3])
    sys.exit()
for path in sys.argv[1:]:
    read = READERS[path.rsplit(".", 1)[1]]
    best = float("inf")
    for _ in range(5):
        start = time.process_time()
        table = read(path)
        # Arrow files are mapped: a recording needs the numbers.
        columns = [table[name].to_numpy() for name in table.column_names]
        best = min(best, time.process_time() - start)
        assert len(columns) == 22
    print(path, best)
