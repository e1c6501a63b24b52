"""Reads a trace with full frames with the MCAP libraries from PyPI, and holds each point cloud against its depth image.

Prints the number of messages of each protobuf type as JSON.
"""

import collections
import json
import struct
import sys

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

FIELDS = [("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("red", 12, 1), ("green", 13, 1), ("blue", 14, 1), ("alpha", 15, 1)]


def check(cloud, calibration, depth, color):
    """Each point is a pixel that was measured, where the calibration says, with that pixel's colour."""
    assert [(field.name, field.offset, field.type) for field in cloud.fields] == FIELDS
    assert cloud.frame_id == calibration.frame_id == depth.frame_id
    assert str(cloud.timestamp) == str(depth.timestamp)
    assert cloud.point_stride == 16 and len(cloud.data) % 16 == 0 and cloud.pose.orientation.w == 1
    fx, _, cx, _, fy, cy = calibration.K[:6]
    points = list(struct.iter_unpack("<fffBBBB", cloud.data))
    assert 1000 < len(points) <= 32768, len(points)
    for x, y, z, *rgba in points:
        pixel = round(y / z * fy + cy) * depth.width + round(x / z * fx + cx)
        (measured,) = struct.unpack_from("<f", depth.data, 4 * pixel)
        assert z == measured > 0 and rgba == [*color.data[3 * pixel : 3 * pixel + 3], 255]


def read(path):
    found, parts = collections.Counter(), {}
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        topics = [c.topic for c in reader.get_summary().channels.values() if c.message_encoding == "protobuf"]
        for schema, channel, message, decoded in reader.iter_decoded_messages(topics=topics):
            found[schema.name] += 1
            _, _, name = channel.topic.rpartition("/")
            frame = parts.setdefault((channel.topic.removesuffix(name), message.sequence), {})
            frame[name] = decoded
    for frame in parts.values():
        if "points" in frame:
            check(frame["points"], frame["calibration"], frame["depth"], frame["color"])
    return found


if __name__ == "__main__":
    json.dump(read(sys.argv[1]), sys.stdout)
