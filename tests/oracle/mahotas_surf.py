"""SURF of mahotas (PyPI): the strongest features of grey pictures.

Usage: mahotas_surf.py COUNT PICTURE.pgm...      writes PICTURE.pgm.surf: lines of x y and 64 values
"""
import sys

import numpy
from mahotas.features import surf


def read_pgm(path):
    """Pixels of a binary PGM of 8 bits."""
    with open(path, "rb") as file:
        data = file.read()
    fields, at = [], 0
    while len(fields) < 4:
        end = at
        while not data[end:end + 1].isspace():
            end += 1
        fields.append(data[at:end])
        at = end + 1
    if fields[0] != b"P5" or fields[3] != b"255":
        sys.exit(f"{path}: not a binary PGM of 8 bits")
    width, height = int(fields[1]), int(fields[2])
    return numpy.frombuffer(data, numpy.uint8, width * height, at).reshape(height, width)


def main():
    count = int(sys.argv[1])
    for path in sys.argv[2:]:
        # Every point is asked for, the strongest are described, less those at the border; a row is
        # y, x, scale, score, laplacian, angle and the descriptor.
        picture = read_pgm(path)
        points = surf.interest_points(picture, max_points=100000)
        points = points[numpy.argsort(-points[:, 3], kind="stable")][:2 * count]
        found = surf.descriptors(picture, points)[:count]
        numpy.savetxt(path + ".surf", found[:, [1, 0] + list(range(6, 70))], fmt="%.9g")


if __name__ == "__main__":
    main()
