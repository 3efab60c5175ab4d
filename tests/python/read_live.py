"""Receives the messages of a run from `perimelt view --live`, without our code.

    pip install websockets foxglove-schemas-protobuf
    python read_live.py ws://127.0.0.1:8765 0.1

Subscribes to all topics and ends with the state of the time given (s). Prints a line for each topic: form of its messages, whether
several came, time of the last one; for points also their number and the largest x in m.
"""

import json
import struct
import sys

from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from websockets.sync.client import connect

address, end = sys.argv[1], float(sys.argv[2])
channels = {}
messages = {}
clock = 0


def is_complete():
    """Whether each topic has a message of the end."""
    return channels and all(messages.get(i, [(0, b"")])[-1][0] >= round(end * 1e9) for i in channels)


with connect(address, subprotocols=["foxglove.sdk.v1"], max_size=None) as viewer:
    while not is_complete():
        message = viewer.recv(timeout=60)
        if isinstance(message, str):
            message = json.loads(message)
            if message["op"] == "advertise":
                new = {channel["id"]: channel for channel in message["channels"]}
                channels |= new
                asked = [{"id": number, "channelId": number} for number in new]
                viewer.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
        elif message[0] == 1:
            number, time = struct.unpack_from("<IQ", message, 1)
            messages.setdefault(number, []).append((time, message[13:]))
        elif message[0] == 2:
            clock = struct.unpack_from("<Q", message, 1)[0]

for number, channel in sorted(channels.items(), key=lambda item: item[1]["topic"]):
    time, data = messages[number][-1]
    several = "several" if len(messages[number]) > 1 else "one"
    text = f"{channel['topic']}: {channel['encoding']}, {several}, until {time * 1e-9:g} s"
    if channel["schemaName"] == "foxglove.PointCloud":
        cloud = PointCloud.FromString(data)
        count = len(cloud.data) // cloud.point_stride
        largest = max(struct.unpack_from("<f", cloud.data, i * cloud.point_stride)[0] for i in range(count))
        text += f", {count} points up to x = {largest:.4f}"
    else:
        text += f", time {json.loads(data)['time']:g} s"
    print(text)
print(f"clock {clock * 1e-9:g} s")
