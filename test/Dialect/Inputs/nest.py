"""Writes types that nest deeply, or that are large however small the text is."""

import sys


def main(kind, depth):
    if kind == "array":
        text = "!warp.array<1 x " * depth + "f32" + ">" * depth
    elif kind == "struct":
        text = '!warp.struct<"S", {x: ' * depth + "f32" + "}>" * depth
    elif kind == "chain":
        # Each alias holds the one before: the nesting is in no single line.
        print('!t0 = !warp.struct<"S", {x: f32}>')
        for i in range(1, depth):
            print(f'!t{i} = !warp.struct<"S", {{x: !t{i - 1}}}>')
        text = f"!t{depth - 1}"
    else:
        # Each alias holds the one before twice: 2 to the power of depth parts.
        print('!t0 = !warp.struct<"S", {}>')
        for i in range(1, depth):
            part = f"!warp.array<1 x !t{i - 1}>" if kind == "arrays" else f"!t{i - 1}"
            print(f'!t{i} = !warp.struct<"S", {{x: {part}, y: {part}}}>')
        text = f"!t{depth - 1}"
    print(f"func.func private @f({text})")


main(sys.argv[1], int(sys.argv[2]))
