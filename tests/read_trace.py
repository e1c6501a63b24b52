"""Reads a trace with the MCAP libraries from PyPI and prints what it found as JSON.

Shows how little it takes to look into a trace from Python, and lets a test compare that with what ACM itself reads.
"""

import json
import struct
import sys

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory


def png_size(data):
    """Width and height from the header of a PNG."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n", "no PNG"
    return list(struct.unpack(">II", data[16:24]))


def read(path):
    """Everything that the test compares."""
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = {"messages": [], "frames": [], "thumbnails": [], "lines": 0}
        for schema, channel, message in reader.iter_messages():
            if schema.name == "acm.Message":
                record = json.loads(message.data)
                missing = set(json.loads(schema.data)["required"]) - set(record)
                assert not missing, f"a record without {missing}"
                assert message.log_time == record["t"] and channel.topic == f"/{record['to']}/{record['kind']}"
                found["messages"].append(record)
            elif channel.topic == "/effect/frame":
                found["frames"].append(json.loads(message.data)["frame"])
        viewers = [c.topic for c in reader.get_summary().channels.values() if c.message_encoding == "protobuf"]
        for _, channel, _, decoded in reader.iter_decoded_messages(topics=viewers):
            if channel.topic == "/log":
                found["lines"] += 1
                assert decoded.message and decoded.line
            elif channel.topic.endswith("/thumbnail"):
                found["thumbnails"].append(png_size(decoded.data))
            elif channel.topic.endswith("/calibration"):
                assert len(decoded.K) == 9 and decoded.K[0] > 0
        # By time messages of one moment may come in any order; their numbers say which came first.
        found["messages"].sort(key=lambda record: record["seq"])
        found["run"] = next(m.metadata for m in reader.iter_metadata() if m.name == "acm.run")
        found["attachments"] = sorted(attachment.name for attachment in reader.iter_attachments())
        return found


if __name__ == "__main__":
    json.dump(read(sys.argv[1]), sys.stdout)
