"""Writes many damaged copies of an MLIR file, separated for `-split-input-file`.

Tokens are dropped, doubled, swapped and replaced by others of the file or by extreme ones. The
sequence depends on the seed only.
"""

import random
import re
import sys

EXTREME = [
    "0", "-1", "65537", "9223372036854775807", "99999999999999999999", "0x7FF0000000000000",
    "1e999", "f32", "f80", "i0", "si64", "index", "none", "tensor<*xf32>", "!warp.vec<4 x f16>",
    "!warp.array<4 x i1>", '!warp.struct<"S", {}>', "!warp", "->", "<", ">", "(", ")", "[", "]",
    "{", "}", '"', ":", ",", "%", "#", "^bb0",
]  # fmt: skip


def mutate(tokens, random_source):
    tokens = list(tokens)
    for _ in range(random_source.choice((1, 1, 1, 2, 4))):
        at = random_source.randrange(len(tokens))
        action = random_source.randrange(5)
        if action == 0:
            del tokens[at]
        elif action == 1:
            tokens.insert(at, tokens[at])
        elif action == 2:
            other = random_source.randrange(len(tokens))
            tokens[at], tokens[other] = tokens[other], tokens[at]
        elif action == 3:
            tokens[at] = random_source.choice(tokens)
        else:
            tokens[at] = random_source.choice(EXTREME)
    return "".join(tokens)


def main(path, count, seed):
    with open(path, encoding="utf-8") as file:
        text = re.sub(r"^\s*//.*\n", "", file.read(), flags=re.MULTILINE)
    tokens = re.findall(r'[%!@#]?[\w.]+|"[^"\n]*"|->|\s+|.', text)
    random_source = random.Random(seed)
    print("\n// -----\n".join(mutate(tokens, random_source) for _ in range(count)))


main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
