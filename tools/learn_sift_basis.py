#!/usr/bin/env python3
"""Writes src/features/sift_basis.c: the directions in which SIFT descriptors vary most.

    tools/learn_sift_basis.py build/fovea PICTURE... >src/features/sift_basis.c

The table in the tree was learnt from the photographs of coco_32 and images (tests/import), 1,500
features of each. It makes matching fast, not right: any table gives the same matches.
"""
import json
import subprocess
import sys

import numpy

ROWS, SQUARE, SHIFT = 28, 128, 6  # the square of a row's length, before the shift


def descriptors(fovea, picture):
    command = [fovea, "features", picture, "--method", "sift", "--max", "1500", "--json"]
    found = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    return [list(bytes.fromhex(feature["descriptor"])) for feature in found["features"]]


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    learnt = numpy.array([d for picture in sys.argv[2:] for d in descriptors(sys.argv[1], picture)])
    _, vectors = numpy.linalg.eigh(numpy.cov(learnt.T.astype(float)))
    basis = vectors.T[::-1][:ROWS]
    basis *= numpy.sign(basis.sum(axis=1))[:, None]
    table = numpy.rint(basis * (SQUARE**0.5 * 2**SHIFT)).astype(int)
    print('/* Written by tools/learn_sift_basis.py. */\n#include "features/sift_basis.h"\n')
    print("const int16_t fv_sift_basis[FV_SIFT_BASIS_ROWS][FV_SIFT_BASIS_BYTES] = {")
    for row in table:
        print("    {" + ", ".join(str(value) for value in row) + "},")
    print("};")


main()
