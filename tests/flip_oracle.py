"""Prints the mean LDR-FLIP of pairs of pictures, one a line, by NVIDIA's own evaluator.

    pip install flip-evaluator pillow numpy
    python tests/flip_oracle.py a0.ppm b0.ppm a1.ppm b1.ppm ...
"""

import sys

import flip_evaluator
import numpy
from PIL import Image


def read(path):
    return numpy.asarray(Image.open(path).convert("RGB"), dtype=numpy.float32) / 255


for a, b in zip(sys.argv[1::2], sys.argv[2::2]):
    print(f"{flip_evaluator.evaluate(read(a), read(b), 'LDR', applyMagma=False)[1]:.7f}")
