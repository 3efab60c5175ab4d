"""Reads the log of a run with Rerun's reader of MCAP files.

    pip install rerun-sdk
    python read_rerun.py run.mcap

Prints a line for each topic with points: states, points of the last one, and the corners of the box around them in m.
"""

import sys

import numpy
from rerun.chunk import McapReader

POSITIONS = "Points3D:positions"

reader = McapReader(sys.argv[1], timeline_type="duration_ns")
states = {}
for chunk in reader.stream():
    batch = chunk.to_record_batch()
    if POSITIONS in batch.schema.names:
        rows = batch.column(POSITIONS).to_pylist()
        states.setdefault(chunk.entity_path, []).extend(rows)
for topic, rows in states.items():
    last = numpy.array(rows[-1])
    corners = [" ".join(f"{x:.4f}" for x in corner) for corner in (last.min(0), last.max(0))]
    print(f"{topic}: {len(rows)} states, {len(last)} points from {corners[0]} to {corners[1]}")
