"""First 64 bits of ChaCha8 keyed with SplitMix64(seed), 64-bit stream number in the nonce: a plain-Python cipher (RFC 8439 rounds, 8 of them)."""

import sys

MASK = (1 << 64) - 1


def splitmix64(seed, count):
    state, words = seed, []
    for _ in range(count):
        state = (state + 0x9E3779B97F4A7C15) & MASK
        z = state
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
        words.append(z ^ (z >> 31))
    return words


def chacha8_block(key64, counter, stream):
    key = [half for word in key64 for half in (word & 0xFFFFFFFF, word >> 32)]
    state = [0x61707865, 0x3320646E, 0x79622D32, 0x6B206574, *key, counter & 0xFFFFFFFF, counter >> 32, stream & 0xFFFFFFFF, stream >> 32]
    work = list(state)

    def quarter(a, b, c, d):
        for first, second, third, turn in ((a, b, d, 16), (c, d, b, 12), (a, b, d, 8), (c, d, b, 7)):
            work[first] = (work[first] + work[second]) & 0xFFFFFFFF
            mixed = work[third] ^ work[first]
            work[third] = ((mixed << turn) | (mixed >> (32 - turn))) & 0xFFFFFFFF

    for _ in range(4):
        for column in range(4):
            quarter(column, 4 + column, 8 + column, 12 + column)
        quarter(0, 5, 10, 15), quarter(1, 6, 11, 12), quarter(2, 7, 8, 13), quarter(3, 4, 9, 14)
    return [(w + s) & 0xFFFFFFFF for w, s in zip(work, state)]


seed, stream = int(sys.argv[1]), int(sys.argv[2])
words = chacha8_block(splitmix64(seed, 4), 0, stream)
print(hex(words[0] | words[1] << 32))
