"""Reads a memory folder's log with nothing but docs/memory-format.md: prints what its events add up to, as JSON."""

import json
import pathlib
import struct
import sys

SECTOR = 512
TABLE = []
for byte in range(256):
    for _ in range(8):
        byte = byte >> 1 ^ (0x82F63B78 if byte & 1 else 0)
    TABLE.append(byte)


def crc32c(data, check=0):
    check ^= 0xFFFFFFFF
    for byte in data:
        check = TABLE[(check ^ byte) & 0xFF] ^ check >> 8
    return check ^ 0xFFFFFFFF


class Input:
    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, layout):
        values = struct.unpack_from("<" + layout, self.data, self.at)
        self.at += struct.calcsize("<" + layout)
        return values if len(values) > 1 else values[0]


def apply(op, words, objects):
    tag = op.take("B")
    if tag == 1:
        kind, length = op.take("BB")
        words.append((op.data[op.at : op.at + length].decode(), kind))
        op.at += length
    elif tag == 2:
        op.take("HH")
    elif tag == 3:
        ident, category, _region = op.take("IHH")
        position, _rotation, _confidence = op.take("3f"), op.take("3f"), op.take("f")
        parts, affordances, states = op.take("BBB")
        op.at += 64 * parts + 2 * affordances
        held = {words[op.take("H") - 1][0] for _ in range(states)}
        held |= objects.get(ident, {}).get("states", set())
        objects[ident] = {"category": words[category - 1][0], "position": position, "parts": parts, "states": held}
    elif tag == 4:
        ident, position, _rotation = op.take("I"), op.take("3f"), op.take("3f")
        objects[ident]["position"] = position
    elif tag == 5:
        op.take("IH")
    elif tag == 6:
        ident, state, sure = op.take("IHB")
        (objects[ident]["states"].add if sure == 2 else objects[ident]["states"].discard)(words[state - 1][0])
    elif tag == 7:
        op.take("IHd")
    elif tag == 8:
        op.take("IHIB")
    elif tag == 9:
        op.take("If")
    elif tag == 10:
        del objects[op.take("I")]
    elif tag == 11:
        op.take("HHf")
    elif tag == 12:
        objects.clear()
    else:
        raise ValueError(f"operation {tag}")


def read(folder):
    lines = dict(line.split(" ", 1) for line in (folder / "FORMAT").read_text().splitlines())
    assert lines["acm-memory"] == "2", lines
    words, objects, sequence, batches = [], {}, 0, 0
    for path in sorted(folder.glob("log-*")):
        data = path.read_bytes()
        number, batch, first = struct.unpack_from("<8xQ8xQQ", data)
        assert data[:8] == b"ACM-LOG2" and crc32c(data[:40]) == struct.unpack_from("<I", data, 40)[0], path
        assert (number, batch, first) == (int(path.name[4:]), batches, sequence), path
        at, pending = SECTOR, []
        while at < len(data):
            size, check = struct.unpack_from("<II", data, at)
            seen = crc32c(struct.pack("<Q", sequence + len(pending)))
            assert crc32c(data[at + 8 : at + 8 + size], crc32c(data[at : at + 4], seen)) == check, (path, at)
            kind, body = data[at + 8], data[at + 9 : at + 8 + size]
            at += 8 + size
            if kind == 1:
                pending.append(body)
            elif kind == 2:
                assert struct.unpack_from("<QQ", body) == (batches, sequence + len(pending))
                for body in pending:
                    event = Input(body)
                    _valid, _source, _confidence, evidence, ops, _about = event.take("QHBBHH")
                    event.at += 9 * evidence
                    for _ in range(ops):
                        apply(event, words, objects)
                sequence, batches, pending = sequence + len(pending), batches + 1, []
                at = -(-at // SECTOR) * SECTOR
    for thing in objects.values():
        thing["states"] = sorted(thing["states"])
    return {"events": sequence, "objects": objects}


print(json.dumps(read(pathlib.Path(sys.argv[1]))))
