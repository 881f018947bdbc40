"""Prints what others read from pictures: size and mode, then the values of each pixel, rows from the top.

    pip install pillow numpy mitsuba
    python tests/pictures_oracle.py picture...
"""

import sys

import numpy
from PIL import Image


def read(path):
    if not path.endswith(".exr"):
        picture = Image.open(path)
        return picture.mode, numpy.asarray(picture)
    import mitsuba

    bitmap = mitsuba.Bitmap(path)
    return " ".join(channel.name for channel in bitmap.struct_()), numpy.array(bitmap)


for path in sys.argv[1:]:
    mode, values = read(path)
    print(values.shape[1], values.shape[0], mode, *(f"{value:g}" for value in values.flatten()))
