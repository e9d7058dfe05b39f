def siphash(key, message):
    mask, words = 2**64 - 1, [int.from_bytes(key[i:i + 8], "little") for i in (0, 8)]
    v = [w ^ c for w, c in zip(words * 2, (0x736F6D6570736575, 0x646F72616E646F6D, 0x6C7967656E657261, 0x7465646279746573))]
    rot = lambda x, n: (x << n | x >> 64 - n) & mask

    def rounds(n):
        for _ in range(n):
            for a, b, c, d, s, t in ((0, 1, 2, 3, 13, 16), (2, 1, 0, 3, 17, 21)):
                v[a], v[c] = (v[a] + v[b]) & mask, (v[c] + v[d]) & mask
                v[b], v[d] = rot(v[b], s) ^ v[a], rot(v[d], t) ^ v[c]
                v[a] = rot(v[a], 32)

    message += bytes(-(len(message) + 1) % 8) + bytes([len(message)])
    for i in range(0, len(message), 8):
        word = int.from_bytes(message[i:i + 8], "little")
        v[3] ^= word
        rounds(2)
        v[0] ^= word
    v[2] ^= 0xFF
    rounds(4)
    return (v[0] ^ v[1] ^ v[2] ^ v[3]).to_bytes(8, "little")


def unlock(node, key=b"friction default"):
    serial = node.sdo[0x1018][4].raw
    challenge = node.sdo[0x2041][2].data
    message = challenge + serial.to_bytes(4, "little") + bytes([node.id])
    node.sdo[0x2041][3].data = siphash(key, message)
